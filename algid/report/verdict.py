"""Whether to trust a result: a headline, the likely cause with the command to run first, then the reasons."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from algid.report.text import LONGEST, joined, significant, visible
from algid.results import Bound, Estimate, FitSummary, Result, Status, TorquePrediction
from algid.words import counted

Level = Literal["good", "reservations", "failed"]

LEAST_R2 = 0.9  # below, a tenth of the torque's power is not the model's
WORST_R2 = 0.5  # below, most of it is not: wrong angles, signs or units, or not this arm
LEAST_USABLE = 0.5  # share of the parameters that must have an estimate
LARGEST_SPREAD = 0.1  # a standard deviation beyond a tenth of the estimate says little more than its size
FAR_FROM_TRUTH = 4.0  # σ; by chance one estimate in 16,000

LONGEST_COMMAND = 4_000  # characters: a command is there to be copied

LEVEL_WORDS: dict[Level, str] = {"good": "Good", "reservations": "With reservations", "failed": "Failed"}
STATUS_WORDS = {
    Status.WEAK_EXCITATION: "too weakly excited",
    Status.SINGULAR: "singular",
    Status.NOT_IDENTIFIABLE: "not identifiable",
    Status.NOT_CONVERGED: "not converged",
    Status.IMPLAUSIBLE: "implausible",
}
BREAKS = "the estimates break"
UNKNOWN_CAUSE = (
    "angles, signs, units or the order of the joints are not what algid took them for, or the logs are of another arm"
)


@dataclass(frozen=True)
class Verdict:
    """How far to trust what a report is about, in one sentence: the word of its level, then the `statement`.

    `cause` is a clause that says what probably lies behind a poor result, `command` what to run first to find out
    or to mend it; `reasons` are the reservations, each a clause.
    """

    level: Level
    statement: str
    reasons: tuple[str, ...] = ()
    cause: str | None = None
    command: str | None = None

    @property
    def word(self) -> str:
        """The word of its level."""
        return LEVEL_WORDS[self.level]

    @property
    def rest(self) -> str:
        """The sentence after the word of its level."""
        return f": {self.statement}."

    @property
    def sentence(self) -> str:
        """The whole sentence."""
        return self.word + self.rest

    @property
    def further_reasons(self) -> tuple[str, ...]:
        """The reasons that neither the sentence holds word by word, nor the cause."""
        cause = self.cause or self.sentence
        return tuple(reason for reason in self.reasons if reason not in self.sentence and cause not in reason)


def judged(
    statement: str,
    reasons: tuple[str, ...],
    failure: str | None,
    *,
    things: str = "numbers",
    first: str = "",
    cause: str | None = None,
    command: str | None = None,
) -> Verdict:
    """The verdict on `statement`: failed where there is a `failure`, with reservations where there are `reasons`.

    `things` must not be used after a failure; `first` stands in the sentence in place of the first reason.
    """
    if failure is not None:
        return Verdict("failed", f"{failure}; do not use these {things}", reasons, cause, command)
    if not reasons:
        return Verdict("good", statement)
    more = len(reasons) - 1
    rest = {0: "", 1: ", and there is one more reason below"}.get(more, f", and {counted(more, 'more reason')} below")
    return Verdict("reservations", f"{statement}, but {first or reasons[0]}{rest}", reasons, cause, command)


def verdict(result: Result) -> Verdict:
    """Judge `result` by its statuses, its intervals, its residual and its warnings."""
    failure = _failure(result)
    reasons = tuple(reason for reason in _reasons(result) if reason != failure)
    cause, command = _cause(result, failed=failure is not None)
    statement = _identified(result) if reasons else "; ".join(_praise(result))
    return judged(statement, reasons, failure, cause=cause, command=command)


def _cause(result: Result, *, failed: bool) -> tuple[str | None, str | None]:
    """What probably lies behind a poor result, and the command to run first."""
    inspect = visible(shlex.join(["algid", "inspect", result.log.path]), LONGEST_COMMAND)
    if result.causes:
        first = result.causes[0]
        return visible(first.cause), again(result, first.flags) if first.flags else inspect
    if failed and (_is_implausible(result) or next(_unexplained(result.fit, WORST_R2), None)):
        return UNKNOWN_CAUSE, inspect
    return None, None


def again(result: Result, flags: Sequence[str]) -> str:
    """The command that identifies again with `flags`, over the result that is there."""
    logs = [log.path for log in result.logs if log.role == "unloaded"]
    loaded = [word for log in result.logs if log.role == "loaded" for word in ("--loaded", log.path)]
    made = result.settings.get("command")
    words = shlex.split(made) if isinstance(made, str) else ["algid", "identify", *logs, *loaded]
    force = [] if "--force" in words else ["--force"]
    return visible(shlex.join([*words, *flags, *force]), LONGEST_COMMAND)


def _is_implausible(result: Result) -> bool:
    return any(found.status is Status.IMPLAUSIBLE for found in result.estimates.values())


def _contradiction(fit: FitSummary | None) -> str:
    """Why the statuses are IMPLAUSIBLE."""
    bounds = [] if fit is None else fit.broken_bounds
    worst = max(bounds, key=lambda bound: bound.distance_sigma or 0.0, default=None)
    poor = next(_unexplained(fit, 0.0), None)
    if poor is not None and (worst is None or not worst.distance_sigma):
        return poor
    return "physics forbids these estimates" if worst is None else f"{BREAKS} {_beyond(worst)}"


def _beyond(bound: Bound) -> str:
    far = bound.distance_sigma
    return visible(bound.bound) + ("" if far is None else f" by {significant(far, 2)} standard deviations")


def _failure(result: Result) -> str | None:
    if result.fit is not None and not result.fit.converged:
        return f"the estimator did not converge in {counted(result.fit.iterations, 'iteration')}"
    if any(found.status is Status.NOT_CONVERGED for found in result.estimates.values()):
        return "the estimator did not converge"
    if _is_implausible(result):
        return _contradiction(result.fit)
    usable, count = sum(map(_usable, result.estimates.values())), len(result.estimates)
    if not usable:
        words = sorted({STATUS_WORDS.get(found.status, "absent") for found in result.estimates.values()})
        return f"no parameter could be identified ({joined(words)})"
    if usable < LEAST_USABLE * count:
        return f"only {usable} of {counted(count, 'parameter')} could be identified"
    return next(_unexplained(result.fit, WORST_R2), None)


def _usable(found: Estimate) -> bool:
    return found.status is Status.OK and found.estimate is not None


def _identified(result: Result) -> str:
    """How many parameters are identified, and by which estimator where it is not the one that was asked for."""
    usable, count = sum(map(_usable, result.estimates.values())), len(result.estimates)
    have = f"{'all' if usable == count else f'{usable} of'} {counted(count, 'parameter')} are identified"
    asked = replaced_estimator(result)
    if asked is None:
        return have
    return f"{have} by the {visible(result.estimator)} estimator in place of the {visible(asked)} one"


def replaced_estimator(result: Result) -> str | None:
    """The estimator that was asked for, where another one's estimates stand in the result."""
    asked = result.settings.get("estimator")
    return str(asked) if asked is not None and asked != result.estimator else None


def _praise(result: Result) -> list[str]:
    count = len(result.estimates)
    praise = [f"all {counted(count, 'parameter')} are identified"]
    spreads = {name: _spread(found) for name, found in result.estimates.items() if found.std is not None}
    if spreads:
        worst = max(spreads, key=lambda name: spreads[name])
        praise[0] += f", the least certain, {visible(worst)}, to ±{significant(196 * spreads[worst], 2)} % (95 %)"
    else:
        praise[0] += f", without error bars, which the {visible(result.estimator)} estimator does not give"
    prediction = _prediction(result.fit)
    if prediction is not None:
        one, two = map(share_text, prediction.r2)
        where = "of the torque of both joints" if one == two else f"of joint 1's torque and {two} of joint 2's"
        praise.append(f"the model explains {one} {where}")
    errors = {row.parameter: abs(row.error_percent) for row in result.table4 if row.error_percent is not None}
    if errors:
        worst = max(errors, key=lambda name: errors[name])
        praise.append(f"the largest error against the truth is {significant(errors[worst], 2)} % ({visible(worst)})")
    return praise


def share_text(share: float) -> str:
    """A share such as R² in percent, never rounded up to all."""
    return f"{100 * share:.2f} %" if share <= 0.9999 else "over 99.99 %"


def _spread(found: Estimate) -> float:
    """Standard deviation relative to the estimate's size."""
    if found.std is None or found.estimate is None:
        return 0.0
    return found.std / abs(found.estimate) if found.estimate else math.inf


def _prediction(fit: FitSummary | None) -> TorquePrediction | None:
    return None if fit is None else fit.cross_validation or fit.residual


def _reasons(result: Result) -> Iterator[str]:
    estimates = result.estimates
    for status, words in STATUS_WORDS.items():
        names = [visible(name) for name, found in estimates.items() if found.status is status]
        if names and status is not Status.IMPLAUSIBLE:  # which is the headline's
            yield f"{joined(names)} {'is' if len(names) == 1 else 'are'} {words}"
    wide = {name: _spread(found) for name, found in estimates.items() if _usable(found)}
    shown = [f"{visible(n)} (±{significant(100 * s, 2)} %)" for n, s in wide.items() if s > LARGEST_SPREAD]
    if shown:
        yield f"the standard deviation of {joined(shown)} is large"
    if result.fit is not None:
        yield from _fit_reasons(result.fit, " ".join(result.warnings))
    yield from _far_from_truth(result)
    said = {f"{name} is not determined" for name, found in estimates.items() if found.estimate is None}
    said |= {warning for warning in result.warnings if _is_implausible(result) and warning.startswith(BREAKS)}
    yield from (f"algid warns: {visible(warning, 2 * LONGEST)}" for warning in result.warnings if warning not in said)


def _fit_reasons(fit: FitSummary, said: str) -> Iterator[str]:
    """What the fit holds against itself, less what the warnings have said."""
    yield from (visible(direction) for direction in fit.unidentifiable if direction not in said)
    yield from (f"{BREAKS} {_beyond(bound)}" for bound in fit.broken_bounds if bound.bound not in said)
    coloured = [visible(name) for name, test in fit.whiteness.items() if not test.white]
    if coloured and fit.intervals == "likelihood":
        yield f"the residual of {joined(coloured)} is not white, though the intervals take it to be"
    yield from _unexplained(fit, LEAST_R2)


def _unexplained(fit: FitSummary | None, least: float) -> Iterator[str]:
    prediction = _prediction(fit)
    for joint, r2 in enumerate(prediction.r2 if prediction else (), start=1):
        if r2 < 0:
            yield f"the model predicts the torque of joint {joint} worse than its mean does"
        elif r2 < least:
            yield f"the model explains only {max(100 * r2, 0):.0f} % of the torque of joint {joint}"


def _far_from_truth(result: Result) -> Iterator[str]:
    distances = {
        visible(row.parameter): abs(row.estimate - row.truth) / row.std
        for row in result.table4
        if row.truth is not None and row.estimate is not None and row.std
    }
    far = {name: significant(distance, 2) for name, distance in distances.items() if distance > FAR_FROM_TRUTH}
    if len(far) == 1:
        yield from (f"{name} lies {distance} σ from the truth" for name, distance in far.items())
    elif far:
        yield f"{joined([f'{name} ({distance} σ)' for name, distance in far.items()])} lie far from the truth"
