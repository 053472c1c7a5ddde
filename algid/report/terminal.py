"""A document on the terminal.

Foreign text never passes as markup; colours follow the console (`NO_COLOR`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from algid.report.brief import run_first
from algid.report.document import Column, Depth, Document, Table
from algid.results import Status
from algid.text import lines_of, visible
from algid.verdict import Grade, Verdict
from algid.words import counted

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

LONGEST_WORD = 24  # columns; what is longer, like a path, breaks where it must
GRADE_STYLES: dict[Grade, str] = {
    "good": "bold green",
    "reservations": "bold yellow",
    "failed": "bold red",
}


def print_document(document: Document, console: Console) -> None:
    """Print the verdict, what was found, and what is known against it, to `console`."""
    print_verdict(document.verdict, console)
    for table in document.tables(Depth.TERMINAL):
        console.print()
        print_table(table, console)


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


def print_table(table: Table, console: Console) -> None:
    """Print one table, less the columns that the console has no room for.

    No digit is ever cut off.
    """
    from rich.cells import cell_len
    from rich.measure import Measurement
    from rich.text import Text

    while True:
        headings = tuple(column.heading for column in table.columns)
        columns = list(zip(headings, *table.rows, strict=True))
        widths = [max(map(cell_len, column)) for column in columns]
        wanted = Measurement.get(
            console, console.options.update(width=10_000), rich_table(table, widths)
        ).maximum
        room = sum(widths) - max(wanted - console.width, 0)
        narrowed = _narrowed(widths, list(map(_least, table.columns, columns)), room)
        fewer = table.narrower()
        most_missed = all(column.rank <= 1 for column in table.columns)
        squeezed = sum(narrowed) <= room and most_missed and table.upright is None
        if sum(widths) <= room or squeezed:
            break
        other = fewer or table.upright
        if other is None:
            break
        table = other
    console.print(rich_table(table, narrowed))
    if table.note:
        console.print(Text(table.note, "dim"))


def _least(column: Column, cells: tuple[str, ...]) -> int:
    """Least width that breaks no number of a column, and no word but those longer than any."""
    from rich.cells import cell_len

    least = 1
    for cell in cells:
        for word in cell.split():
            least = max(least, min(cell_len(word), LONGEST_WORD))
    if column.kind == "number":
        least = max(least, max(map(cell_len, cells[1:]), default=0))
    return least


def _narrowed(widths: list[int], least: list[int], room: int) -> list[int]:
    """Widths that add up to `room`: the widest column gives way first, none below its least."""
    narrowed = list(widths)
    while sum(narrowed) > room:
        wide = [i for i, width in enumerate(narrowed) if width > least[i]]
        if not wide:
            break
        narrowed[max(wide, key=narrowed.__getitem__)] -= 1
    return narrowed


def rich_table(table: Table, widths: Sequence[int]) -> RichTable:
    """`table` as rich sets it, its columns that wide."""
    from rich import box
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
    for column, width in zip(table.columns, widths, strict=True):
        side: Literal["right", "left"] = "right" if column.kind == "number" else "left"
        made.add_column(Text(column.heading), justify=side, overflow="fold", width=width)
    for row in table.rows:
        cells = []
        for column, cell in zip(table.columns, row, strict=True):
            cells.append(Text(cell, _style(column.kind, cell)))
        made.add_row(*cells)
    return made


def _style(kind: str, cell: str) -> str:
    if kind == "doubtful status":
        return "bold red"
    if kind == "status":
        return "green" if cell == Status.OK.value else "bold yellow"
    if kind == "name":
        return "bold"
    return ""
