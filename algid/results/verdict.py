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
    from algid.results.model import Estimate, FitSummary, Result

CONSTANTS = (K1, K2, K3, K4, K5, K6, K7)
LEAST_R2 = 0.9  # below, a tenth of the torque's power is not the model's
WORST_R2 = 0.5  # below, most of it is not: wrong angles, signs or units, or not this arm
MOST_CLIPPED = 2.0  # percent of the samples: with more, a torque that is cut off leads the reasons
LEAST_USABLE = 0.5  # share of the parameters that must have an estimate
WIDE = 0.2  # half an interval beyond a fifth of the estimate says little more than its size
LONGEST_COMMAND = 4_000  # characters: a command is there to be copied

STATUS_WORDS = {
    "FROM_PRIOR": "from the prior",
    "WEAK_EXCITATION": "too weakly excited",
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
    failure, reasons = _failure(result), list[Notice]()
    for one in _reasons(result, failure):
        if one not in reasons and one.text != failure:
            reasons.append(one)
    headline = _identified(result) if reasons else _praise(result)
    notes, command = notes_of(result.notices), _command(result, reasons)
    return graded(headline, reasons, notes, failure=failure, command=command)


def _failure(result: Result) -> str | None:
    """Why the numbers must not be used, the first of the reasons for it; None without one."""
    fit, asked = result.fit, requested(result).values()
    if fit is not None and not fit.converged:
        return f"the estimator did not converge in {counted(fit.iterations, 'iteration')}"
    statuses = {one.status for one in result.estimates.values()}
    if "NOT_CONVERGED" in statuses:
        return "the estimator did not converge"
    bounds = [
        one for one in _broken_bounds(fit) if one.numbers["distance"] or not _worse_than_mean(fit)
    ]
    if "IMPLAUSIBLE" in statuses:
        for one in (*bounds[:1], *_worse_than_mean(fit)):
            return one.text
        for code, words in (
            ("OTHER_JOINTS", "other joints of the arm move"),
            ("WRONG_ZERO", "gravity is turned against θ1"),
        ):
            if has_code(result.notices, code):
                return words
        return "physics forbids these estimates"
    if has_code(result.notices, "LENGTH_CONTRADICTED"):
        return "a link length contradicts the arm's result"
    usable = sum(one.usable for one in asked)
    # a number whose interval is merely around zero is none to use, nor has a prior measured one
    vague = ("NOT_SIGNIFICANT", "FROM_PRIOR")
    numbers = [one for one in result.estimates.values() if one.status not in vague]
    if not usable or all(one.estimate is None for one in numbers):
        why = {STATUS_WORDS.get(status, "absent") for status in statuses}
        return f"no parameter could be identified ({joined(sorted(why))})"
    if usable < LEAST_USABLE * len(asked):
        return f"only {usable} of {counted(len(asked), 'parameter')} could be identified"
    return next((one.text for one in _worse_than_mean(fit)), None)


def _broken_bounds(fit: FitSummary | None) -> list[Notice]:
    """The bounds of physics that the estimates break, the worst first."""
    broken = [] if fit is None else fit.broken_bounds
    notices = []
    for one in sorted(broken, key=lambda one: -(one.distance_sigma or 0.0)):
        distance = significant(one.distance_sigma, 2) if one.distance_sigma else ""
        numbers = {"bound": visible(one.bound), "value": one.value, "distance": distance}
        notices.append(Notice("BROKEN_BOUND", numbers={"case": "free"} | numbers))
    return notices


def _worse_than_mean(fit: FitSummary | None) -> list[Notice]:
    """Joints whose torque a constant predicts better, if there is something to explain."""
    if fit is None or fit.prediction is None:
        return []
    joints = fit.prediction.unexplained(least=0.0)
    return [Notice("LITTLE_EXPLAINED", numbers={"case": "mean", "joint": one}) for one in joints]


def _reasons(result: Result, failure: str | None) -> Iterator[Notice]:
    """Reasons for doubt in a result, the weightiest first."""
    doubts, fit = warnings_of(result.notices), result.fit
    causes = [one for cause in CAUSES for one in of_codes(doubts, cause)]
    implausible = any(one.status == "IMPLAUSIBLE" for one in result.estimates.values())
    if failure is not None and not causes and (implausible or _worse_than_mean(fit)):
        yield Notice("UNKNOWN_CAUSE")
    yield from causes
    for one in of_codes(doubts, "SATURATED_EFFORT", "CLIPPED_TORQUE"):
        if one.numbers.get("percent", 0.0) > MOST_CLIPPED:
            yield one
    yield from of_codes(doubts, "REFUTED")  # why another estimator's numbers are reported
    yield from _of_statuses(requested(result), caused=bool(causes))
    yield from _broken_bounds(fit)
    if fit is not None:
        coloured = [visible(name) for name, test in fit.whiteness.items() if not test.white]
        likely = fit.intervals == "likelihood"
        if coloured and likely:
            yield Notice("NOT_WHITE", numbers={"names": coloured})
        # where the likelihood stands, what is left of a torque is its sensors' noise
        least = 0.0 if likely and not coloured else LEAST_R2
        if fit.prediction is not None:
            for joint, r2 in enumerate(fit.prediction.r2, start=1):
                if r2 < least:
                    part = {"case": "part", "percent": 100 * r2, "band": fit.prediction.band}
                    kind = part if r2 >= 0 else {"case": "mean"}
                    yield Notice("LITTLE_EXPLAINED", numbers=kind | {"joint": joint})
    far = []
    for row in result.table4:
        if row.truth is not None and row.estimate is not None and row.std:
            distance = abs(row.estimate - row.truth) / row.std
            if distance > SURE:
                far.append(f"{visible(row.parameter)} ({significant(distance, 2)} σ)")
    if far:
        yield Notice("FAR_FROM_TRUTH", numbers={"names": far})
    # those of the fit before those of a log
    yield from sorted(doubts, key=lambda one: bool(one.logs))


def requested(result: Result) -> dict[str, Estimate]:
    """The estimates that were asked for: without shrunk terms and terms that the logs have chosen.

    Such a term is there for the sake of the others. That its own coefficients are small beside
    their error bars is no reason to doubt those. Phases are, since they say how the arm is bent.
    """
    model = result.torque_model
    if model is None:
        return result.estimates
    own = list(model.shrunk)
    if model.chosen_by == "logs":
        for term in (EVERY_TERM[name] for name in CHOICES):
            own += () if term.sines else term.names
    return {name: result.estimates[name] for name in outside(result.estimates, own)}


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
        if one.status == "OK" and one.estimate and _share(one) > WIDE:
            wide.append(f"{visible(name)} (±{significant(100 * _share(one), 2)} %)")
    if wide:
        yield Notice("WIDE_INTERVAL", numbers={"names": wide})


def _share(found: Estimate) -> float:
    """Half the 95 % interval relative to the estimate's size."""
    if found.half is None or found.estimate is None:
        return 0.0
    return found.half / abs(found.estimate) if found.estimate else math.inf


def _identified(result: Result) -> str:
    """How many parameters are identified, and by which estimator if it was not the requested."""
    estimates = result.estimates.values()
    identified = sum(one.status == "OK" and one.estimate is not None for one in estimates)
    count = len(estimates)
    share = "all" if identified == count else f"{identified} of"
    have = f"{share} {counted(count, 'parameter')} are identified"
    asked = replaced_estimator(result)
    if asked is not None:
        own, other = visible(result.estimator), visible(asked)
        have += f" by the {own} estimator in place of the {other} one"
    return have


def replaced_estimator(result: Result) -> str | None:
    """The estimator that was asked for, where another one's estimates stand in the result."""
    asked = result.settings.get("estimator")
    return None if asked in (None, result.estimator) else str(asked)


def _praise(result: Result) -> str:
    """What speaks for a result: how certain its estimates are."""
    praise = f"all {counted(len(result.estimates), 'parameter')} are identified"
    widths = {name: _share(one) for name, one in result.estimates.items() if one.half is not None}
    if not widths:
        estimator = visible(result.estimator)
        return f"{praise}, without error bars, which the {estimator} estimator does not give"
    worst = max(widths, key=widths.__getitem__)
    half = significant(100 * widths[worst], 2)
    return f"{praise}, the least certain, {visible(worst)}, to ±{half} % (95 %)"


def share_text(share: float) -> str:
    """A share such as R² in percent, never rounded up to all."""
    return "over 99.99 %" if share > 0.9999 else f"{100 * share:.2f} %"


def _command(result: Result, reasons: Sequence[Notice]) -> str | None:
    """The command to run first: the first cause's remedy, or `algid inspect` without a cause.

    None where neither says more than the call that was made.
    """
    causes, said = of_codes(reasons, *CAUSES, "UNKNOWN_CAUSE"), flat(result.profile)
    if not causes:
        return None
    if causes[0].code == "UNKNOWN_CAUSE":
        words = ["algid", "inspect", result.log.path, *Remedy(said).flags]
        return visible(shlex.join(words), LONGEST_COMMAND)
    remedy = causes[0].remedy
    if remedy is None or "accept" in remedy.settings:  # to accept a cause mends nothing
        return None
    if remedy.settings.items() <= (said | result.settings).items():
        return None
    return again(result, remedy.flags)


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

    words, loaded = ["algid", "identify"], list[str]()
    for log in result.logs:
        if log.role == "loaded":
            loaded += [flag("loaded"), log.path]
        else:
            words.append(log.path)
    own = flat(result.profile)
    for name, value in Settings.of(result.settings):
        if value != DEFAULTS[name] and name not in ("poles", *result.profile):
            own[name] = value
    return words + loaded + list(Remedy(own).flags)
