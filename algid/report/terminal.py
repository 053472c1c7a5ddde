"""What a terminal shows: a result in few lines, a document's tables, what a log holds.

Foreign text never passes as it is; colours follow the console (`NO_COLOR`).
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

from algid.arm import CONSTANT_NAMES as ARM
from algid.base.text import ABSENT, cells, counted, joined, lines_of, printable, visible
from algid.model import DELAYS
from algid.notices import MOST_REASONS, Grade, Verdict, codes_of
from algid.report.document import Document, Table
from algid.results import Result, Status
from algid.results.rows import rows_of
from algid.results.verdict import share_text

if TYPE_CHECKING:
    from rich.console import Console

    from algid.inspection.checks import Inspection

WIDTH = 80
LINE = "{0.name:<4}{0.with_half:>19} {0.unit:<10}{1:>{2}} "
GRADE_STYLES: dict[Grade, str] = {
    "good": "bold green",
    "reservations": "bold yellow",
    "failed": "bold red",
}
MOST_SHOWN = 100
"""Entries of a log that are listed."""
MOST_FIELDS = 12
CLOCK = (
    "{rows:,} samples, {duration:.6g} s at {rate:.6g} Hz, jitter {jitter:.3g} s, gaps: {gaps}, the "
    "longest {longest_gap:.3g} s"
)
ENTRY = "{0.name} | {0.type} | {0.count} | {0.rate:.4g}"
SIGNAL = "{0} | {1.low:.4g} | {1.high:.4g} | {1.noise:.4g} | {1.step:.4g} | {1.saturated:.4g}"
DYNAMICS = (
    "excitation: condition number {condition:.4g}; as read, the equations of motion explain "
    "{explained:.1%} of the torques: k4 {weight1:.3g} N m, k2 {weight2:.3g} N m"
)
LONGEST_WORD = 24  # columns; what is longer, like a path, breaks where it must
LONGEST = 4_000  # characters of a cell: a command that names many logs is there to be copied


def _short(text: str, lines: int, less: int = 0) -> str:
    """As much of a text as fits into so many lines, `less` letters of them."""
    return textwrap.shorten(text, lines * WIDTH - less, placeholder=" …")


def verdict_lines(judged: Verdict, width: int = WIDTH, most: int | None = None) -> list[str]:
    """Grade and headline, `most` of the reasons, by default all, and the command to run first.

    The command is one line, so that it can be copied.
    """
    lines = lines_of(f"{judged.word}: {visible(judged.headline)}.", width)
    for reason in judged.reasons[:most]:
        text = reason.sentence
        if most is not None:  # in two lines, its code behind it
            # where no command applies what mends it, as in Python, it says so itself
            text = reason.text if judged.command else reason.clause
            text = _short(text, 2, 12 + len(reason.code))
        lines += lines_of(f"{visible(text, 2_000)} [{reason.code}]", width, " • ", "   ")
    left = judged.reasons[most or len(judged.reasons) :]
    if left:
        more = f"{counted(len(left), 'more reason')}, with -v: {', '.join(codes_of(left))}"
        lines.append(f" • {_short(more, 1, 3)}")
    if judged.command:
        lines.append(f"Run first: {judged.command}")
    return lines


def brief(result: Result) -> list[str]:
    """A result in few lines of 80 columns.

    Verdict, estimates, terms of the torque, prediction and the codes of notes.
    """
    judged, fit = result.verdict, result.fit
    lines = [*verdict_lines(judged, most=MOST_REASONS), ""]
    arm = {name: one for name, one in result.parameters.items() if name in ARM}
    for row in rows_of(result, arm | result.payload):
        words = row.meaning.partition(", ")[0] if row.status == Status.OK else row.status
        error = "" if row.error == ABSENT else f"{row.error} %"
        line = LINE.format(row, error, 8 if result.truth else 0)
        lines += lines_of(line + words.strip(ABSENT), WIDTH, rest=" " * len(line))
    if result.torque_model is not None:
        others = {name: one for name, one in result.parameters.items() if name not in ARM}
        numbers = ", ".join(f"{row.name} {row.with_half}" for row in rows_of(result, others))
        terms = [*result.torque_model.terms, *(name for name in DELAYS if name in others)]
        text = f"Optional torque terms: {', '.join(terms) or 'none'}"
        lines += lines_of(_short(f"{text} ({numbers})" if numbers else text, 2, 12), WIDTH)
    if fit is not None and fit.prediction is not None:
        first, second = map(share_text, fit.prediction.r2)
        lines.append(f"R² of the torque{fit.prediction.band}: joint 1 {first}, joint 2 {second}")
    if judged.notes:
        codes = ", ".join(codes_of(judged.notes))
        lines.append(_short(f"Data notes ({len(judged.notes)}): {codes}", 1))
    return lines


def print_document(document: Document, console: Console) -> None:
    """Print the verdict, what was found, and what is known against it, to `console`."""
    from rich.text import Text

    judged = document.verdict
    shown = Text(printable("\n".join(verdict_lines(judged, console.width))))
    shown.stylize(GRADE_STYLES[judged.grade], 0, len(judged.word))
    console.print(shown, soft_wrap=True)
    for table in document.tables():
        console.print()
        print_table(table, console)


def print_table(table: Table, console: Console) -> None:
    """Print one table, less the last columns where the console has no room for all.

    No digit is ever cut off.
    """
    from rich import box
    from rich.cells import cell_len
    from rich.table import Table as RichTable
    from rich.text import Text

    made = RichTable(
        title=Text(visible(table.title), "bold"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        show_edge=False,
        collapse_padding=True,
    )
    rows = [[visible(cell, LONGEST) for cell in row] for row in table.rows]
    shown, room = list[int](), console.width + 2
    for place, heading, kind in table.heads:
        cells = [heading, *(row[place] for row in rows)]
        words = cells if kind == "number" else " ".join(cells).split()
        least = max(min(cell_len(word), LONGEST_WORD) for word in words)
        room -= least + 2
        if shown and room < 0:
            break
        shown.append(place)
        side: Literal["left", "right"] = "right" if kind == "number" else "left"
        # text gives way before numbers and words do
        whole = max(map(cell_len, cells)) <= least
        style = "bold" if kind == "name" else ""
        made.add_column(Text(heading), style=style, justify=side, overflow="fold", no_wrap=whole)
    for row in rows:
        made.add_row(*(Text(row[place]) for place in shown))
    console.print(made)
    if table.note:
        console.print(Text(visible(table.note, LONGEST), "dim"))


def inspection_content(found: Inspection) -> Iterator[Table | str]:
    """Tables, and lines between them, from what the log holds to what is wrong with it."""
    synthetic = ", synthetic" if found.synthetic else ""
    yield f"{visible(found.path, 1000)}: {found.format}{synthetic}"
    shown, left = found.entries[:MOST_SHOWN], len(found.entries) - MOST_SHOWN
    if shown:
        note = f"and {left} more" if left > 0 else ""
        rows = [cells(ENTRY, one) for one in shown]
        yield Table("Channels", "Name | Type | Samples | Hz", rows, note)
    for one in shown:
        if one.joints or one.fields:
            joints = f"joints {', '.join(one.joints)}; " if one.joints else ""
            fields = joined(one.fields, MOST_FIELDS) or "without a number"
            yield visible(f"{one.name}: {joints}fields {fields}", 2000)
    if found.mapping:
        yield Table("Taken as", "algid | log", sorted(found.mapping.items()))
    if found.clock is not None:
        yield CLOCK.format(**vars(found.clock))
    if found.signals:
        figures = [cells(SIGNAL, *one) for one in found.signals.items()]
        yield Table("Signals", "Channel | Low | High | Noise | Step | Saturated share", figures)
    if found.dynamics is not None:
        yield DYNAMICS.format(**vars(found.dynamics)).replace("%", " %")
    for notice in (*found.notices, *found.findings):
        yield f"{notice.code}: {visible(notice.clause, 2000)}"
    refusing = joined(codes_of(one for one in found.findings if one.refuse))
    if refusing or found.refused:
        yield f"refused: {refusing or visible(found.refused or '', 2000)}"
