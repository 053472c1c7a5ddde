"""An estimator's outcome for a result: estimates, intervals, Table 4, diagnostics, warnings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import PurePath
from typing import Any

import numpy as np

from algid import __version__, results
from algid.arm import CONSTANT_NAMES
from algid.base.names import named_values, outside, places_outside, within
from algid.base.significance import chance, level
from algid.estimators.diagnostics import FAR_BEYOND, broken_bounds, repeatability, term_worths
from algid.estimators.fit import Fit
from algid.estimators.innovations import judge
from algid.estimators.parametrisation import PAYLOAD_PARAMETERS
from algid.estimators.prediction import NOTHING, cross_validate
from algid.estimators.terms import Selection
from algid.identification.by_likelihood import Fitted
from algid.identification.checks import fit_notes, remarks
from algid.identification.known import FAR, SENSORS
from algid.identification.recordings import Recordings
from algid.identification.series import predictor_of_fit
from algid.identification.validate import predicted_by, prediction
from algid.model import DELAYS, K4, SINE_OF, UNITS, acting
from algid.notices import Notice, codes_of, has_code, lossy, merged, of_codes
from algid.physics.effort import absent
from algid.physics.signals import widths_of
from algid.results import Estimate, Result, Status
from algid.results.verdict import LEAST_R2
from algid.settings import Settings
from algid.table4 import (
    LOADED_ROWS,
    UNLOADED_ROWS,
    finite,
    table4,
    true_parameters,
)
from algid.table4 import UNITS as TABLE_UNITS


def started(
    survey: Recordings,
    settings: Settings,
    rows: Mapping[str, Estimate],
    *,
    parameters: dict[str, Estimate],
    **found: Any,
) -> Result:
    """A result of a survey's logs with Table 4's `rows` and what else was `found`."""
    truth = survey.logs[0].origin.truth
    payload = None
    if survey.loaded and survey.loaded[0].origin.truth:
        payload = survey.loaded[0].origin.truth.payload
    first, *others = map(survey.summary, survey.logs)
    return Result(
        version=__version__,
        parameters=parameters,
        table4=table4(rows, truth, payload),
        truth=true_parameters(truth, payload),
        settings=settings.as_json(),
        log=first,
        more_logs=others,
        **{"estimator": settings.estimator} | found,
    )


def distrusted(result: Result) -> Result:
    """The result with no status OK left among its estimates."""
    changed = {}
    for group in ("parameters", "loaded", "payload"):
        changed[group] = dict(getattr(result, group))
        for name, one in changed[group].items():
            if one.usable:
                changed[group][name] = one.model_copy(update={"status": Status.IMPLAUSIBLE})
    return result.model_copy(update=changed)


def outcome_of(found: Fitted) -> Result:
    """The result of a fit, but for what was noticed in its logs.

    Its estimates come from one solution: where one of them breaks a bound of physics by more than
    chance explains, or a joint's torque is predicted worse than its mean would, none can be
    trusted. A torque that hardly varies leaves R² nothing to explain, nor does a joint that is
    hardly driven; there the residual has to be a tenth of what acts on the joint at least.
    """
    fit, settings = found.fit, found.settings
    gone = set(fit.absent) | set(absent(settings.effort, CONSTANT_NAMES))
    # a constant that the model has no column for is not identifiable
    estimates = {name: unknown(UNITS[name]) for name in CONSTANT_NAMES}
    estimates |= _estimates(fit)
    there = outside(estimates, gone)
    parameters = {name: estimates[name] for name in outside(there, PAYLOAD_PARAMETERS)}
    payload = {name: estimates[name] for name in within(there, PAYLOAD_PARAMETERS)}
    rows, summary = table_rows(fit), fit_summary(found)
    loaded = {}
    for name, constants in LOADED_ROWS.items():
        if name in rows and gone.isdisjoint(constants):
            loaded[name] = rows[name]
    notices = list(remarks(found))
    if settings.cross_validate and summary.cross_validation is None:
        notices.append(Notice("SHORT_LOG", numbers={"case": "validation"}))
    result = started(
        found.survey,
        settings,
        rows | payload,
        parameters=parameters,
        estimator=fit.estimator,
        loaded=loaded,
        payload=payload,
        fit=summary,
        notices=[*notices, *fit_notes(summary)],
    )
    judged = summary.prediction
    if "FROM_PRIOR" in fit.status:  # a prior errs by as much as it says
        judged = None
    far = any((one.distance_sigma or 0.0) > FAR_BEYOND for one in summary.broken_bounds)
    far &= "BROKEN_BOUND" not in found.survey.accepted
    if far or (judged is not None and judged.unexplained(least=0.0)):
        return distrusted(result)
    return result


def _estimates(fit: Fit) -> dict[str, Estimate]:
    """Estimates of a fit by name."""
    estimates = {}
    for name, value, std, status in zip(fit.names, fit.values, fit.std, fit.status, strict=True):
        estimates[name] = estimate(value, std, fit.quantile * std, UNITS[name], status)
    return estimates


def estimate(value: float, std: float, half: float, unit: str, status: str) -> Estimate:
    """One estimate with `half` its interval: one that contains zero is not significant.

    Nothing but its unit where the logs do not determine it.
    """
    if status == "NOT_IDENTIFIABLE":
        return unknown(unit)
    low, high = finite(value - half), finite(value + half)
    if status == "OK" and low is not None and high is not None and low <= 0 <= high:
        status = "NOT_SIGNIFICANT"
    return Estimate(
        estimate=finite(value), std=finite(std), ci95=(low, high), unit=unit, status=Status(status)
    )


def unknown(unit: str) -> Estimate:
    """An estimate that the logs do not determine, its interval unbounded."""
    return Estimate(
        estimate=None, std=None, ci95=(None, None), unit=unit, status=Status.NOT_IDENTIFIABLE
    )


def table_rows(fit: Fit) -> dict[str, Estimate]:
    """Table 4's rows; unknown where a constant is not identifiable, or nothing."""
    status_of: dict[str, str] = dict(zip(fit.names, fit.status, strict=True))
    rows: dict[str, Estimate] = {}
    kinds = [(False, UNLOADED_ROWS)]
    if fit.shared.payload:
        kinds.append((True, LOADED_ROWS))
    for loaded, constants_of in kinds:
        jacobian = fit.shared.jacobian(fit.values, loaded)
        coefficients = fit.shared.coefficients(fit.values, loaded)
        for name, constants in constants_of.items():
            weight = np.isin(fit.shared.log_names, constants).astype(np.float64)
            known = weight.sum() == len(constants) and set(constants).isdisjoint(fit.absent)
            known &= status_of.get(name) != "NOT_IDENTIFIABLE"
            spread = fit.spread(weight @ jacobian) if known else np.inf
            status = "OK"
            if not np.isfinite(spread):
                status = "NOT_IDENTIFIABLE"
            elif not fit.converged:
                status = "NOT_CONVERGED"
            elif "FROM_PRIOR" in map(status_of.get, constants):
                status = "FROM_PRIOR"
            value, half = float(weight @ coefficients), fit.quantile * spread
            rows[name] = estimate(value, spread, half, TABLE_UNITS[name], status)
    return rows


def fit_summary(found: Fitted) -> results.FitSummary:
    """The statistical part of a result."""
    fit, survey, settings, chosen = found.fit, found.survey, found.settings, found.chosen
    crossed = NOTHING  # each log predicted from the others, where asked and possible
    if settings.cross_validate:
        logs = [partial(survey.segments, log) for log in survey.logs]
        crossed = cross_validate(fit, logs, settings.torque_shift())
    noise = {}  # root mean squares over the logs
    if fit.noise:
        noise = named_values(SENSORS, np.sqrt(np.mean(np.square(fit.noise), axis=0)).ravel())
    there, lost = places_outside(fit.names, fit.absent), np.isinf(fit.std)
    covariance = np.where(lost | lost[:, None], np.inf, fit.covariance)[np.ix_(there, there)]
    by_log = [_estimates(replace(log, quantile=fit.quantile)) for log in fit.each]
    repeated = None
    if (scatter := repeatability(fit)) is not None:
        masses, std, ci95 = scatter
        repeated = results.Repeatability(masses=masses.tolist(), std=std, ci95=ci95)
    expected = fit.shrunk  # each is what the logs and a prior agree on
    if chosen.undetermined is not None:
        expected = within(DELAYS, fit.names)
    gain, known = None, settings.payload_mass
    if known is not None and "m_p" in fit.names:
        # all that has N m in its unit, m_p too, grows with a common gain of both torques
        gain = _inverse(fit, "m_p", known, "1")
    whiteness = {}  # empty where no test was made
    if fit.residual:
        tests = judge(fit.residual)
        for joint, name in enumerate(("tau1", "tau2")):
            whiteness[name] = results.WhitenessTest(
                white=tests.joint_white[joint],
                p_value=finite(tests.p_value[joint]),
                lag1_correlation=float(tests.lag1[joint]),
            )
    # worth of each term that the logs chose from, or of those that were given
    terms = [
        # a Wald statistic is twice a difference of log-likelihoods
        results.TermCriterion(
            term=one.term, kept=one.kept, evidence=finite(0.5 * one.evidence), why=one.reason
        )
        for one in chosen.trials
    ]
    if not terms:
        for name, delta_bic in term_worths(fit):
            worth = results.TermCriterion(term=name, delta_bic=delta_bic, kept=delta_bic < 0)
            terms.append(worth)
    bounds = []  # of physics that the estimates break beyond their 95 % intervals
    for one in broken_bounds(fit):
        if one.distance is None or one.distance > fit.quantile:
            distance = None if fit.beyond_errors else one.distance
            bounds.append(results.Bound(bound=one.bound, value=one.value, distance_sigma=distance))
    endogeneity = {}
    if fit.endogeneity is not None:
        # as many coefficients were looked at as a log has (Bonferroni)
        p = chance(fit.endogeneity, len(fit.shared.log_names))
        endogeneity["largest"] = results.Endogeneity(
            statistic=fit.endogeneity, p_value=p, endogenous=p < level("INSTRUMENTS")
        )
    return results.FitSummary(
        noise=noise,
        covariance_names=list(outside(fit.names, fit.absent)),
        covariance=[[finite(value) for value in row] for row in covariance],
        intervals=fit.intervals,
        iterations=fit.iterations,
        converged=fit.converged,
        whiteness=whiteness,
        unidentifiable=[one.text for one in fit.unidentifiable],
        model=results.TorqueModel(
            terms=list(chosen.model.terms),
            **widths_of(chosen.model),
            chosen_by=chosen.chosen_by,
            shrunk=list(expected),
        ),
        terms=terms,
        torque_hold=_torque_hold(chosen),
        broken_bounds=bounds,
        endogeneity=endogeneity,
        by_log=by_log,
        residual=predicted_by(predictor_of_fit(found), survey),
        cross_validation=prediction(crossed),
        repeatability=repeated,
        torque_gain=gain,
        stiffness={
            f"k_e{joint + 1}": _inverse(fit, fit.shared.model.names[place], 1.0, "N m/rad")
            for place, joint in acting(fit.shared.model, "elastic")
        },
    )


def _torque_hold(chosen: Selection) -> results.TorqueHold:
    """What was asked of the torque's hold, what was used, and what the logs show."""
    late = chosen.late
    if late is None or chosen.hold_by != "logs":
        asked = chosen.hold if chosen.hold_by == "settings" else "auto"
        return results.TorqueHold(asked=asked, used=chosen.hold)
    return results.TorqueHold(
        asked="auto",
        used=chosen.hold,
        told=late.determined,
        faster=late.faster,
        half=late.half,
        late=late.late,
        late_std=finite(late.std),
        odds=finite(late.odds),
        share=finite(late.share),
    )


def _inverse(fit: Fit, name: str, over: float, unit: str) -> Estimate:
    """`over` a parameter, with its interval; unknown where that may be nothing or less."""
    value, std = fit.by_name[name]
    half = fit.quantile * std
    if not np.isfinite(std) or value <= half:
        return unknown(unit)
    return Estimate(
        estimate=finite(over / value),
        std=finite(over / value * std / value),
        ci95=(over / (value + half), over / (value - half)),
        unit=unit,
        status=Status(fit.status[fit.names.index(name)]),
    )


CONTRADICTED = ("WRONG_CONVENTION", "LOST_SAMPLES")
"""Checks by which estimates are wrong, unless the user accepts them.

A time base that is too short by the samples it lacks falsifies accelerations by twice their share.
"""
_OF_GRAVITY = ("FLIPPED_SIGN", "WRONG_ZERO")
"""Checks of single logs, on which the estimator's own has the last word."""


def _pulled_down(fit: results.FitSummary | None, count: int) -> list[bool]:
    """True for each of `count` logs if gravity pulls down in its part of the fit, beyond doubt.

    The fit has to explain the torques and to break no bound. A zero that is off turns k4 into its
    sine part k4s: the model must have had that to choose from.
    """
    if (
        fit is None
        or fit.model is None
        or fit.residual is None
        or len(fit.by_log) != count
        or fit.model.chosen_by != "logs"
        or fit.broken_bounds
        or fit.residual.unexplained(LEAST_R2)
    ):
        return [False] * count
    down, nothing = [], unknown(UNITS[K4])
    for own in fit.by_log:
        along, across = own.get(K4, nothing), own.get(SINE_OF[K4], nothing)
        least = max(FAR * (along.std or np.inf), abs(across.estimate or 0.0))
        down.append((along.estimate or 0.0) > least)
    return down


def judged(result: Result, survey: Recordings) -> Result:
    """The result with what was noticed in its logs; distrusted where that makes it wrong."""
    fit, turned = result.fit, has_code(result.notices, "WRONG_ZERO")
    # no likelihood stands within the bounds of physics and upright
    doubtful = fit is None or result.estimator != "refined" or bool(fit.broken_bounds) or turned
    # checks, as code and case, of single logs that the fit of all of them makes more precisely
    replaced = {
        "WRONG_ZERO:": turned,
        "GRAVITY_COMPENSATED:arm": result.settings.get("effort") is not None,
        "DEGREES:reach": not doubtful,  # in another unit no angle's sine would fit
    }
    down = _pulled_down(fit, len(survey.logs))
    of_logs, other_arms, of_fit = list[Notice](), list[Notice](), result.notices
    truth = survey.logs[0].origin.truth
    for log, noticed, is_down in zip(
        survey.logs, survey.noticed(doubtful=doubtful), down, strict=True
    ):
        for notice in noticed:
            if not replaced.get(notice.key) and not (is_down and notice.code in _OF_GRAVITY):
                of_logs.append(notice.of(PurePath(log.name).name))  # the paths stand among the logs
        own = log.origin.truth
        if truth and own and own.arm != truth.arm:  # another synthetic arm
            numbers = {"case": "metadata", "first": survey.logs[0].name}
            other_arms.append(Notice("OTHER_ARM", numbers=numbers, logs=(log.name,)))
    if has_code(of_logs, "WRONG_CONVENTION"):  # of which gravity that is turned is a part
        of_fit = [one for one in of_fit if one.code != "WRONG_ZERO"]
    swings = [one for one in of_codes(of_logs, "OTHER_JOINTS") if one.numbers.get("swing")]
    wrong = of_codes(of_logs, *CONTRADICTED) + of_codes(of_fit, "WRONG_ZERO") + swings
    notices = [*merged(of_logs), *other_arms, *of_fit]
    result = result.model_copy(update={"data_lost": lossy(of_logs), "notices": notices})
    return result if survey.accepted.issuperset(codes_of(wrong)) else distrusted(result)
