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
from algid.text import ABSENT, resolved, significant, unit_text, visible
from algid.verdict import MOST_REASONS, Verdict
from algid.words import counted

WIDTH, HEIGHT = 80, 25
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
        command = ["Run first: the command with -v, or in the report; it is long"]
    room = HEIGHT - len(head) - len(body) - len(tail) - len(command)
    return [*head, *_reasons(judged, room), *command, *body, *tail]


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
    return textwrap.wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False
    )


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
    for name, found in {
        **{k: v for k, v in result.parameters.items() if k in ARM},
        **result.payload,
    }.items():
        if name in phasors:
            yield from _moment(name, phasors[name], found)
            continue
        number = (
            f"{resolved(found.estimate, found.std)} ± {_half(found)}"
            if found.estimate is not None
            else ABSENT
        )
        error = f"{errors[name]:>8}" if errors else ""
        words = PARAMETERS[name].meaning.partition(", ")[0] if name in PARAMETERS else ""
        status = "" if found.status is Status.OK else found.status.value
        line = f"{visible(name):<4}{number:>19} {unit_text(found.unit):<10}{error} "
        fits = (
            len(line) + len(words) <= WIDTH or not errors
        )  # beside errors there is no room for a second line
        yield from _wrapped(f"{line}{status or (words if fits else '')}", rest=" " * len(line))


def _moment(name: str, one: Moment, found: Estimate) -> list[str]:
    """A moment's size with its angle in place of its meaning."""
    half = ABSENT if one.std is None else significant(one.quantile * one.std, 2)
    number = f"{resolved(one.size, one.std)} ± {half}"
    status = "" if found.status is Status.OK else f" {found.status.value}"
    line = f"{f'|{name.upper()}|':<4}{number:>19} {unit_text(one.unit):<10} "
    return _wrapped(f"{line}at {one.angle_text}{status}", rest=" " * len(line))


def _half(found: Estimate) -> str:
    low, high = found.ci95 or (None, None)
    return ABSENT if low is None or high is None else significant((high - low) / 2, 2)


def _errors(result: Result) -> dict[str, str]:
    """By parameter its error in percent of the truth; empty of a log that does not know it."""
    if not result.truth:
        return {}
    errors = dict.fromkeys(result.estimates, "")
    for name, true in result.truth.items():
        estimate = result.estimates[name].estimate if name in errors else None
        if estimate is not None and true:
            errors[name] = f"{100 * (estimate - true) / abs(true):+.2g} %"
    return errors


def _terms(result: Result) -> list[str]:
    """The terms of the torque beside eq. (1), and their coefficients."""
    terms = [] if result.fit is None or result.fit.model is None else result.fit.model.terms
    told = {sine for sine, name in SINES.items() if name in moments(result)}  # beside k1, k2, k4
    others = {name: found for name, found in result.parameters.items() if name not in {*ARM, *told}}
    if not terms and not others:
        return ["Terms kept: none"] if result.fit is not None else []
    numbers = [
        f"{name} {resolved(found.estimate, found.std)} ± {_half(found)}"
        for name, found in others.items()
    ]
    kept = [*terms, *(name for name in DELAYS if name in others and name not in terms)]
    beside = f" ({', '.join(numbers)})" if numbers else ""
    return _at_most(2, f"Terms kept: {', '.join(kept)}{beside}")


def _at_most(lines: int, text: str) -> list[str]:
    """The text in so many lines; a longer one ends where a word does."""
    return _wrapped(textwrap.shorten(text, lines * WIDTH - 12, placeholder=" …"))


def _prediction(result: Result) -> list[str]:
    fit = result.fit
    found = None if fit is None else fit.cross_validation or fit.residual
    if found is None:
        return []
    band = "" if found.bandwidth is None else f" below {found.bandwidth:g} Hz"
    return [
        (
            f"R² of the torque{band}: joint 1 {share_text(found.r2[0])}, joint 2 "
            f"{share_text(found.r2[1])}"
        )
    ]


def _notes(notes: Iterable[Notice]) -> list[str]:
    codes = [one.code for one in notes]
    return (
        _at_most(1, f"Data notes ({len(codes)}): {', '.join(dict.fromkeys(codes))}")
        if codes
        else []
    )
