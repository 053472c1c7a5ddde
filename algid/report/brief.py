"""A verdict and a result in few lines of 80 columns: what a terminal shows unless asked for more.

Foreign text never passes as it is.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from algid.arm import CONSTANT_NAMES as ARM
from algid.base.text import ABSENT, lines_of, visible
from algid.base.verdict import MOST_REASONS, Verdict
from algid.base.words import counted
from algid.model import DELAYS
from algid.notices import Notice
from algid.results import Result, Status
from algid.results.rows import rows_of
from algid.results.verdict import share_text

WIDTH = 80
MOST_LINES = 2
"""Of a reason, and of the terms of the torque."""


def verdict_lines(judged: Verdict, width: int = WIDTH, most: int | None = None) -> list[str]:
    """Grade and headline, `most` of the reasons, by default all, and the command to run first.

    The command is one line, so that it can be copied.
    """
    lines = lines_of(f"{judged.word}: {visible(judged.headline)}.", width)
    for reason in judged.reasons[:most]:
        text = reason.sentence
        if most is not None:  # in two lines, its code behind it
            room = MOST_LINES * (WIDTH - 6) - len(reason.code)
            text = textwrap.shorten(reason.text, room, placeholder=" …")
        lines += lines_of(f"{visible(text, 2_000)} [{reason.code}]", width, " • ", "   ")
    left = judged.reasons[most:] if most is not None else ()
    if left:
        more = f"{counted(len(left), 'more reason')}, with -v: {_codes(left)}"
        lines.append(f" • {textwrap.shorten(more, width - 3, placeholder=' …')}")
    if judged.command:
        lines.append(f"Run first: {judged.command}")
    return lines


def _codes(notices: Iterable[Notice]) -> str:
    """Their codes, each once."""
    return ", ".join(dict.fromkeys(one.code for one in notices))


def brief(result: Result) -> list[str]:
    """The lines: verdict, estimates, terms of the torque, prediction and the codes of notes."""
    judged = result.verdict
    lines = [*verdict_lines(judged, most=MOST_REASONS), "", *_estimates(result)]
    if result.torque_model is not None:
        lines += _terms(result, result.torque_model.terms)
    if result.fit is not None and result.fit.prediction is not None:
        first, second = map(share_text, result.fit.prediction.r2)
        band = result.fit.prediction.band
        lines.append(f"R² of the torque{band}: joint 1 {first}, joint 2 {second}")
    if judged.notes:
        notes = f"Data notes ({len(judged.notes)}): {_codes(judged.notes)}"
        lines.append(textwrap.shorten(notes, WIDTH, placeholder=" …"))
    return lines


def _estimates(result: Result) -> list[str]:
    """Constants and payload: estimate, half 95 % interval, unit, known error, and meaning."""
    lines = list[str]()
    constants = {name: one for name, one in result.parameters.items() if name in ARM}
    for row in rows_of(result, constants | result.payload):
        words = row.meaning.partition(", ")[0] if row.status == Status.OK else row.status
        error = f"{row.error} %" if result.truth and row.error != ABSENT else ""
        line = (
            f"{row.name:<4}{row.with_half:>19} {row.unit:<10}{error:>{8 if result.truth else 0}} "
        )
        lines += lines_of(f"{line}{words if words != ABSENT else ''}", WIDTH, rest=" " * len(line))
    return lines


def _terms(result: Result, terms: list[str]) -> list[str]:
    """The terms of the torque beside eq. (1) with their coefficients, as far as two lines hold."""
    others = {name: one for name, one in result.parameters.items() if name not in ARM}
    numbers = ", ".join(f"{row.name} {row.with_half}" for row in rows_of(result, others))
    delays = [name for name in DELAYS if name in result.parameters]
    text = f"Optional torque terms: {', '.join(terms + delays) or 'none'}"
    text += f" ({numbers})" if numbers else ""
    lines = lines_of(text, WIDTH)
    return lines if len(lines) <= MOST_LINES else [lines[0], f"{lines[1]:.68} … with -v"]
