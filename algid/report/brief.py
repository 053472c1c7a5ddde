"""A result in at most 25 lines of 80 columns: what a terminal shows unless more is asked for."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Iterable, Sequence

from algid.arm import CONSTANT_NAMES as ARM
from algid.model import DELAYS, PARAMETERS, SINES
from algid.notices import Notice
from algid.report.phasors import Moment, moments
from algid.results import Estimate, Result, Status
from algid.results.verdict import share_text
from algid.text import ABSENT, lines_of, resolved, significant, unit_text, visible
from algid.verdict import MOST_REASONS, Verdict
from algid.words import counted

WIDTH, HEIGHT = 80, 25
LEAST_ERROR = 0.01
"""Percent of the truth: a smaller error is said to be smaller."""
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
    """Constants and payload: estimate, half 95 % interval, unit, known error, and meaning."""
    errors, phasors = _errors(result), moments(result)
    constants = {name: one for name, one in result.parameters.items() if name in ARM}
    lines = []
    for name, estimate in (constants | result.payload).items():
        if name in phasors:
            lines += _moment(name, phasors[name], estimate)
            continue
        number, error, words = ABSENT, "", ""
        if estimate.estimate is not None:
            number = _with_half(estimate)
        if errors:
            error = f"{errors[name]:>8}"
        if estimate.status is not Status.OK:
            words = estimate.status.value
        elif name in PARAMETERS:
            words = PARAMETERS[name].meaning.partition(", ")[0]
        line = f"{visible(name):<4}{number:>19} {unit_text(estimate.unit):<10}{error} "
        lines += _wrapped(f"{line}{words}", rest=" " * len(line))
    return lines


def _moment(name: str, moment: Moment, estimate: Estimate) -> list[str]:
    """A moment's size with its angle in place of its meaning."""
    half = ABSENT
    if moment.std is not None:
        half = significant(moment.quantile * moment.std, 2)
    symbol, number = f"|{name.upper()}|", f"{resolved(moment.size, moment.std)} ± {half}"
    line = f"{symbol:<4}{number:>19} {unit_text(moment.unit):<10} "
    words = f"at {moment.angle_text}"
    if estimate.status is not Status.OK:
        words += f" {estimate.status.value}"
    return _wrapped(f"{line}{words}", rest=" " * len(line))


def _with_half(estimate: Estimate) -> str:
    """An estimate with half its 95 % interval."""
    low, high = estimate.ci95 or (None, None)
    half = ABSENT
    if low is not None and high is not None:
        half = significant((high - low) / 2, 2)
    return f"{resolved(estimate.estimate, estimate.std)} ± {half}"


def _errors(result: Result) -> dict[str, str]:
    """By parameter its error in percent of the truth; empty of a log that does not know it."""
    if not result.truth:
        return {}
    errors = {}
    for name, one in result.estimates.items():
        true = result.truth.get(name)
        errors[name] = ""
        if one.estimate is not None and true:
            share = 100 * (one.estimate - true) / abs(true)
            errors[name] = "<0.01 %" if abs(share) < LEAST_ERROR else f"{share:+.2g} %"
    return errors


def _terms(result: Result) -> list[str]:
    """The terms of the torque beside eq. (1), and their coefficients."""
    if result.fit is None:
        return []
    terms: list[str] = []
    if result.torque_model is not None:
        terms += result.torque_model.terms
    others = _beside_constants(result)
    if not terms and not others:
        return ["Terms kept: none"]
    terms += [name for name in DELAYS if name in others and name not in terms]
    numbers = [f"{name} {_with_half(estimate)}" for name, estimate in others.items()]
    for most in range(len(numbers), -1, -1):
        lines = _wrapped(f"Terms kept: {', '.join(terms)}{_beside(numbers, most)}")
        if len(lines) <= MOST_TERMS:
            return lines
    return _at_most(MOST_TERMS, f"Terms kept: {', '.join(terms)}")


def _beside(numbers: list[str], shown: int) -> str:
    """The first of the terms' numbers in brackets, each whole, and how many more there are."""
    if not numbers:
        return ""
    left = len(numbers) - shown
    more = f"{left} {'more' if shown else 'numbers'} with -v" if left else ""
    return f" ({', '.join([*numbers[:shown], *([more] if more else [])])})"


def _beside_constants(result: Result) -> dict[str, Estimate]:
    """The parameters of optional terms, but the sine parts that a moment's angle shows."""
    others = dict(result.parameters)
    for name in ARM:
        others.pop(name, None)
    phasors = moments(result)
    for sine, name in SINES.items():
        if name in phasors:
            others.pop(sine, None)
    return others


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
