"""An estimator's outcome for a result: estimates, intervals, Table 4, diagnostics, warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np

from algid import results
from algid.arm import CONSTANT_NAMES, FloatArray
from algid.estimators.diagnostics import FAR_BEYOND, broken_bounds, repeatability, term_worths
from algid.estimators.fit import Fit, own_estimates
from algid.estimators.parametrisation import PAYLOAD_PARAMETERS
from algid.estimators.prediction import (
    PredictionScore,
    cross_validate,
    score,
)
from algid.estimators.selection import Selection
from algid.identification.by_likelihood import Predictions
from algid.identification.predicted import prediction
from algid.identification.remarks import fit_notes, fit_warnings
from algid.identification.series import torque_coefficients, torque_shift
from algid.identification.survey import Survey
from algid.model import DELAYS, K3, K5, UNITS
from algid.notices import Notice
from algid.physics.effort import absent
from algid.results import Estimate, Status
from algid.settings import Settings
from algid.significance import LEVEL, chance
from algid.table4 import LOADED_ROWS, UNLOADED_ROWS, finite
from algid.table4 import UNITS as TABLE_UNITS

NEVER_ZERO = (K3, K5, "l1", "l2")
"""Inertias and lengths: any other parameter of an arm may be zero."""


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


def outcome_of(
    fit: Fit, predictions: Predictions, survey: Survey, settings: Settings, chosen: Selection
) -> Identified:
    """The fit as a result holds it."""
    # a constant that the model has no column for is not identifiable
    estimates = {name: unknown(UNITS[name]) for name in CONSTANT_NAMES}
    estimates |= _estimates(fit.names, fit.values, fit.std, fit.quantile, fit.status)
    estimates = with_significance(estimates)
    gone = {*fit.absent, *absent(settings.effort, CONSTANT_NAMES)}
    estimates = {name: one for name, one in estimates.items() if name not in gone}
    payload = {name: estimates.pop(name) for name in PAYLOAD_PARAMETERS if name in estimates}
    rows, stds = table_rows(fit)
    held = [name for name in LOADED_ROWS if not gone & set(_LOADED[name])]
    combined = {name: unknown(TABLE_UNITS[name]) for name in held if survey.loaded}
    for name in combined.keys() & rows.keys():
        status = "OK" if fit.converged else "NOT_CONVERGED"
        combined[name] = estimate(
            rows[name], stds[name], fit.quantile * stds[name], TABLE_UNITS[name], status
        )
    summary = fit_summary(fit, predictions, survey, settings, chosen)
    if is_implausible(summary):
        estimates, combined, payload = (
            distrusted(group) for group in (estimates, combined, payload)
        )
    notices = [*fit_warnings(fit)]
    if settings.cross_validate and summary.cross_validation is None:
        notices.append(Notice("NO_CROSS_VALIDATION"))
    return Identified(
        parameters=estimates,
        loaded=combined,
        payload=payload,
        rows=rows,
        estimator=fit.estimator,
        stds=stds,
        fit=summary,
        notices=[*notices, *fit_notes(summary)],
    )


def is_implausible(summary: results.FitSummary) -> bool:
    """Whether physics or the torque contradict a fit.

    Its estimates come from one solution: where one of them breaks a bound by more than chance
    explains, or a joint's torque is predicted worse than its mean would, none can be trusted. A
    torque that hardly varies leaves R² nothing to explain, nor does a joint that is hardly driven;
    there the residual has to be a tenth of what acts on the joint at least.
    """
    if any(
        bound.distance_sigma is not None and bound.distance_sigma > FAR_BEYOND
        for bound in summary.broken_bounds
    ):
        return True
    judged = summary.cross_validation or summary.residual
    return judged is not None and bool(judged.unexplained(least=0.0))


def distrusted(group: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """The estimates with no status OK left."""
    return {
        name: one.model_copy(update={"status": Status.IMPLAUSIBLE}) if one.usable else one
        for name, one in group.items()
    }


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
    statuses = statuses or ["OK" if np.isfinite(std) else "NOT_IDENTIFIABLE" for std in stds]
    return {
        name: estimate(value, std, quantile * std, UNITS[name], status)
        for name, value, std, status in zip(names, values, stds, statuses, strict=True)
    }


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
    """The estimates; those whose interval holds zero and that may be zero are not significant.

    An inertia or a length is never zero.
    """
    return {
        name: one.model_copy(update={"status": Status.NOT_SIGNIFICANT})
        if one.status is Status.OK and name not in NEVER_ZERO and _holds_zero(one)
        else one
        for name, one in group.items()
    }


def _holds_zero(found: Estimate) -> bool:
    low, high = found.ci95 or (None, None)
    return low is not None and high is not None and low <= 0 <= high


def unknown(unit: str) -> Estimate:
    """An estimate that the logs do not determine, its interval unbounded."""
    return Estimate(
        estimate=None, std=None, ci95=(None, None), unit=unit, status=Status.NOT_IDENTIFIABLE
    )


# of which constants each row of Table 4 is the sum; loaded ones hold the payload's share
_ROWS, _LOADED = (
    {row: [name for name in row.split("+") if name in CONSTANT_NAMES] for row in rows}
    for rows in (UNLOADED_ROWS, LOADED_ROWS)
)


def table_rows(fit: Fit) -> tuple[dict[str, float], dict[str, float]]:
    """Table 4's rows and their standard deviations.

    None of a parameter that is not identifiable.
    """
    rows: dict[str, float] = {}
    stds: dict[str, float] = {}
    lost = {
        name
        for name, status in zip(fit.names, fit.status, strict=True)
        if status == "NOT_IDENTIFIABLE"
    }
    for loaded in (False, True) if fit.shared.payload else (False,):
        jacobian = fit.shared.jacobian(fit.values, loaded)
        coefficients = fit.shared.coefficients(fit.values, loaded)
        for name, constants in (_LOADED if loaded else _ROWS).items():
            if set(constants) & set(fit.absent):
                continue
            weight = np.array([float(one in constants) for one in fit.shared.log_names])
            spread = fit.spread(weight @ jacobian) if weight.sum() == len(constants) else np.inf
            if np.isfinite(spread) and name not in lost:
                rows[name], stds[name] = float(weight @ coefficients), spread
    if fit.shared.payload and np.isfinite(fit.std[fit.names.index("m_p")]):
        rows["m_p"] = float(fit.values[fit.names.index("m_p")])
        stds["m_p"] = float(fit.std[fit.names.index("m_p")])
    return rows, stds


def fit_summary(
    fit: Fit, predictions: Predictions, survey: Survey, settings: Settings, chosen: Selection
) -> results.FitSummary:
    """The statistical part of a result."""
    residual, crossed = _predicted(fit, predictions, survey, settings)
    lost, tests, repeated = np.isinf(fit.std), fit.whiteness, repeatability(fit)
    there = [place for place, name in enumerate(fit.names) if name not in fit.absent]
    noise, endogeneity = {}, {}
    if fit.noise:
        levels = np.sqrt(np.mean(np.square([[*one.theta, *one.tau] for one in fit.noise]), axis=0))
        noise = dict(zip(("theta1", "theta2", "tau1", "tau2"), levels.tolist(), strict=True))
    if fit.endogeneity is not None:
        # as many coefficients were looked at as a log has (Bonferroni)
        p_value = chance(fit.endogeneity, len(fit.shared.log_names))
        endogeneity["largest"] = results.Endogeneity(
            statistic=fit.endogeneity, p_value=p_value, endogenous=p_value < LEVEL
        )
    return results.FitSummary(
        noise=noise,
        covariance_names=[fit.names[place] for place in there],
        covariance=[
            [finite(value) for value in row]
            for row in np.where(lost | lost[:, None], np.inf, fit.covariance)[np.ix_(there, there)]
        ],
        intervals=fit.intervals,
        iterations=fit.iterations,
        converged=fit.converged,
        whiteness={
            f"tau{joint + 1}": results.WhitenessTest(
                white=tests.joint_white[joint],
                p_value=finite(float(tests.p_value[joint])),
                lag1_correlation=float(tests.lag1[joint]),
            )
            for joint in range(2)
            if tests is not None
        },
        unidentifiable=[one.text for one in fit.unidentifiable],
        model=results.TorqueModel(
            terms=list(chosen.model.terms),
            coulomb_speed=chosen.model.coulomb_speed,
            stribeck_speed=chosen.model.stribeck_speed,
            chosen_by=chosen.chosen_by,
            held_out=chosen.held_out,
            shrunk=_expected(fit, chosen),
        ),
        terms=_terms(fit, chosen),
        torque_hold=_torque_hold(chosen),
        broken_bounds=[
            results.Bound(
                bound=b.bound,
                value=b.value,
                distance_sigma=None if fit.beyond_errors else b.distance,
            )
            for b in broken_bounds(fit)
            if b.distance is None or b.distance > fit.quantile  # else its 95 % interval keeps it
        ],
        endogeneity=endogeneity,
        by_log=[
            _estimates(fit.shared.log_names, own.values, own.std, fit.quantile)
            for own in own_estimates(fit)
        ],
        residual=prediction(residual),
        cross_validation=None if crossed is None else prediction(crossed),
        repeatability=None
        if repeated is None
        else results.Repeatability(
            masses=repeated.masses.tolist(), std=repeated.std, ci95=repeated.ci95
        ),
        torque_gain=_torque_gain(fit, settings.payload_mass),
    )


def _predicted(
    fit: Fit, predictions: Predictions, survey: Survey, settings: Settings
) -> tuple[PredictionScore, PredictionScore | None]:
    """How well the fit predicts its own logs and, if asked and possible, each from the others."""
    own = PredictionScore()
    for log in survey.logs:
        c = torque_coefficients(fit, log.role)
        if log in predictions:
            own += predictions[log].score(c)
        else:
            own += score(fit.shared.model, c, survey.segments(log), torque_shift(settings, fit))
    if not settings.cross_validate:
        return own, None
    unloaded, loaded = (
        [partial(survey.segments, log) for log in kind] for kind in (survey.unloaded, survey.loaded)
    )
    return own, cross_validate(fit, unloaded, loaded, settings.torque_shift())


def _expected(fit: Fit, chosen: Selection) -> list[str]:
    """Coefficients of terms that were not chosen: each is what the logs and a prior agree on."""
    if fit.shrinkage is not None:
        return list(fit.shrinkage.names)
    return [name for name in DELAYS if name in fit.names and chosen.undecided is not None]


def _torque_hold(chosen: Selection) -> results.TorqueHold:
    """What was asked of the torque's hold, what was used, and what the logs tell."""
    late = chosen.late if chosen.hold_by == "logs" else None
    asked: Literal["auto", "foh", "zoh"] = chosen.hold if chosen.hold_by == "settings" else "auto"
    if late is None:
        return results.TorqueHold(asked=asked, used=chosen.hold)
    return results.TorqueHold(
        asked=asked,
        used=chosen.hold,
        told=late.decided,
        half=late.half,
        late=late.late,
        late_std=finite(late.std),
        odds=finite(late.odds),
        share=finite(late.share),
    )


def _terms(fit: Fit, chosen: Selection) -> list[results.TermCriterion]:
    """What the logs said of each term they chose from, or of those that were given."""
    if not chosen.trials:
        return [
            results.TermCriterion(term=w.term, delta_bic=w.delta_bic, kept=w.earned)
            for w in term_worths(fit)
        ]
    return [
        results.TermCriterion(
            term=trial.term,
            kept=trial.kept,
            gain_heldout=finite(trial.prediction),
            # a Wald statistic is twice a difference of log-likelihoods
            evidence=finite(0.5 * trial.evidence),
            why=trial.reason,
        )
        for trial in chosen.trials
    ]


def _torque_gain(fit: Fit, known: float | None) -> Estimate | None:
    """What the logs' torques have to be multiplied by, where the payload's mass is known, in kg.

    All that has N m in its unit, m_p too, grows with a common gain of both torques; lengths do not.
    """
    if known is None or "m_p" not in fit.names:
        return None
    place = fit.names.index("m_p")
    mass, std = float(fit.values[place]), float(fit.std[place])
    half = fit.quantile * std
    if not np.isfinite(std) or mass <= half:
        return unknown("1")
    gain = estimate(known / mass, known / mass * std / mass, 0.0, "1", fit.status[place])
    return gain.model_copy(update={"ci95": (known / (mass + half), known / (mass - half))})
