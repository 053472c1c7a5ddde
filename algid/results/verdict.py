"""Whether to trust a result, by its statuses, intervals, residual and notices."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from algid.model import CHOICES, EVERY_TERM
from algid.notices import Notice, Remedy
from algid.options import flag
from algid.significance import SURE
from algid.text import joined, significant, visible
from algid.verdict import Verdict, graded
from algid.words import counted

if TYPE_CHECKING:
    from algid.results.model import Bound, Estimate, FitSummary, Result, TorquePrediction

LEAST_R2 = 0.9  # below, a tenth of the torque's power is not the model's
WORST_R2 = 0.5  # below, most of it is not: wrong angles, signs or units, or not this arm
LEAST_USABLE = 0.5  # share of the parameters that must have an estimate
LARGEST_SPREAD = (
    0.1  # a standard deviation beyond a tenth of the estimate says little more than its size
)

LONGEST_COMMAND = 4_000  # characters: a command is there to be copied

STATUS_WORDS = {
    "WEAK_EXCITATION": "too weakly excited",
    "SINGULAR": "singular",
    "NOT_IDENTIFIABLE": "not identifiable",
    "NOT_CONVERGED": "not converged",
    "NOT_SIGNIFICANT": "not significant",
}
CAUSES = (
    *(
        "EARLIER_CAUSE",
        "OTHER_JOINTS",
        "EXCHANGED_LOGS",
        "WRONG_CONVENTION",
        "FLIPPED_SIGN",
        "WRONG_ZERO",
        "EXTERNAL_EFFORT",
        "GRAVITY_COMPENSATED",
    ),
    *("STUCK_SENSOR", "DEAD_EFFORT", "LOST_SAMPLES"),
)
"""Notices that say why estimates would be wrong, the likeliest first: they lead the reasons."""


def judge(result: Result) -> Verdict:
    """The verdict on `result`."""
    failure = _failure(result)
    reasons = list(_reasons(result, failed=failure is not None))
    notes = [one for one in result.notices if one.note]
    headline = _identified(result) if reasons else "; ".join(_praise(result))
    return graded(headline, reasons, notes, failure=failure, command=_command(result, reasons))


def _command(result: Result, reasons: Sequence[Notice]) -> str | None:
    """The command to run first: the first reason's remedy, or `algid inspect` without a cause."""
    causes = [one for one in reasons if one.code in (*CAUSES, "UNKNOWN_CAUSE")]
    remedy = causes[0].remedy if causes else None
    if remedy is not None and "accept" not in remedy.settings:  # to accept a cause mends nothing
        return again(result, remedy.flags)
    if causes:
        return visible(shlex.join(["algid", "inspect", result.log.path]), LONGEST_COMMAND)
    return None


def again(result: Result, flags: Sequence[str]) -> str:
    """The command that identifies again with `flags`, over the result that is there."""
    logs = [log.path for log in result.logs if log.role == "unloaded"]
    loaded = [
        word for log in result.logs if log.role == "loaded" for word in (flag("loaded"), log.path)
    ]
    made = result.settings.get("command")
    words = shlex.split(made) if isinstance(made, str) else _call(result, [*logs, *loaded])
    force = [] if flag("force") in words else [flag("force")]
    return visible(shlex.join([*words, *flags, *force]), LONGEST_COMMAND)


def _call(result: Result, logs: Sequence[str]) -> list[str]:
    """The command that does what Python was asked for."""
    from algid.settings import Settings

    asked = Settings.of(result.settings)
    words = ["algid", "identify", *logs]
    for name, value in vars(asked).items():
        default = getattr(Settings, name)
        if name == "poles" or value == default or (name == "gravity" and name in result.profile):
            continue
        words += [flag(name)] if value is True else [flag(name), str(value)]
    return [*words, *Remedy(_flat(result.profile)).flags]


def _flat(profile: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a profile by their names with dots."""
    flat: dict[str, Any] = {}
    for name, value in profile.items():
        if value is None:
            continue
        inner = value if isinstance(value, Mapping) else None
        flat |= {name: value} if inner is None else {f"{name}.{k}": v for k, v in inner.items()}
    return flat


def is_implausible(result: Result) -> bool:
    """Whether physics or the torque contradict the estimates."""
    return any(found.status == "IMPLAUSIBLE" for found in result.estimates.values())


def _worst_bound(fit: FitSummary | None) -> Bound | None:
    bounds = [] if fit is None else fit.broken_bounds
    return max(bounds, key=lambda bound: bound.distance_sigma or 0.0, default=None)


def _contradiction(fit: FitSummary | None) -> str:
    """Why the statuses are IMPLAUSIBLE."""
    worst = _worst_bound(fit)
    poor = next(_worse_than_constant(fit), None)
    if poor is not None and (worst is None or not worst.distance_sigma):
        return poor.text
    return (
        "physics forbids these estimates"
        if worst is None
        else f"the estimates break {_beyond(worst)}"
    )


def _beyond(bound: Bound) -> str:
    far = bound.distance_sigma
    return visible(bound.bound) + ("" if far is None else f" by {_distance(far)}")


def _distance(sigmas: float) -> str:
    return f"{significant(sigmas, 2)} standard deviations"


def _failure(result: Result) -> str | None:
    if result.fit is not None and not result.fit.converged:
        return f"the estimator did not converge in {counted(result.fit.iterations, 'iteration')}"
    if any(found.status == "NOT_CONVERGED" for found in result.estimates.values()):
        return "the estimator did not converge"
    if is_implausible(result):
        return _contradiction(result.fit)
    usable, count = sum(found.usable for found in result.estimates.values()), len(result.estimates)
    if not usable or not any(map(_tells, result.estimates.values())):
        words = sorted(
            {STATUS_WORDS.get(found.status, "absent") for found in result.estimates.values()}
        )
        return f"no parameter could be identified ({joined(words)})"
    if usable < LEAST_USABLE * count:
        return f"only {usable} of {counted(count, 'parameter')} could be identified"
    return next((one.text for one in _worse_than_constant(result.fit)), None)


def _tells(found: Estimate) -> bool:
    """Whether it has a number whose interval, however wide, is not merely around zero."""
    return found.estimate is not None and found.status != "NOT_SIGNIFICANT"


def _is_identified(found: Estimate) -> bool:
    return found.status == "OK" and found.estimate is not None


def _identified(result: Result) -> str:
    """How many parameters are identified, and by which estimator if it was not the requested."""
    identified = sum(map(_is_identified, result.estimates.values()))
    count = len(result.estimates)
    have = (
        f"{'all' if identified == count else f'{identified} of'} {counted(count, 'parameter')} "
        "are identified"
    )
    asked = replaced_estimator(result)
    if asked is None:
        return have
    return (
        f"{have} by the {visible(result.estimator)} estimator in place of the {visible(asked)} one"
    )


def replaced_estimator(result: Result) -> str | None:
    """The estimator that was asked for, where another one's estimates stand in the result."""
    asked = result.settings.get("estimator")
    return str(asked) if asked is not None and asked != result.estimator else None


def _praise(result: Result) -> list[str]:
    count = len(result.estimates)
    praise = [f"all {counted(count, 'parameter')} are identified"]
    spreads = {
        name: _spread(found) for name, found in result.estimates.items() if found.std is not None
    }
    if spreads:
        worst = max(spreads, key=lambda name: spreads[name])
        praise[0] += (
            f", the least certain, {visible(worst)}, to ±{significant(196 * spreads[worst], 2)} % "
            "(95 %)"
        )
    else:
        praise[0] += (
            f", without error bars, which the {visible(result.estimator)} estimator does not give"
        )
    prediction = _prediction(result.fit)
    if prediction is not None:
        one, two = map(share_text, prediction.r2)
        where = (
            "of the torque of both joints"
            if one == two
            else f"of joint 1's torque and {two} of joint 2's"
        )
        praise.append(f"the model explains {one} {where}{band_text(prediction)}")
    errors = {
        row.parameter: abs(row.error_percent)
        for row in result.table4
        if row.error_percent is not None
    }
    if errors:
        worst = max(errors, key=lambda name: errors[name])
        praise.append(
            f"the largest error against the truth is {significant(errors[worst], 2)} % "
            f"({visible(worst)})"
        )
    return praise


def share_text(share: float) -> str:
    """A share such as R² in percent, never rounded up to all."""
    return f"{100 * share:.2f} %" if share <= 0.9999 else "over 99.99 %"


def band_text(prediction: TorquePrediction) -> str:
    """The bandwidth in which a prediction is scored, behind a noun.

    Empty where an old result does not say it.
    """
    return "" if prediction.bandwidth is None else f" below {prediction.bandwidth:g} Hz"


def _spread(found: Estimate) -> float:
    """Standard deviation relative to the estimate's size."""
    if found.std is None or found.estimate is None:
        return 0.0
    return found.std / abs(found.estimate) if found.estimate else math.inf


def _prediction(fit: FitSummary | None) -> TorquePrediction | None:
    return None if fit is None else fit.cross_validation or fit.residual


def _reasons(result: Result, *, failed: bool) -> Iterator[Notice]:
    """Reasons for doubt in a result, the weightiest first: causes, statuses, fit, notices."""
    warnings = [one for one in result.notices if not one.note]
    causes = sorted(
        (one for one in warnings if one.code in CAUSES), key=lambda one: CAUSES.index(one.code)
    )
    poor = any(_worse_than_constant(result.fit))
    if failed and not causes and (is_implausible(result) or poor):
        yield Notice("UNKNOWN_CAUSE")
    yield from causes
    yield from _of_statuses(_asked_for(result))
    if result.fit is not None:
        yield from _of_fit(result.fit, failed=failed)
    yield from _far_from_truth(result)
    yield from (one for one in warnings if one.code not in CAUSES)


def _asked_for(result: Result) -> dict[str, Estimate]:
    """The requested estimates: those without shrunk terms and terms that the logs have chosen.

    Such a term is there for the sake of the others. That its own coefficients are small beside
    their error bars is no reason to doubt those. Phases are, since they say how the arm is bent.
    """
    model = None if result.fit is None else result.fit.model
    if model is None:
        return result.estimates
    own = set(model.shrunk)
    if model.chosen_by == "logs":
        own |= {
            name
            for term in CHOICES
            for name in EVERY_TERM[term].names
            if not EVERY_TERM[term].sines
        }
    return {name: found for name, found in result.estimates.items() if name not in own}


def _of_statuses(estimates: dict[str, Estimate]) -> Iterator[Notice]:
    for status in STATUS_WORDS:
        names = [visible(name) for name, found in estimates.items() if found.status == status]
        if names:
            yield Notice(status, numbers={"names": names})
    wide = {
        name: _spread(found)
        for name, found in estimates.items()
        if found.status == "OK" and found.estimate
    }
    shown = [
        f"{visible(n)} (±{significant(196 * s, 2)} %)"
        for n, s in wide.items()
        if s > LARGEST_SPREAD
    ]
    if shown:
        yield Notice("WIDE_INTERVAL", numbers={"names": shown})


def _of_fit(fit: FitSummary, *, failed: bool) -> Iterator[Notice]:
    """What the fit holds against itself, less what is the headline of a failure."""
    headline = _worst_bound(fit) if failed else None
    for bound in fit.broken_bounds:
        if bound != headline:
            far = (
                "an unknown distance"
                if bound.distance_sigma is None
                else _distance(bound.distance_sigma)
            )
            numbers = {"bound": visible(bound.bound), "value": bound.value, "distance": far}
            yield Notice("BROKEN_BOUND", numbers=numbers)
    coloured = [visible(name) for name, test in fit.whiteness.items() if not test.white]
    if coloured and fit.intervals == "likelihood":
        yield Notice("NOT_WHITE", numbers={"names": coloured})
    shown = list(_worse_than_constant(fit))[:1] if failed else []
    yield from (one for one in _unexplained(fit, LEAST_R2) if one not in shown)


def _worse_than_constant(fit: FitSummary | None) -> Iterator[Notice]:
    """Joints whose torque a constant predicts better, if there is something to explain."""
    prediction = _prediction(fit)
    for joint in () if prediction is None else prediction.unexplained(least=0.0):
        yield Notice("WORSE_THAN_MEAN", numbers={"joint": joint})


def _unexplained(fit: FitSummary | None, least: float) -> Iterator[Notice]:
    prediction = _prediction(fit)
    for joint, r2 in enumerate(prediction.r2 if prediction else (), start=1):
        if r2 < 0:
            yield Notice("WORSE_THAN_MEAN", numbers={"joint": joint})
        elif r2 < least and prediction is not None:
            numbers = {"joint": joint, "percent": max(100 * r2, 0.0), "band": band_text(prediction)}
            yield Notice("LITTLE_EXPLAINED", numbers=numbers)


def _far_from_truth(result: Result) -> Iterator[Notice]:
    distances = {
        visible(row.parameter): abs(row.estimate - row.truth) / row.std
        for row in result.table4
        if row.truth is not None and row.estimate is not None and row.std
    }
    far = [f"{name} ({significant(d, 2)} σ)" for name, d in distances.items() if d > SURE]
    if far:
        yield Notice("FAR_FROM_TRUTH", numbers={"names": far})
