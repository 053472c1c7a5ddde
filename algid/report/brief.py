"""A result in at most 25 lines of 80 columns: what a terminal shows unless more is asked for."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Iterable, Sequence

from algid.arm import CONSTANT_NAMES as ARM
from algid.base.text import ABSENT, lines_of, resolved, significant, visible
from algid.base.verdict import MOST_REASONS, Verdict
from algid.base.words import counted
from algid.model import DELAYS, SINES
from algid.notices import Notice
from algid.report.phasors import moments
from algid.results import Result, Status
from algid.results.rows import rows_of
from algid.results.verdict import share_text

WIDTH, HEIGHT = 80, 25
MOST_TERMS = 2
"""Lines of the terms kept."""
MOST_COMMAND = 6
"""Lines of what to run first."""


def brief(result: Result, place: str = "") -> list[str]:
    """The lines.

    Parameters
    ----------
    result : Result
    place : str
        Where its report is; nothing is said of it without one.
    """
    judged = result.verdict
    head = _wrapped(f"{judged.word}: {visible(judged.headline)}.")
    body = [""] + _estimates(result) + _terms(result) + _prediction(result)
    tail = _notes(judged.notes)
    if place:
        tail.append(f"Report: {place}")
    command = run_first(judged.command)
    if len(command) > MOST_COMMAND:
        command = _added(result)
    room = HEIGHT - len(head) - len(body) - len(tail) - len(command)
    return head + _reasons(judged, room) + command + body + tail


def _added(result: Result) -> list[str]:
    """What to add to a call that is too long to be printed again."""
    made, wanted = result.settings.get("command"), result.verdict.command or ""
    begun = f"{made} " if isinstance(made, str) else ""
    if not begun or not wanted.startswith(begun):
        return ["Run first: the command with -v, or in the report; it is long"]
    return _wrapped(f"Run first: the same command with {wanted.removeprefix(begun)}")


def run_first(command: str | None) -> list[str]:
    """The command to run first; a long one continues behind a backslash, as shells read it."""
    if not command:
        return []
    words = list(map(shlex.quote, shlex.split(command)))
    lines, line = [], "Run first:"
    for place, word in enumerate(words, start=1):
        length = len(line) + 1 + len(word)
        if place < len(words):  # a space and a backslash may follow
            length += 2
        if length > WIDTH and line.strip():
            lines.append(f"{line} \\")
            line = "   "
        line = f"{line} {word}"
    lines.append(line)
    return lines


def _wrapped(text: str, first: str = "", rest: str = "") -> list[str]:
    return lines_of(text, WIDTH, first, rest)


def _reasons(judged: Verdict, room: int) -> list[str]:
    """As many first reasons as fit, each whole, and the number of the others."""
    shown: list[str] = []
    left = list(judged.reasons)
    for reason in judged.reasons[:MOST_REASONS]:
        lines = _wrapped(f"{visible(reason.text, 1000)} [{reason.code}]", " • ", "   ")
        needed = len(shown) + len(lines)
        if len(left) > 1:  # the others are counted on a line
            needed += 1
        if needed > room:
            break
        shown += lines
        left.pop(0)
    if left:
        text = f"• {counted(len(left), 'more reason')}, with -v: {_codes(left)}"
        shown.append(f" {textwrap.shorten(text, WIDTH - 1, placeholder=' …')}")
    return shown


def _codes(notices: Iterable[Notice]) -> str:
    """Their codes, each once."""
    return ", ".join(dict.fromkeys(one.code for one in notices))


def _estimates(result: Result) -> list[str]:
    """Constants and payload: estimate, half 95 % interval, unit, known error, and meaning.

    A moment off its link's line has its size and its angle instead.
    """
    phasors = moments(result)
    constants = {name: one for name, one in result.parameters.items() if name in ARM}
    lines = []
    for row in rows_of(result, constants | result.payload):
        name, number, words, error = row.name, row.with_half, row.meaning.partition(", ")[0], ""
        if row.name in phasors:
            moment = phasors[row.name]
            name, words = f"|{name.upper()}|", f"at {moment.angle_text}"
            number = f"{resolved(moment.size, moment.std)} ± {significant(moment.half, 2)}"
            if row.status != Status.OK:
                words += f" {row.status}"
        else:
            if result.truth:
                error = f"{'' if row.error == ABSENT else row.error + ' %':>8}"
            if row.status != Status.OK:
                words = row.status
        line = f"{name:<4}{number:>19} {row.unit:<10}{error} "
        lines += _wrapped(f"{line}{words if words != ABSENT else ''}", rest=" " * len(line))
    return lines


def _terms(result: Result) -> list[str]:
    """The terms of the torque beside eq. (1), with as many coefficients as have room, each whole.

    The sine part of a moment that is shown as an angle is no coefficient of its own.
    """
    if result.torque_model is None:
        return []
    terms = result.torque_model.terms + [name for name in DELAYS if name in result.parameters]
    phasors = moments(result)
    others = {n: one for n, one in result.parameters.items() if n not in ARM}
    for sine in [sine for sine, name in SINES.items() if name in phasors]:
        others.pop(sine, None)
    numbers = [f"{row.name} {row.with_half}" for row in rows_of(result, others)]
    for most in range(len(numbers), -1, -1):
        more = [f"{len(numbers) - most} more with -v"] if most < len(numbers) else []
        beside = f" ({', '.join(numbers[:most] + more)})" if numbers else ""
        lines = _wrapped(f"Optional torque terms: {', '.join(terms) or 'none'}{beside}")
        if len(lines) <= MOST_TERMS:
            break
    return lines


def _at_most(lines: int, text: str) -> list[str]:
    """The text in so many lines; a longer one ends where a word does."""
    return _wrapped(textwrap.shorten(text, lines * WIDTH - 12, placeholder=" …"))


def _prediction(result: Result) -> list[str]:
    """How well the torque is predicted, of other logs where that was tried."""
    if result.fit is None or result.fit.prediction is None:
        return []
    prediction = result.fit.prediction
    first, second = map(share_text, prediction.r2)
    return [f"R² of the torque{prediction.band}: joint 1 {first}, joint 2 {second}"]


def _notes(notes: Sequence[Notice]) -> list[str]:
    if not notes:
        return []
    return _at_most(1, f"Data notes ({len(notes)}): {_codes(notes)}")
