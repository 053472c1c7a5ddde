"""A verdict and a result in few lines of 80 columns: what a terminal shows unless asked for more.

Foreign text never passes as it is.
"""

from __future__ import annotations

import textwrap

from algid.arm import CONSTANT_NAMES as ARM
from algid.base.text import ABSENT, lines_of, visible
from algid.base.verdict import MOST_REASONS, Verdict
from algid.base.words import counted
from algid.model import DELAYS
from algid.notices import codes_of
from algid.results import Result, Status
from algid.results.rows import rows_of
from algid.results.verdict import share_text

WIDTH = 80
LINE = "{0.name:<4}{0.with_half:>19} {0.unit:<10}{1:>{2}} "


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
            text = _short(reason.text, 2, 12 + len(reason.code))
        lines += lines_of(f"{visible(text, 2_000)} [{reason.code}]", width, " • ", "   ")
    left = judged.reasons[most or len(judged.reasons) :]
    if left:
        more = f"{counted(len(left), 'more reason')}, with -v: {', '.join(codes_of(left))}"
        lines.append(f" • {_short(more, 1, 3)}")
    if judged.command:
        lines.append(f"Run first: {judged.command}")
    return lines


def brief(result: Result) -> list[str]:
    """The lines: verdict, estimates, terms of the torque, prediction and the codes of notes."""
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
        text = _short(f"{text} ({numbers})" if numbers else text, 2, 12)
        lines += lines_of(text, WIDTH)
    if fit is not None and fit.prediction is not None:
        first, second = map(share_text, fit.prediction.r2)
        lines.append(f"R² of the torque{fit.prediction.band}: joint 1 {first}, joint 2 {second}")
    if judged.notes:
        codes = ", ".join(codes_of(judged.notes))
        lines.append(_short(f"Data notes ({len(judged.notes)}): {codes}", 1))
    return lines
