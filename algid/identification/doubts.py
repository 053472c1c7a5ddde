"""What is asked of a fit afterwards: its residual, what makes it doubtful."""

from __future__ import annotations

from dataclasses import replace

from algid.estimators import weak
from algid.estimators.diagnostics import FAR_BEYOND, broken_bounds, constrained
from algid.estimators.doubt import doubted, doubted_without_motor
from algid.estimators.fit import Fit
from algid.estimators.innovations import ResidualSums, pooled
from algid.estimators.prediction import PredictionScore, score
from algid.estimators.terms import Selection
from algid.identification.passes import problem_of
from algid.identification.predicted import prediction
from algid.identification.recordings import Recordings
from algid.identification.remarks import exchanged
from algid.identification.series import torque_coefficients, torque_shift
from algid.model import FIRST_TERMS, RIGID
from algid.notices import Notice
from algid.settings import Settings

MOST = 0.5
"""R² below which most of a torque is not the model's."""


def residual_of(
    survey: Recordings, settings: Settings, chosen: Selection, fit: Fit
) -> ResidualSums | None:
    """Residual sums of the estimator behind the fit: of its innovations, or of its windows.

    None where no log is long enough.
    """
    if fit.residual:
        return pooled(fit.residual)
    problem = problem_of(survey, settings, chosen)
    if fit.delay is not None:
        problem = problem.at(chosen.model, fit.delay)
    sums = []
    for loaded, sources in problem.kinds():
        c = torque_coefficients(fit, "loaded" if loaded else "unloaded")
        for source in sources:
            of_log = weak.residuals(source, problem.settings, c)
            if of_log is not None:
                sums.append(of_log)
    return pooled(sums)


def with_doubt(fit: Fit, survey: Recordings, settings: Settings, chosen: Selection) -> Fit:
    """The fit; where its likelihood is refuted, with what makes k1 … k5 doubtful: see `doubted`.

    Of an arm with a joint that has no motor, whether its equation determines them: see
    `doubted_without_motor`. One that physics contradicts stays as sure as it is, so that the
    contradiction is reported, as logs in each other's place are.
    """
    if any(log.origin.reading.passive for log in survey.logs):
        fit = doubted_without_motor(fit, problem_of(survey, settings, chosen))
    if not (fit.refuted and settings.chooses) or exchanged(fit):
        return fit
    far = []
    for broken in broken_bounds(fit):
        if broken.distance is not None and broken.distance > FAR_BEYOND:
            far.append(broken.bound)
    if any("BROKEN_BOUND" in log.origin.reading.accepted for log in survey.logs):
        return fit
    if far:
        lawful = constrained(fit)
        if not lawful.converged or _explains_little(lawful, survey, settings):
            return fit
        doubt = Notice("HARDLY_DRIVEN", numbers={"case": "bounds", "bounds": far})
        return fit.marked("WEAK_EXCITATION", RIGID).noted(doubt)
    common = replace(chosen, model=replace(chosen.model, terms=FIRST_TERMS))
    return doubted(fit, problem_of(survey, settings, common))


def _explains_little(fit: Fit, survey: Recordings, settings: Settings) -> bool:
    """Whether most of a joint's torque is not what the fit makes it."""
    total = PredictionScore()
    for log in survey.logs:
        c, shift = torque_coefficients(fit, log.role), torque_shift(settings, fit)
        total += score(fit.shared.model, c, survey.segments(log), shift)
    predicted = prediction(total)
    return predicted is not None and bool(predicted.unexplained(MOST))
