"""A document on the terminal.

Foreign text never passes as markup; colours follow the console (`NO_COLOR`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from algid.base.text import visible
from algid.base.verdict import Grade
from algid.report.brief import verdict_lines
from algid.report.document import Document, Kind, Table
from algid.results import Status

if TYPE_CHECKING:
    from rich.console import Console

GRADE_STYLES: dict[Grade, str] = {
    "good": "bold green",
    "reservations": "bold yellow",
    "failed": "bold red",
}
LONGEST_WORD = 24  # columns; what is longer, like a path, breaks where it must
LONGEST = 4_000  # characters of a cell: a command that names many logs is there to be copied


def print_document(document: Document, console: Console) -> None:
    """Print the verdict, what was found, and what is known against it, to `console`."""
    from rich.text import Text

    judged = document.verdict
    shown = Text("\n".join(verdict_lines(judged, console.width)))
    shown.stylize(GRADE_STYLES[judged.grade], 0, len(judged.word))
    console.print(shown, soft_wrap=True)
    for table in document.tables():
        console.print()
        print_table(table, console, failed=judged.failed)


def print_table(table: Table, console: Console, *, failed: bool = False) -> None:
    """Print one table, less the last columns where the console has no room for all.

    No digit is ever cut off. No status of a result that failed is shown as good.
    """
    from rich import box
    from rich.cells import cell_len
    from rich.table import Table as RichTable
    from rich.text import Text

    made = RichTable(
        title=Text(table.title, "bold"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        show_edge=False,
        collapse_padding=True,
    )
    styles = {"name": "bold", "number": "", "text": "", "status": "bold yellow"}
    rows = [[visible(cell, LONGEST) for cell in row] for row in table.rows]
    shown, room = list[tuple[int, Kind]](), console.width + 2
    widths = list[tuple[str, int, int]]()
    for place, heading, kind in table.heads:
        cells = [heading, *(row[place] for row in rows)]
        words = cells if kind == "number" else " ".join(cells).split()
        least = max(min(cell_len(word), LONGEST_WORD) for word in words)
        if shown and room < least + 2:
            break
        room -= least + 2
        shown.append((place, kind))
        widths.append((heading, least, max(map(cell_len, cells)) - least))
    # rich itself narrows the widest columns first, and cuts their digits
    for (_, kind), (heading, least, more) in zip(shown, widths, strict=True):
        more = min(more, max(room, 0))
        room -= more
        side: Literal["left", "right"] = "right" if kind == "number" else "left"
        made.add_column(Text(heading), justify=side, overflow="fold", width=least + more)
    for row in rows:
        line = []
        for place, kind in shown:
            good = kind == "status" and row[place] == Status.OK.value and not failed
            line.append(Text(row[place], "green" if good else styles[kind]))
        made.add_row(*line)
    console.print(made)
    if table.note:
        console.print(Text(visible(table.note, LONGEST), "dim"))
