"""An estimator's outcome for a result: estimates, intervals, Table 4, diagnostics, warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from algid import results
from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.names import outside, places_outside, within
from algid.base.significance import chance, level
from algid.estimators.diagnostics import FAR_BEYOND, broken_bounds, repeatability, term_worths
from algid.estimators.fit import Fit, alone
from algid.estimators.parametrisation import PAYLOAD_PARAMETERS
from algid.estimators.prediction import PredictionScore, cross_validate, score
from algid.estimators.terms import Selection
from algid.identification.by_likelihood import Fitted
from algid.identification.checks import fit_notes, remarks
from algid.identification.series import torque_coefficients, torque_shift
from algid.identification.validate import prediction
from algid.model import DELAYS, UNITS, attributes
from algid.notices import Notice
from algid.physics.effort import absent
from algid.results import Estimate, Status
from algid.table4 import LOADED_ROWS, UNLOADED_ROWS, finite
from algid.table4 import UNITS as TABLE_UNITS


@dataclass(frozen=True, eq=False)
class Identified:
    """Estimates by name, Table 4's rows with standard deviations, and diagnostics."""

    parameters: dict[str, Estimate]
    loaded: dict[str, Estimate]
    payload: dict[str, Estimate]
    rows: Mapping[str, float]
    estimator: str | None = None
    """Whose estimates these are, where not those of the estimator asked for."""
    stds: Mapping[str, float] = field(default_factory=dict)
    paper_payload: dict[str, Estimate] = field(default_factory=dict)
    fit: results.FitSummary | None = None
    notices: list[Notice] = field(default_factory=list)

    def distrusted(self) -> Identified:
        """The same with no status OK left."""
        return replace(
            self,
            parameters=distrusted(self.parameters),
            loaded=distrusted(self.loaded),
            payload=distrusted(self.payload),
        )


def outcome_of(found: Fitted) -> Identified:
    """The fit as a result holds it."""
    fit, survey, settings = found.fit, found.survey, found.settings
    # a constant that the model has no column for is not identifiable
    estimates = {name: unknown(UNITS[name]) for name in CONSTANT_NAMES}
    estimates |= _estimates(fit.names, fit.values, fit.std, fit.quantile, fit.status)
    estimates = with_significance(estimates)
    gone = set(fit.absent) | set(absent(settings.effort, CONSTANT_NAMES))
    parameters, payload = {}, {}
    for name, one in estimates.items():
        if name in gone:
            continue
        if name in PAYLOAD_PARAMETERS:
            payload[name] = one
        else:
            parameters[name] = one
    rows, stds = table_rows(fit)
    combined = {}
    if survey.loaded:
        combined = _loaded_rows(fit, rows, stds, gone)
    summary = fit_summary(found)
    notices = list(remarks(found))
    if settings.cross_validate and summary.cross_validation is None:
        notices.append(Notice("SHORT_LOG", numbers={"case": "validation"}))
    outcome = Identified(
        parameters=parameters,
        loaded=combined,
        payload=payload,
        rows=rows,
        estimator=fit.estimator,
        stds=stds,
        fit=summary,
        notices=notices + list(fit_notes(summary)),
    )
    accepted = {code for log in survey.logs for code in log.origin.reading.accepted}
    torque = "FROM_PRIOR" not in fit.status  # a prior errs by as much as it says
    if is_implausible(summary, bounds="BROKEN_BOUND" not in accepted, torque=torque):
        return outcome.distrusted()
    return outcome


def _loaded_rows(
    fit: Fit, rows: Mapping[str, float], stds: Mapping[str, float], gone: set[str]
) -> dict[str, Estimate]:
    """Estimates of the loaded arm's rows of Table 4, save those with a constant that is `gone`."""
    combined = {}
    status_of = dict(zip(fit.names, fit.status, strict=True))
    for name, constants in LOADED_ROWS.items():
        unit = TABLE_UNITS[name]
        status = "OK"
        if not fit.converged:
            status = "NOT_CONVERGED"
        elif any(status_of.get(one) == "FROM_PRIOR" for one in constants):
            status = "FROM_PRIOR"
        if not gone.isdisjoint(constants):
            continue
        if name in rows:
            half = fit.quantile * stds[name]
            combined[name] = estimate(rows[name], stds[name], half, unit, status)
        else:
            combined[name] = unknown(unit)
    return with_significance(combined)


def is_implausible(
    summary: results.FitSummary, *, bounds: bool = True, torque: bool = True
) -> bool:
    """Whether physics or the torque contradict a fit.

    Its estimates come from one solution: where one of them breaks a bound by more than chance
    explains, or a joint's torque is predicted worse than its mean would, none can be trusted. A
    torque that hardly varies leaves R² nothing to explain, nor does a joint that is hardly driven;
    there the residual has to be a tenth of what acts on the joint at least. Without `bounds`, or
    `torque`, by the other alone.
    """
    for bound in summary.broken_bounds:
        if bounds and bound.distance_sigma is not None and bound.distance_sigma > FAR_BEYOND:
            return True
    judged = summary.cross_validation or summary.residual
    return torque and judged is not None and bool(judged.unexplained(least=0.0))


def distrusted(group: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """The estimates with no status OK left."""
    changed = dict(group)
    for name, one in group.items():
        if one.usable:
            changed[name] = one.model_copy(update={"status": Status.IMPLAUSIBLE})
    return changed


def _estimates(
    names: Sequence[str],
    values: FloatArray,
    stds: FloatArray,
    quantile: float,
    statuses: Sequence[str] = (),
) -> dict[str, Estimate]:
    """Estimates by name.

    Without `statuses`, those whose deviation is infinite are not identifiable.
    """
    if not statuses:
        statuses = np.where(np.isfinite(stds), "OK", "NOT_IDENTIFIABLE").tolist()
    estimates = {}
    for name, value, std, status in zip(names, values, stds, statuses, strict=True):
        estimates[name] = estimate(value, std, quantile * std, UNITS[name], status)
    return estimates


def estimate(value: float, std: float, half: float, unit: str, status: str) -> Estimate:
    """One estimate with `half` its interval.

    Nothing but its unit where the logs do not determine it.
    """
    if status == "NOT_IDENTIFIABLE":
        return unknown(unit)
    interval = (finite(value - half), finite(value + half))
    return Estimate(
        estimate=finite(value), std=finite(std), ci95=interval, unit=unit, status=Status(status)
    )


def with_significance(group: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """The estimates; those whose 95 % interval contains zero are not significant."""
    changed = dict(group)
    for name, one in group.items():
        if one.status is Status.OK and _holds_zero(one):
            changed[name] = one.model_copy(update={"status": Status.NOT_SIGNIFICANT})
    return changed


def _holds_zero(one: Estimate) -> bool:
    low, high = one.ci95 or (None, None)
    return low is not None and high is not None and low <= 0 <= high


def unknown(unit: str) -> Estimate:
    """An estimate that the logs do not determine, its interval unbounded."""
    return Estimate(
        estimate=None, std=None, ci95=(None, None), unit=unit, status=Status.NOT_IDENTIFIABLE
    )


def table_rows(fit: Fit) -> tuple[dict[str, float], dict[str, float]]:
    """Table 4's rows and their standard deviations.

    None of a parameter that is not identifiable.
    """
    rows: dict[str, float] = {}
    stds: dict[str, float] = {}
    kinds = [(False, UNLOADED_ROWS)]
    if fit.shared.payload:
        kinds.append((True, LOADED_ROWS))
    unusable = set(np.array(fit.names)[np.array(fit.status) == "NOT_IDENTIFIABLE"].tolist())
    for loaded, constants_of in kinds:
        jacobian = fit.shared.jacobian(fit.values, loaded)
        coefficients = fit.shared.coefficients(fit.values, loaded)
        for name, constants in constants_of.items():
            weight = np.isin(fit.shared.log_names, constants).astype(np.float64)
            has_columns = weight.sum() == len(constants)
            if name in unusable or not has_columns or not set(constants).isdisjoint(fit.absent):
                continue
            spread = fit.spread(weight @ jacobian)
            if np.isfinite(spread):
                rows[name], stds[name] = float(weight @ coefficients), spread
    if fit.shared.payload:
        place = fit.names.index("m_p")
        if np.isfinite(fit.std[place]):
            rows["m_p"], stds["m_p"] = float(fit.values[place]), float(fit.std[place])
    return rows, stds


def fit_summary(found: Fitted) -> results.FitSummary:
    """The statistical part of a result."""
    fit, chosen = found.fit, found.chosen
    residual, crossed = _predicted(found)
    cross_validation = None
    if crossed is not None:
        cross_validation = prediction(crossed)
    names, covariance = _covariance(fit)
    return results.FitSummary(
        noise=_noise(fit),
        covariance_names=names,
        covariance=covariance,
        intervals=fit.intervals,
        iterations=fit.iterations,
        converged=fit.converged,
        whiteness=_whiteness(fit),
        unidentifiable=[one.text for one in fit.unidentifiable],
        model=results.TorqueModel(
            terms=list(chosen.model.terms),
            coulomb_speed=chosen.model.coulomb_speed,
            stribeck_speed=chosen.model.stribeck_speed,
            chosen_by=chosen.chosen_by,
            shrunk=_expected(fit, chosen),
        ),
        terms=list(_terms(fit, chosen)),
        torque_hold=_torque_hold(chosen),
        broken_bounds=_bounds(fit),
        endogeneity=_endogeneity(fit),
        by_log=list(_by_log(fit)),
        residual=prediction(residual),
        cross_validation=cross_validation,
        repeatability=_repeatability(fit),
        torque_gain=_torque_gain(fit, found.settings.payload_mass),
        stiffness=_stiffness(fit),
    )


def _by_log(fit: Fit) -> Iterator[dict[str, Estimate]]:
    """Each log's own estimates."""
    coloured = fit.intervals != "likelihood"
    for log in fit.logs:
        own = alone(fit.shared, [log], fit.shrinkage, coloured=coloured)
        yield _estimates(own.names, own.values, own.std, fit.quantile)


def _noise(fit: Fit) -> dict[str, float]:
    """Standard deviations of angles and torques, root mean squares over the logs."""
    if not fit.noise:
        return {}
    levels = [np.append(one.theta, one.tau) for one in fit.noise]
    level = np.sqrt(np.mean(np.square(levels), axis=0))
    return dict(zip(("theta1", "theta2", "tau1", "tau2"), level.tolist(), strict=True))


def _covariance(fit: Fit) -> tuple[list[str], list[list[float | None]]]:
    """Names of the parameters that the torque holds, and their covariance."""
    there = places_outside(fit.names, fit.absent)
    lost = np.isinf(fit.std)
    covariance = np.where(lost | lost[:, None], np.inf, fit.covariance)[np.ix_(there, there)]
    known = [[finite(value) for value in row] for row in covariance]
    return list(outside(fit.names, fit.absent)), known


def _whiteness(fit: Fit) -> dict[str, results.WhitenessTest]:
    """The tests of both joints' residuals; empty where none was made."""
    tests = fit.whiteness
    if tests is None:
        return {}
    by_joint = {}
    for joint in range(2):
        by_joint[f"tau{joint + 1}"] = results.WhitenessTest(
            white=tests.joint_white[joint],
            p_value=finite(float(tests.p_value[joint])),
            lag1_correlation=float(tests.lag1[joint]),
        )
    return by_joint


def _bounds(fit: Fit) -> list[results.Bound]:
    """Bounds of physics that the estimates break beyond their 95 % intervals."""
    bounds = []
    for broken in broken_bounds(fit):
        distance = broken.distance
        if distance is not None and not distance > fit.quantile:
            continue
        if fit.beyond_errors:
            distance = None
        bounds.append(
            results.Bound(bound=broken.bound, value=broken.value, distance_sigma=distance)
        )
    return bounds


def _endogeneity(fit: Fit) -> dict[str, results.Endogeneity]:
    """The largest disagreement of instruments and least squares; empty where it was not tested."""
    statistic = fit.endogeneity
    if statistic is None:
        return {}
    # as many coefficients were looked at as a log has (Bonferroni)
    p_value = chance(statistic, len(fit.shared.log_names))
    endogenous = p_value < level("INSTRUMENTS")
    test = results.Endogeneity(statistic=statistic, p_value=p_value, endogenous=endogenous)
    return {"largest": test}


def _repeatability(fit: Fit) -> results.Repeatability | None:
    """Scatter of the payload's mass over the loaded logs; None of fewer than it takes."""
    repeated = repeatability(fit)
    if repeated is None:
        return None
    masses, std, ci95 = repeated
    return results.Repeatability(masses=masses.tolist(), std=std, ci95=ci95)


def _predicted(found: Fitted) -> tuple[PredictionScore, PredictionScore | None]:
    """How well the fit predicts its own logs and, if asked and possible, each from the others."""
    fit, survey, settings = found.fit, found.survey, found.settings
    own = PredictionScore()
    for log in survey.logs:
        c = torque_coefficients(fit, log.role)
        own += score(fit.shared.model, c, survey.segments(log), torque_shift(settings, fit))
    if not settings.cross_validate:
        return own, None
    unloaded = [partial(survey.segments, log) for log in survey.unloaded]
    loaded = [partial(survey.segments, log) for log in survey.loaded]
    return own, cross_validate(fit, unloaded, loaded, settings.torque_shift())


def _expected(fit: Fit, chosen: Selection) -> list[str]:
    """Coefficients of terms that were not chosen: each is what the logs and a prior agree on."""
    if fit.shrinkage is not None:
        return list(fit.shrinkage.names)
    if chosen.undetermined is None:
        return []
    return list(within(DELAYS, fit.names))


def _torque_hold(chosen: Selection) -> results.TorqueHold:
    """What was asked of the torque's hold, what was used, and what the logs show."""
    asked: Literal["auto", "foh", "zoh"] = "auto"
    if chosen.hold_by == "settings":
        asked = chosen.hold
    late = chosen.late
    if late is None or chosen.hold_by != "logs":
        return results.TorqueHold(asked=asked, used=chosen.hold)
    return results.TorqueHold(
        asked=asked,
        used=chosen.hold,
        told=late.determined,
        faster=late.faster,
        half=late.half,
        late=late.late,
        late_std=finite(late.std),
        odds=finite(late.odds),
        share=finite(late.share),
    )


def _terms(fit: Fit, chosen: Selection) -> Iterator[results.TermCriterion]:
    """Worth of each term that the logs chose from, or of those that were given."""
    if not chosen.trials:
        for term, delta_bic in term_worths(fit):
            yield results.TermCriterion(term=term, delta_bic=delta_bic, kept=delta_bic < 0)
    for trial in chosen.trials:
        yield results.TermCriterion(
            term=trial.term,
            kept=trial.kept,
            # a Wald statistic is twice a difference of log-likelihoods
            evidence=finite(0.5 * trial.evidence),
            why=trial.reason,
        )


def _torque_gain(fit: Fit, known: float | None) -> Estimate | None:
    """What the logs' torques have to be multiplied by, where the payload's mass is known, in kg.

    All that has N m in its unit, m_p too, grows with a common gain of both torques; lengths do not.
    """
    if known is None or "m_p" not in fit.names:
        return None
    return _inverse(fit, "m_p", known, "1")


def _stiffness(fit: Fit) -> dict[str, Estimate]:
    """Stiffness of each elastic joint, by the inverse of its compliance."""
    joints = attributes(fit.shared.model, "elastic")
    return {f"k_e{joint + 1}": _inverse(fit, name, 1.0, "N m/rad") for name, joint in joints}


def _inverse(fit: Fit, name: str, over: float, unit: str) -> Estimate:
    """`over` a parameter, with its interval; unknown where that may be nothing or less."""
    place = fit.names.index(name)
    value, std = float(fit.values[place]), float(fit.std[place])
    half = fit.quantile * std
    if not np.isfinite(std) or value <= half:
        return unknown(unit)
    found = estimate(over / value, over / value * std / value, 0.0, unit, fit.status[place])
    return found.model_copy(update={"ci95": (over / (value + half), over / (value - half))})
