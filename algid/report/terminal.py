"""A document on the terminal.

Foreign text never passes as markup; colours follow the console (`NO_COLOR`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from algid.base.text import lines_of, visible
from algid.base.verdict import Grade, Verdict
from algid.base.words import counted
from algid.report.brief import run_first
from algid.report.document import Document, Table
from algid.results import Status

if TYPE_CHECKING:
    from rich.console import Console

LONGEST_WORD = 24  # columns; what is longer, like a path, breaks where it must
GRADE_STYLES: dict[Grade, str] = {
    "good": "bold green",
    "reservations": "bold yellow",
    "failed": "bold red",
}


def print_document(document: Document, console: Console) -> None:
    """Print the verdict, what was found, and what is known against it, to `console`."""
    print_verdict(document.verdict, console)
    for table in document.tables():
        console.print()
        print_table(table, console, failed=document.verdict.failed)


def print_verdict(judged: Verdict, console: Console, most: int | None = None) -> None:
    """Print grade and headline, what to run first, and `most` of the reasons, by default all."""
    from rich.table import Table as RichTable
    from rich.text import Text

    head = lines_of(f"{judged.word}: {visible(judged.headline)}.", console.width)
    shown = Text("\n".join(head))
    shown.stylize(GRADE_STYLES[judged.grade], 0, len(judged.word))
    console.print(shown)
    points = RichTable.grid(padding=(0, 1))
    points.add_column()
    points.add_column(overflow="fold")
    for reason in judged.reasons[:most]:
        points.add_row(" •", Text.assemble(visible(reason.sentence), (f" [{reason.code}]", "dim")))
    left = judged.reasons[len(judged.reasons[:most]) :]
    if left:
        points.add_row("", f"and {counted(len(left), 'more reason')}, with -v and in the report")
    if points.row_count:
        console.print(points)
    if judged.command:
        for line in run_first(judged.command):
            console.print(Text(line), soft_wrap=True)


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
    kept, used = 0, 0
    for place, (heading, kind) in enumerate(table.columns.items()):
        cells = [row[place] for row in table.rows]
        # the least width that breaks no number, and no word but those longer than any
        words = " ".join((heading, *cells)).split()
        least = max(min(cell_len(word), LONGEST_WORD) for word in words)
        if kind == "number":
            least = max(least, *map(cell_len, cells), 1)
        used += least + 2
        if place and used - 2 > console.width:
            break
        kept += 1
        side = "right" if kind == "number" else "left"
        made.add_column(Text(heading), justify=side, overflow="fold", min_width=least)  # type: ignore[arg-type]
    for row in table.rows:
        line = []
        for cell, kind in zip(row[:kept], table.columns.values(), strict=False):
            good = kind == "status" and cell == Status.OK.value and not failed
            line.append(Text(cell, "green" if good else styles[kind]))
        made.add_row(*line)
    console.print(made)
    if table.note:
        console.print(Text(table.note, "dim"))
