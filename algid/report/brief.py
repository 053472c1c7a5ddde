"""A result in at most 25 lines of 80 columns: what a terminal shows unless more is asked for."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Iterable, Iterator

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
    body = ["", *_estimates(result), *_terms(result), *_prediction(result)]
    tail = [*_notes(judged.notes), *([f"Report: {place}"] if place else [])]
    command = run_first(judged.command)
    if len(command) > MOST_COMMAND:
        command = _added(result)
    room = HEIGHT - len(head) - len(body) - len(tail) - len(command)
    return [*head, *_reasons(judged, room), *command, *body, *tail]


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
    words = [shlex.quote(word) for word in shlex.split(command)]
    lines, line = [], "Run first:"
    for place, word in enumerate(words):
        last = place == len(words) - 1
        if len(line) + 1 + len(word) + (0 if last else 2) > WIDTH and line.strip():
            lines.append(f"{line} \\")
            line = "   "
        line = f"{line} {word}"
    lines.append(line)
    return lines


def _wrapped(text: str, first: str = "", rest: str = "") -> list[str]:
    return lines_of(text, WIDTH, first, rest)


def _reasons(judged: Verdict, room: int) -> Iterator[str]:
    """As many first reasons as fit, each whole, and the number of the others."""
    shown = 0
    for reason in judged.reasons[:MOST_REASONS]:
        lines = _wrapped(f"{visible(reason.text, 1000)} [{reason.code}]", " • ", "   ")
        last = shown + 1 == len(judged.reasons)
        if len(lines) > room - (0 if last else 1):
            break
        yield from lines
        room -= len(lines)
        shown += 1
    left = judged.reasons[shown:]
    if left:
        codes = ", ".join(dict.fromkeys(one.code for one in left))
        text = f"• {counted(len(left), 'more reason')}, with -v: {codes}"
        yield f" {textwrap.shorten(text, WIDTH - 1, placeholder=' …')}"


def _estimates(result: Result) -> Iterator[str]:
    """Constants and payload: estimate, half 95 % interval, unit, known error, and meaning."""
    errors, phasors = _errors(result), moments(result)
    constants = {name: one for name, one in result.parameters.items() if name in ARM}
    for name, estimate in (constants | result.payload).items():
        if name in phasors:
            yield from _moment(name, phasors[name], estimate)
            continue
        number = ABSENT if estimate.estimate is None else _with_half(estimate)
        error = f"{errors[name]:>8}" if errors else ""
        line = f"{visible(name):<4}{number:>19} {unit_text(estimate.unit):<10}{error} "
        words = PARAMETERS[name].meaning.partition(", ")[0] if name in PARAMETERS else ""
        if estimate.status is not Status.OK:
            words = estimate.status.value
        yield from _wrapped(f"{line}{words}", rest=" " * len(line))


def _moment(name: str, moment: Moment, estimate: Estimate) -> list[str]:
    """A moment's size with its angle in place of its meaning."""
    half = ABSENT
    if moment.std is not None:
        half = significant(moment.quantile * moment.std, 2)
    symbol, number = f"|{name.upper()}|", f"{resolved(moment.size, moment.std)} ± {half}"
    line = f"{symbol:<4}{number:>19} {unit_text(moment.unit):<10} "
    status = "" if estimate.status is Status.OK else f" {estimate.status.value}"
    return _wrapped(f"{line}at {moment.angle_text}{status}", rest=" " * len(line))


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
    errors = dict.fromkeys(result.estimates, "")
    for name, true in result.truth.items():
        estimate = result.estimates[name].estimate if name in errors else None
        if estimate is not None and true:
            share = 100 * (estimate - true) / abs(true)
            errors[name] = f"{share:+.2g} %" if abs(share) >= LEAST_ERROR else "<0.01 %"
    return errors


def _terms(result: Result) -> list[str]:
    """The terms of the torque beside eq. (1), and their coefficients."""
    model = None if result.fit is None else result.fit.model
    terms = [] if model is None else list(model.terms)
    phasors = moments(result)
    shown = {*ARM, *(sine for sine, name in SINES.items() if name in phasors)}
    others = {name: one for name, one in result.parameters.items() if name not in shown}
    if not terms and not others:
        return [] if result.fit is None else ["Terms kept: none"]
    terms += [name for name in DELAYS if name in others and name not in terms]
    numbers = [f"{name} {_with_half(estimate)}" for name, estimate in others.items()]
    beside = f" ({', '.join(numbers)})" if numbers else ""
    return _at_most(2, f"Terms kept: {', '.join(terms)}{beside}")


def _at_most(lines: int, text: str) -> list[str]:
    """The text in so many lines; a longer one ends where a word does."""
    return _wrapped(textwrap.shorten(text, lines * WIDTH - 12, placeholder=" …"))


def _prediction(result: Result) -> list[str]:
    """How well the torque is predicted, of other logs where that was tried."""
    fit = result.fit
    prediction = None if fit is None else fit.cross_validation or fit.residual
    if prediction is None:
        return []
    band = "" if prediction.bandwidth is None else f" below {prediction.bandwidth:g} Hz"
    first, second = (share_text(r2) for r2 in prediction.r2)
    return [f"R² of the torque{band}: joint 1 {first}, joint 2 {second}"]


def _notes(notes: Iterable[Notice]) -> list[str]:
    codes = [one.code for one in notes]
    if not codes:
        return []
    return _at_most(1, f"Data notes ({len(codes)}): {', '.join(dict.fromkeys(codes))}")
