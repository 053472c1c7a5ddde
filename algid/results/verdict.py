"""Whether to trust a result, by its statuses, intervals, residual and notices."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from algid.base.names import outside
from algid.base.significance import SURE
from algid.base.text import joined, significant, visible
from algid.base.verdict import Verdict, graded
from algid.base.words import counted
from algid.model import CHOICES, EVERY_TERM, K1, K2, K3, K4, K5, K6, K7
from algid.notices import Notice, Remedy, flat, has_code, notes_of, of_codes, warnings_of
from algid.options import flag

if TYPE_CHECKING:
    from algid.results.model import (
        Bound,
        Estimate,
        FitSummary,
        Result,
        Table4Row,
        TorquePrediction,
    )

CONSTANTS = (K1, K2, K3, K4, K5, K6, K7)
LEAST_R2 = 0.9  # below, a tenth of the torque's power is not the model's
WORST_R2 = 0.5  # below, most of it is not: wrong angles, signs or units, or not this arm
MOST_CLIPPED = 2.0  # percent of the samples: with more, a torque that is cut off leads the reasons
LEAST_USABLE = 0.5  # share of the parameters that must have an estimate
WIDE = 0.2  # half an interval beyond a fifth of the estimate says little more than its size

LONGEST_COMMAND = 4_000  # characters: a command is there to be copied

STATUS_WORDS = {
    "WEAK_EXCITATION": "too weakly excited",
    "SINGULAR": "singular",
    "NOT_IDENTIFIABLE": "not identifiable",
    "NOT_CONVERGED": "not converged",
    "NOT_SIGNIFICANT": "not significant",
}
CAUSES = (
    "OTHER_JOINTS",
    "LOGS_APART:exchanged",
    "WRONG_CONVENTION",
    "FLIPPED_SIGN",
    "WRONG_ZERO",
    "EXTERNAL_EFFORT",
    "GRAVITY_COMPENSATED:arm",
    "SENSOR_FAULT:angle",
    "SENSOR_FAULT:torque",
    "LOST_SAMPLES",
)
"""Notices that say why estimates would be wrong, the likeliest first: they lead the reasons."""


def judge(result: Result) -> Verdict:
    """The verdict on `result`."""
    failure = _failure(result)
    reasons = list(_reasons(result, failed=failure is not None))
    if reasons:
        headline = _identified(result)
    else:
        headline = "; ".join(_praise(result))
    return graded(
        headline,
        reasons,
        notes_of(result.notices),
        failure=failure,
        command=_command(result, reasons),
    )


def _command(result: Result, reasons: Sequence[Notice]) -> str | None:
    """The command to run first: the first cause's remedy, or `algid inspect` without a cause.

    None where neither says more than the call that was made.
    """
    causes = of_codes(reasons, *CAUSES, "UNKNOWN_CAUSE")
    if not causes:
        return None
    if causes[0].code == "UNKNOWN_CAUSE":
        words = ["algid", "inspect", result.log.path, *_of_reading(result)]
        return visible(shlex.join(words), LONGEST_COMMAND)
    remedy = causes[0].remedy
    if remedy is None or "accept" in remedy.settings:  # to accept a cause mends nothing
        return None
    said = flat(result.profile) | result.settings
    if all(said.get(name) == value for name, value in remedy.settings.items()):
        return None
    return again(result, remedy.flags)


def _of_reading(result: Result) -> list[str]:
    """The flags of the call that say how a log is read."""
    made = result.settings.get("command")
    if not isinstance(made, str):
        return list(Remedy(flat(result.profile)).flags)
    from algid.profile import KEYWORDS

    flags: list[str] = []
    words = iter(shlex.split(made))
    for word in words:
        name, equals, value = word.partition("=")
        if not name.startswith("--"):
            continue
        setting = name.removeprefix("--").replace("-", "_")
        if setting in KEYWORDS or name in (flag("profile"), flag("set")):
            both = [word] if equals else [word, next(words, "")]
            key = (value if equals else both[1]).partition("=")[0].partition(".")[0]
            if name != flag("set") or key in KEYWORDS:
                flags += both
    return flags


def again(result: Result, flags: Sequence[str]) -> str:
    """The command that identifies again with `flags`, over the result that is there."""
    made = result.settings.get("command")
    words = shlex.split(made) if isinstance(made, str) else _call(result)
    words += flags
    if flag("force") not in words:
        words.append(flag("force"))
    return visible(shlex.join(words), LONGEST_COMMAND)


def _call(result: Result) -> list[str]:
    """The command that does what Python was asked for."""
    from algid.settings import DEFAULTS, Settings

    asked = Settings.of(result.settings)
    words = ["algid", "identify"]
    loaded = []
    for log in result.logs:
        if log.role == "loaded":
            loaded += [flag("loaded"), log.path]
        else:
            words.append(log.path)
    words += loaded
    own = {
        name: value
        for name, value in asked
        if value != DEFAULTS[name] and name != "poles" and name not in result.profile
    }
    words += Remedy(own).flags
    return words + list(Remedy(flat(result.profile)).flags)


def is_implausible(result: Result) -> bool:
    """Whether physics or the torque contradict the estimates."""
    return any(one.status == "IMPLAUSIBLE" for one in result.estimates.values())


def _worst_bound(fit: FitSummary | None) -> Bound | None:
    if fit is None:
        return None
    return max(fit.broken_bounds, key=lambda bound: bound.distance_sigma or 0.0, default=None)


def _contradiction(result: Result) -> str:
    """Why the statuses are IMPLAUSIBLE."""
    fit = result.fit
    worst = _worst_bound(fit)
    poor = next(_worse_than_constant(fit), None)
    if poor is not None and (worst is None or not worst.distance_sigma):
        return poor.text
    if worst is None and has_code(result.notices, "OTHER_JOINTS"):
        return "other joints of the arm move"
    if worst is None and has_code(result.notices, "WRONG_ZERO"):
        return "gravity is turned against θ1"
    if worst is None:
        return "physics forbids these estimates"
    broken = f"the estimates break {visible(worst.bound)}"
    if worst.distance_sigma is None:
        return broken
    return f"{broken} by {_distance(worst.distance_sigma)}"


def _distance(sigmas: float) -> str:
    return f"{significant(sigmas, 2)} standard deviations"


def _failure(result: Result) -> str | None:
    if result.fit is not None and not result.fit.converged:
        return f"the estimator did not converge in {counted(result.fit.iterations, 'iteration')}"
    estimates = result.estimates.values()
    statuses = {one.status for one in estimates}
    if "NOT_CONVERGED" in statuses:
        return "the estimator did not converge"
    if "IMPLAUSIBLE" in statuses:
        return _contradiction(result)
    if has_code(result.notices, "LENGTH_CONTRADICTED"):
        return "a link length contradicts the arm's result"
    own = _asked_for(result).values()
    usable, count = sum(one.usable for one in own), len(own)
    if not usable or not any(map(_tells, estimates)):
        words = {STATUS_WORDS.get(status, "absent") for status in statuses}
        return f"no parameter could be identified ({joined(sorted(words))})"
    if usable < LEAST_USABLE * count:
        return f"only {usable} of {counted(count, 'parameter')} could be identified"
    for one in _worse_than_constant(result.fit):
        return one.text
    return None


def _tells(found: Estimate) -> bool:
    """Whether it has a number whose interval, however wide, is not merely around zero."""
    return found.estimate is not None and found.status != "NOT_SIGNIFICANT"


def _is_identified(found: Estimate) -> bool:
    return found.status == "OK" and found.estimate is not None


def _identified(result: Result) -> str:
    """How many parameters are identified, and by which estimator if it was not the requested."""
    identified = sum(map(_is_identified, result.estimates.values()))
    count = len(result.estimates)
    share = "all" if identified == count else f"{identified} of"
    have = f"{share} {counted(count, 'parameter')} are identified"
    asked = replaced_estimator(result)
    if asked is None:
        return have
    return (
        f"{have} by the {visible(result.estimator)} estimator in place of the {visible(asked)} one"
    )


def replaced_estimator(result: Result) -> str | None:
    """The estimator that was asked for, where another one's estimates stand in the result."""
    asked = result.settings.get("estimator")
    if asked is None or asked == result.estimator:
        return None
    return str(asked)


def _praise(result: Result) -> Iterator[str]:
    """What speaks for a result: certainty, explained torque, error against the truth."""
    praise = f"all {counted(len(result.estimates), 'parameter')} are identified"
    widths = {name: _share(one) for name, one in result.estimates.items() if one.half is not None}
    if widths:
        worst = max(widths, key=widths.__getitem__)
        half = significant(100 * widths[worst], 2)
        yield f"{praise}, the least certain, {visible(worst)}, to ±{half} % (95 %)"
    else:
        estimator = visible(result.estimator)
        yield f"{praise}, without error bars, which the {estimator} estimator does not give"
    prediction = _prediction(result.fit)
    if prediction is not None:
        one, two = map(share_text, prediction.r2)
        shares = f"{one} of joint 1's torque and {two} of joint 2's"
        if one == two:
            shares = f"{one} of the torque of both joints"
        yield f"the model explains {shares}{prediction.band}"
    known = [row for row in result.table4 if row.error_percent is not None]
    if known:
        worst_row = max(known, key=_error)
        yield (
            f"the largest error against the truth is {significant(_error(worst_row), 2)} % "
            f"({visible(worst_row.parameter)})"
        )


def _error(row: Table4Row) -> float:
    """Size of a row's error in percent."""
    return abs(row.error_percent or 0.0)


def share_text(share: float) -> str:
    """A share such as R² in percent, never rounded up to all."""
    if share > 0.9999:
        return "over 99.99 %"
    return f"{100 * share:.2f} %"


def _share(found: Estimate) -> float:
    """Half the 95 % interval relative to the estimate's size."""
    if found.half is None or found.estimate is None:
        return 0.0
    if found.estimate == 0:
        return math.inf
    return found.half / abs(found.estimate)


def _prediction(fit: FitSummary | None) -> TorquePrediction | None:
    if fit is None:
        return None
    return fit.prediction


def _reasons(result: Result, *, failed: bool) -> Iterator[Notice]:
    """Reasons for doubt in a result, the weightiest first.

    Causes, torques that are cut off in many samples, what changed the estimator, statuses, the fit,
    and notices: those of the fit before those of a log.
    """
    doubts = warnings_of(result.notices)
    causes = [one for cause in CAUSES for one in of_codes(doubts, cause)]
    poor = any(_worse_than_constant(result.fit))
    if failed and not causes and (is_implausible(result) or poor):
        yield Notice("UNKNOWN_CAUSE")
    yield from causes
    clipped = []
    for one in of_codes(doubts, "SATURATED_EFFORT", "CLIPPED_TORQUE"):
        if one.numbers.get("percent", 0.0) > MOST_CLIPPED:
            clipped.append(one)
    yield from clipped
    changed = of_codes(doubts, "REFUTED")  # why another estimator's numbers are reported
    yield from changed
    yield from _of_statuses(_asked_for(result), caused=bool(causes))
    if result.fit is not None:
        yield from _of_fit(result.fit, failed=failed)
    yield from _far_from_truth(result)
    yield from sorted(outside(doubts, causes + clipped + changed), key=lambda one: bool(one.logs))


def _asked_for(result: Result) -> dict[str, Estimate]:
    """The requested estimates: those without shrunk terms and terms that the logs have chosen.

    Such a term is there for the sake of the others. That its own coefficients are small beside
    their error bars is no reason to doubt those. Phases are, since they say how the arm is bent.
    """
    model = result.torque_model
    if model is None:
        return result.estimates
    own = set(model.shrunk)
    if model.chosen_by == "logs":
        for name in CHOICES:
            term = EVERY_TERM[name]
            if not term.sines:
                own |= set(term.names)
    return {name: one for name, one in result.estimates.items() if name not in own}


def _of_statuses(estimates: dict[str, Estimate], *, caused: bool) -> Iterator[Notice]:
    """What is not identified, and what to record unless a cause comes first."""
    for status in STATUS_WORDS:
        names = [visible(name) for name, one in estimates.items() if one.status == status]
        if names:
            numbers: dict[str, Any] = {"names": names}
            rigid = not set(CONSTANTS).isdisjoint(names)
            if status == "NOT_IDENTIFIABLE" and rigid and not caused:
                numbers["record"] = "record a run in which both joints move, further and faster"
            yield Notice(status, numbers=numbers)
    wide = []
    for name, one in estimates.items():
        share = _share(one)
        if one.status == "OK" and one.estimate and share > WIDE:
            wide.append(f"{visible(name)} (±{significant(100 * share, 2)} %)")
    if wide:
        yield Notice("WIDE_INTERVAL", numbers={"names": wide})


def _of_fit(fit: FitSummary, *, failed: bool) -> Iterator[Notice]:
    """What the fit holds against itself, less what is the headline of a failure."""
    headline = _worst_bound(fit) if failed else None
    for bound in fit.broken_bounds:
        if bound != headline:
            far = "an unknown distance"
            if bound.distance_sigma is not None:
                far = _distance(bound.distance_sigma)
            numbers = {"bound": visible(bound.bound), "value": bound.value, "distance": far}
            yield Notice("BROKEN_BOUND", numbers={"case": "free"} | numbers)
    coloured = [visible(name) for name, test in fit.whiteness.items() if not test.white]
    if coloured and fit.intervals == "likelihood":
        yield Notice("NOT_WHITE", numbers={"names": coloured})
    headline_joint = next(_worse_than_constant(fit), None) if failed else None
    for notice in _unexplained(fit):
        if notice != headline_joint:
            yield notice


def _worse_than_constant(fit: FitSummary | None) -> Iterator[Notice]:
    """Joints whose torque a constant predicts better, if there is something to explain."""
    prediction = _prediction(fit)
    if prediction is not None:
        for joint in prediction.unexplained(least=0.0):
            yield Notice("LITTLE_EXPLAINED", numbers={"case": "mean", "joint": joint})


def _unexplained(fit: FitSummary) -> Iterator[Notice]:
    """Joints of whose torque too little is the model's."""
    prediction = fit.prediction
    if prediction is None:
        return
    for joint, r2 in enumerate(prediction.r2, start=1):
        if r2 < 0:
            yield Notice("LITTLE_EXPLAINED", numbers={"case": "mean", "joint": joint})
        elif r2 < LEAST_R2:
            numbers = {"joint": joint, "percent": 100 * r2, "band": prediction.band}
            yield Notice("LITTLE_EXPLAINED", numbers={"case": "part"} | numbers)


def _far_from_truth(result: Result) -> Iterator[Notice]:
    """Estimates that lie further from the truth than their standard deviation allows."""
    far = []
    for row in result.table4:
        if row.truth is None or row.estimate is None or not row.std:
            continue
        distance = abs(row.estimate - row.truth) / row.std
        if distance > SURE:
            far.append(f"{visible(row.parameter)} ({significant(distance, 2)} σ)")
    if far:
        yield Notice("FAR_FROM_TRUTH", numbers={"names": far})
