"""What an estimator found, as a result holds it: estimates with intervals, Table 4's rows, diagnostics, warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from algid import results
from algid.arm import CONSTANT_NAMES, FloatArray
from algid.estimators.diagnostics import (
    FAR_BEYOND,
    broken_bounds,
    length_by_constants,
    payload_distance,
    repeatability,
    term_worths,
)
from algid.estimators.fit import Fit, OwnEstimate, own_estimates
from algid.estimators.instruments import ENDOGENEOUS
from algid.estimators.parametrisation import PAYLOAD_PARAMETERS
from algid.estimators.prediction import PredictionFilter, PredictionScore, cross_validate, score
from algid.estimators.selection import Selection
from algid.identification.by_likelihood import Predictions
from algid.identification.series import torque_coefficients, torque_shift
from algid.identification.source import Survey
from algid.log import Notice
from algid.model import UNITS
from algid.results import Cause, Estimate, Status
from algid.settings import Settings
from algid.table4 import LOADED_ROWS, UNLOADED_ROWS, finite
from algid.table4 import UNITS as TABLE_UNITS

ONE_RUN = "what differs from run to run is not in the intervals: give four logs or more"
"""Of intervals that rest on blocks of logs."""
ONE_SIDED = 1.645  # standard deviations of a one-sided bound at 95 %
FAR_APART = 5.0  # standard deviations past which two logs are not of one arm
NEAR_CONSTANT = 0.1  # of the torque's RMS: a residual this small passes, however little there was to explain


@dataclass(frozen=True, eq=False)
class Identified:
    """Estimates by name, Table 4's rows with their standard deviations, and what else the estimator knows."""

    parameters: dict[str, Estimate]
    loaded: dict[str, Estimate]
    payload: dict[str, Estimate]
    rows: Mapping[str, float]
    estimator: str | None = None
    """Whose estimates these are, where not those of the estimator asked for."""
    stds: Mapping[str, float] = field(default_factory=dict)
    paper_payload: dict[str, Estimate] = field(default_factory=dict)
    fit: results.FitSummary | None = None
    warnings: list[str] = field(default_factory=list)
    causes: list[Cause] = field(default_factory=list)
    """What probably lies behind a poor result, the most likely first."""


def outcome_of(fit: Fit, predictions: Predictions, survey: Survey, settings: Settings, chosen: Selection) -> Identified:
    """The fit as a result holds it."""
    found = _estimates(fit)
    payload = {name: found.pop(name) for name in PAYLOAD_PARAMETERS if name in found}
    rows, stds = table_rows(fit)
    summary = fit_summary(fit, predictions, survey, settings, chosen)
    units = {**TABLE_UNITS, "l1": "m", "l2": "m"}
    combined = (
        {name: _row_estimate(rows, stds, name, fit, units[name]) for name in LOADED_ROWS} if survey.loaded else {}
    )
    if is_implausible(summary):
        found, combined, payload = (distrusted(group) for group in (found, combined, payload))
    return Identified(
        parameters=found,
        loaded=combined,
        payload=payload,
        rows=rows,
        estimator=fit.estimator,
        stds=stds,
        fit=summary,
        warnings=[*fit_warnings(fit), *_not_crossed(summary, settings)],
        causes=[Cause(cause=EXCHANGED)] if _exchanged(fit) else [],
    )


def is_implausible(summary: results.FitSummary) -> bool:
    """Whether physics or the torque contradict a fit.

    Its estimates come from one solution: where one of them breaks a bound by more than chance explains, or a joint's
    torque is predicted worse than its mean would, none can be trusted. A torque that hardly varies leaves R² nothing
    to explain; there the residual has to be a tenth of the torque at least.
    """
    if any(bound.distance_sigma is not None and bound.distance_sigma > FAR_BEYOND for bound in summary.broken_bounds):
        return True
    judged = summary.cross_validation or summary.residual
    if judged is None:
        return False
    return any(r2 < 0 and nrmse > NEAR_CONSTANT for r2, nrmse in zip(judged.r2, judged.nrmse, strict=True))


def distrusted(group: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """The estimates with no status OK left."""
    return {
        name: found.model_copy(update={"status": Status.IMPLAUSIBLE}) if found.status is Status.OK else found
        for name, found in group.items()
    }


def _not_crossed(summary: results.FitSummary, settings: Settings) -> Iterator[str]:
    if settings.cross_validate and summary.cross_validation is None:
        yield "no cross-validation: a log is too short to be fitted, or to be judged"


def _row_estimate(rows: dict[str, float], stds: dict[str, float], name: str, fit: Fit, unit: str) -> Estimate:
    if name not in rows:
        return estimate(np.nan, np.inf, (-np.inf, np.inf), unit, "NOT_IDENTIFIABLE")
    half = fit.quantile * stds[name]
    status = "OK" if fit.converged else "NOT_CONVERGED"
    return estimate(rows[name], stds[name], (rows[name] - half, rows[name] + half), unit, status)


def _estimates(fit: Fit) -> dict[str, Estimate]:
    """The shared parameters by name; a constant that the model has no column for is not identifiable."""
    found = {
        name: estimate(value, std, (low, high), UNITS[name], status)
        for name, value, std, (low, high), status in zip(
            fit.names, fit.values, fit.std, fit.ci95, fit.status, strict=True
        )
    }
    absent = {
        name: estimate(np.nan, np.inf, (-np.inf, np.inf), UNITS[name], "NOT_IDENTIFIABLE") for name in CONSTANT_NAMES
    }
    return {**absent, **found}


def estimate(value: float, std: float, interval: tuple[float, float], unit: str, status: str) -> Estimate:
    """One estimate; without a value where the logs do not determine it, its interval then unbounded."""
    determined = status != "NOT_IDENTIFIABLE"
    return Estimate(
        estimate=finite(value) if determined else None,
        std=finite(std) if determined else None,
        ci95=(finite(interval[0]), finite(interval[1])) if determined else (None, None),
        unit=unit,
        status=Status(status),
    )


def table_rows(fit: Fit) -> tuple[dict[str, float], dict[str, float]]:
    """Table 4's rows and their standard deviations; none of a parameter that is not identifiable."""
    rows: dict[str, float] = {}
    stds: dict[str, float] = {}
    lost = {name for name, status in zip(fit.names, fit.status, strict=True) if status == "NOT_IDENTIFIABLE"}
    for loaded in (False, True):
        if loaded and not fit.shared.payload:
            continue
        jacobian = fit.shared.jacobian(fit.values, loaded)
        place = {name: number for number, name in enumerate(fit.shared.log_names)}
        weights = _row_weights(place, LOADED_ROWS if loaded else UNLOADED_ROWS)
        coefficients = fit.shared.coefficients(fit.values, loaded)
        for name, weight in weights.items():
            spread = fit.spread(weight @ jacobian)
            if np.isfinite(spread) and name not in lost:
                rows[name], stds[name] = float(weight @ coefficients), spread
    if fit.shared.payload and np.isfinite(fit.std[fit.names.index("m_p")]):
        rows["m_p"] = float(fit.values[fit.names.index("m_p")])
        stds["m_p"] = float(fit.std[fit.names.index("m_p")])
    return rows, stds


def _row_weights(place: dict[str, int], names: Sequence[str]) -> dict[str, FloatArray]:
    """Each row of Table 4 as a sum of a log's coefficients, in the order that both halves of the table share."""
    sums = (("k5", "k3"), ("k1",), ("k3",), ("k6",), ("k4",), ("k2",))
    ordered = sums if len(names) == len(sums) else tuple(constant for constant in sums if constant != ("k6",))
    weights: dict[str, FloatArray] = {}
    for name, constants in zip(names, ordered, strict=True):
        if all(constant in place for constant in constants):
            weight = np.zeros(len(place))
            weight[[place[constant] for constant in constants]] = 1.0
            weights[name] = weight
    return weights


def fit_summary(
    fit: Fit, predictions: Predictions, survey: Survey, settings: Settings, chosen: Selection
) -> results.FitSummary:
    """The statistical part of a result."""
    crossed = None
    if settings.cross_validate:
        unloaded, loaded = (
            [partial(survey.segments, log) for log in logs] for logs in (survey.unloaded, survey.loaded)
        )
        crossed = cross_validate(fit, unloaded, loaded, settings.torque_shift)
    return results.FitSummary(
        noise=_noise(fit),
        covariance_names=list(fit.names),
        covariance=[[finite(value) for value in row] for row in _open_covariance(fit)],
        intervals=fit.intervals,
        iterations=fit.iterations,
        converged=fit.converged,
        whiteness=_whiteness(fit),
        unidentifiable=list(fit.unidentifiable),
        model=_model(chosen),
        terms=_terms(fit, chosen),
        broken_bounds=[
            results.Bound(bound=b.bound, value=b.value, distance_sigma=b.distance) for b in broken_bounds(fit)
        ],
        endogeneity=_endogeneity(fit),
        by_log=[_own(fit, own) for own in own_estimates(fit)],
        residual=prediction(_residual(fit, predictions, survey, settings)),
        cross_validation=None if crossed is None else prediction(crossed),
        repeatability=_repeatability(fit),
        torque_gain=_torque_gain(fit, settings.payload_mass),
    )


def _torque_gain(fit: Fit, known: float | None) -> Estimate | None:
    """What the logs' torques have to be multiplied by, where the payload's mass is known, in kg.

    All that has N m in its unit, m_p too, grows with a common gain of both torques; lengths do not.
    """
    if known is None or "m_p" not in fit.names:
        return None
    place = fit.names.index("m_p")
    mass, std = float(fit.values[place]), float(fit.std[place])
    if not np.isfinite(std) or mass <= fit.quantile * std:
        return estimate(np.nan, np.inf, (-np.inf, np.inf), "1", "NOT_IDENTIFIABLE")
    low, high = known / (mass + fit.quantile * std), known / (mass - fit.quantile * std)
    return estimate(known / mass, known / mass * std / mass, (low, high), "1", fit.status[place])


def _repeatability(fit: Fit) -> results.Repeatability | None:
    found = repeatability(fit)
    if found is None:
        return None
    return results.Repeatability(masses=found.masses.tolist(), std=found.std, ci95=found.ci95)


def _endogeneity(fit: Fit) -> dict[str, results.Endogeneity]:
    if fit.endogeneity is None:
        return {}
    # as many coefficients were looked at as a log has (Bonferroni)
    p_value = min(1.0, len(fit.shared.log_names) * math.erfc(fit.endogeneity / math.sqrt(2)))
    endogenous = fit.endogeneity > ENDOGENEOUS
    return {"largest": results.Endogeneity(statistic=fit.endogeneity, p_value=p_value, endogenous=endogenous)}


def _own(fit: Fit, own: OwnEstimate) -> dict[str, Estimate]:
    """A log's own estimates by name; those of a loaded log hold its payload's share."""
    found = {}
    for name, value, std in zip(fit.shared.log_names, own.values, own.std, strict=True):
        status = "OK" if np.isfinite(std) else "NOT_IDENTIFIABLE"
        half = fit.quantile * std
        found[name] = estimate(value, std, (value - half, value + half), UNITS[name], status)
    return found


def _model(chosen: Selection) -> results.TorqueModel:
    return results.TorqueModel(
        terms=list(chosen.model.terms),
        coulomb_speed=chosen.model.coulomb_speed,
        stribeck_speed=chosen.model.stribeck_speed,
        chosen_by=chosen.chosen_by,
        held_out=chosen.held_out,
    )


def _terms(fit: Fit, chosen: Selection) -> list[results.TermCriterion]:
    """What the logs said of each term they chose from, or of those that were given."""
    if chosen.trials:
        return [
            results.TermCriterion(
                term=trial.term,
                kept=trial.kept,
                gain_heldout=finite(trial.prediction),
                evidence=0.5 * trial.evidence,  # a Wald statistic is twice a difference of log-likelihoods
                why=trial.reason,
            )
            for trial in chosen.trials
        ]
    return [results.TermCriterion(term=w.term, delta_bic=w.delta_bic, kept=w.earned) for w in term_worths(fit)]


def _open_covariance(fit: Fit) -> FloatArray:
    """The covariance, infinite where a parameter is not identifiable."""
    covariance = fit.covariance.copy()
    unknown = np.isinf(fit.std)
    covariance[unknown, :] = np.inf
    covariance[:, unknown] = np.inf
    return covariance


def _noise(fit: Fit) -> dict[str, float]:
    if not fit.noise:
        return {}
    theta = np.sqrt(np.mean([level.theta**2 for level in fit.noise], axis=0))
    tau = np.sqrt(np.mean([level.tau**2 for level in fit.noise], axis=0))
    names = ("theta1", "theta2", "tau1", "tau2")
    return {name: float(value) for name, value in zip(names, (*theta, *tau), strict=True)}


def _whiteness(fit: Fit) -> dict[str, results.WhitenessTest]:
    if fit.whiteness is None:
        return {}
    return {
        f"tau{joint + 1}": results.WhitenessTest(
            white=fit.whiteness.joint_white[joint],
            p_value=finite(float(fit.whiteness.p_value[joint])),
            lag1_correlation=float(fit.whiteness.lag1[joint]),
        )
        for joint in range(2)
    }


def _residual(fit: Fit, predictions: Predictions, survey: Survey, settings: Settings) -> PredictionScore:
    total = PredictionScore()
    for log in survey.logs:
        c = torque_coefficients(fit, log.role)
        if log in predictions:
            total += predictions[log].score(c)
        else:
            total += score(fit.shared.model, c, survey.segments(log), torque_shift(settings, fit))
    return total


def prediction(found: PredictionScore) -> results.TorquePrediction | None:
    """As the result holds it; None where every log was too short to judge."""
    if found.count == 0:
        return None
    rmse, nrmse, r2 = ([float(value) for value in pair] for pair in (found.rmse, found.nrmse, found.r2))
    return results.TorquePrediction(
        rmse=(rmse[0], rmse[1]), nrmse=(nrmse[0], nrmse[1]), r2=(r2[0], r2[1]), filter=str(PredictionFilter())
    )


EXCHANGED = "the payload's mass is negative by far: the loaded and the unloaded logs are exchanged"


def _exchanged(fit: Fit) -> bool:
    """Whether the unloaded arm bears more than the loaded one, and by far."""
    return any(b.bound == "m_p >= 0" and b.distance is not None and b.distance > FAR_APART for b in broken_bounds(fit))


def _unlike_lengths(fit: Fit) -> Iterator[str]:
    """Where l1 = g k1 / k2 is not the length that was given."""
    known, found = fit.shared.lengths.get("l1"), length_by_constants(fit)
    if known is None or found is None:
        return
    length, std = found
    if abs(length - known) > FAR_APART * std:
        text = f"g k1 / k2 makes l1 {length:.4g} ± {fit.quantile * std:.2g} m, given are {known:g} m: gravity is"
        why = "compensated in part, or a zero, a sign or a term of the torque is wrong"
        yield Notice("LENGTH_MISMATCH", f"LENGTH_MISMATCH: {text} {why}").text


def _payload_near_zero(fit: Fit) -> Iterator[str]:
    """What is known of a payload that is not told from none."""
    if "m_p" not in fit.names:
        return
    place = fit.names.index("m_p")
    mass, std = float(fit.values[place]), float(fit.std[place])
    if np.isfinite(std) and abs(mass) < fit.quantile * std:
        yield f"the payload is not told from zero: at most {max(mass + ONE_SIDED * std, 0.0):.3g} kg at 95 %"
    elif np.isinf(std) and not fit.shared.lengths:
        yield "without link lengths a payload near zero is not determined: give --l1 and --l2"


def fit_warnings(fit: Fit) -> Iterator[str]:
    """What a user should know about a fit."""
    if fit.note:
        yield f"{fit.note}; {ONE_RUN}" if fit.intervals == "sandwich" else fit.note
    if not fit.converged and not (fit.note or "").startswith("--constrain"):
        yield "the refined estimator did not converge; the weak estimate is reported instead"
    yield from fit.unidentifiable
    if fit.shared.model.gravity == 0:
        yield "without gravity k2 and k4 have no effect and the payload has no weight: give --l1 or --l2 to tell it"
    if fit.endogeneity is not None and fit.endogeneity > ENDOGENEOUS and fit.estimator != "instruments":
        yield (
            f"instruments and least squares are {fit.endogeneity:.1f} standard deviations apart: torque that the model "
            "lacks drives the motion, and least squares takes the constants too small; compare --estimator instruments"
        )
    yield from _payload_near_zero(fit)
    for bound in broken_bounds(fit):
        distance = "" if bound.distance is None else f", {bound.distance:.1f} standard deviations beyond"
        yield f"the estimates break {bound.bound}: {bound.value:.4g}{distance}"
    yield from _unlike_lengths(fit)
    if _exchanged(fit):
        yield Notice("EXCHANGED_LOGS", f"EXCHANGED_LOGS: {EXCHANGED}").text
    apart = payload_distance(fit)
    if apart is not None and apart > FAR_APART:
        yield f"the loaded and the unloaded logs are {apart:.1f} standard deviations from belonging to one arm"
