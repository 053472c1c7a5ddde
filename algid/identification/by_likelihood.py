"""The weak and the refined estimator on logs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from algid.errors import LogError, ResultError
from algid.estimators import refined, weak
from algid.estimators.combine import Prior
from algid.estimators.diagnostics import constrained
from algid.estimators.fit import Fit
from algid.estimators.prediction import PredictionSums
from algid.identification.source import LogSource, Survey
from algid.identification.velocities import with_velocities
from algid.model import Model
from algid.results import Result
from algid.runtime import beside
from algid.settings import Settings
from algid.signals.segments import Segment

Pass = Callable[[], Iterable[Segment]]
Predictions = Mapping[LogSource, PredictionSums]
"""What scores a prediction of a log by any coefficients."""


def run_fit(survey: Survey, settings: Settings, prior: Prior | None) -> tuple[Fit, Predictions]:
    """Fit the settings' estimator to logs.

    Parameters
    ----------
    survey : Survey
        Of the logs; its `told` is told the refined estimator's steps too.
    settings : Settings
    prior : Prior
        What is known of the arm beforehand.

    Returns
    -------
    The fit, and the sums that score its prediction of each log, where a pass of the estimator could gather them.

    Raises
    ------
    LogError
        If no log is long enough.
    """
    sums: dict[LogSource, PredictionSums] = {}
    weak_settings = _weak_settings(settings)
    unloaded, loaded = (_passes(survey, logs, settings, sums) for logs in (survey.unloaded, survey.loaded))
    try:
        if settings.estimator == "weak":
            fit = weak.fit(unloaded, loaded, weak_settings, settings.lengths, prior)
        else:
            fit = refined.fit(unloaded, loaded, _refined_settings(settings, weak_settings, prior), survey.told)
    except ValueError as error:
        names = ", ".join(log.name for log in survey.logs)
        raise LogError(f"{names}: {error}; record longer") from error
    return constrained(fit) if settings.constrain else fit, sums


def model_of(settings: Settings) -> Model:
    """The columns that the settings switch on."""
    wanted = {
        "coulomb": settings.friction == "coulomb",
        "offset": settings.torque_offset,
        "rotor": settings.rotor_inertia,
    }
    return Model(tuple(term for term, asked in wanted.items() if asked), settings.gravity)


def _weak_settings(settings: Settings) -> weak.WeakSettings:
    own_velocities = settings.velocity == "measured" or settings.luenberger
    ours = weak.WeakSettings(
        model=model_of(settings),
        bandwidth=None if own_velocities else settings.bandwidth,
        hold=settings.torque_hold,
        delay=0.0 if settings.delay == "estimate" else settings.delay,
        estimate_delay=settings.delay == "estimate",
    )
    return ours if settings.window is None else replace(ours, window=settings.window)


def _refined_settings(
    settings: Settings, weak_settings: weak.WeakSettings, prior: Prior | None
) -> refined.RefinedSettings:
    return refined.RefinedSettings(
        model=weak_settings.model,
        hold=weak_settings.hold,
        delay=weak_settings.delay,
        estimate_delay=weak_settings.estimate_delay,
        lengths=settings.lengths,
        prior=prior,
        weak=weak_settings,
    )


def _passes(
    survey: Survey, logs: Sequence[LogSource], settings: Settings, sums: dict[LogSource, PredictionSums]
) -> list[Pass]:
    """A callable a log that gives a fresh pass, with velocities only where they are not observed on the way."""
    own = settings.velocity == "measured" or settings.luenberger
    passes: list[Pass] = [
        partial(with_velocities, survey, log, settings, luenberger=settings.luenberger)
        if own
        else partial(survey.segments, log)
        for log in logs
    ]
    model = model_of(settings)  # what the prediction is scored by depends on the estimate of some terms
    if settings.delay == "estimate" or not model.linear or "lag" in model.terms:
        return passes
    return [partial(_watched, log, moving, settings, sums) for log, moving in zip(logs, passes, strict=True)]


def _watched(
    log: LogSource, moving: Pass, settings: Settings, sums: dict[LogSource, PredictionSums]
) -> Iterator[Segment]:
    """A pass that also gathers, once, what the prediction will be scored by."""
    if log in sums:
        yield from moving()
        return
    gathered = PredictionSums(model_of(settings), settings.torque_shift)
    yield from beside(moving(), gathered.push)
    gathered.finish()
    sums[log] = gathered


def prior_of(result: Result, settings: Settings, file: str | None = None) -> Prior:
    """What an earlier result knows of the arm; where it is wrong, its `file` is named, or its log.

    Raises
    ------
    ResultError
        If its estimator gives no error bars, or it does not determine all constants of the model.
    """
    model, file = model_of(settings), file or result.log.path
    if result.fit is None:
        raise ResultError(
            f"{file}: the result of --estimator {result.estimator} has no error bars; "
            "identify with --estimator refined or weak, or use --estimator paper here too"
        )
    known = set(result.fit.covariance_names) & set(result.parameters)
    missing = [name for name in model.names if name not in known]
    if missing:
        raise ResultError(f"{file}: the result has no {', '.join(missing)}; use the flags it was made with")
    places = [result.fit.covariance_names.index(name) for name in model.names]
    covariance = np.array(result.fit.covariance, dtype=np.float64)[np.ix_(places, places)]
    mean = np.array([result.parameters[name].estimate for name in model.names], dtype=np.float64)
    if not (np.isfinite(covariance).all() and np.isfinite(mean).all()):
        raise ResultError(f"{file}: the result leaves constants undetermined; identify from more logs first")
    return Prior.of(model.names, mean, covariance)
