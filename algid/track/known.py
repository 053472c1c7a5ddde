"""The arm that a result describes, for tracking what it carries."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.identify.noise import first_guess
from algid.identify.whitening import NoiseLevels
from algid.pipeline.settings import Settings
from algid.pipeline.statistical import model_of, prior_of
from algid.results import Result
from algid.sampling import Segment
from algid.track.cells import Arm


def arm_of(result: Result, first: Segment, l1: float | None = None, l2: float | None = None) -> tuple[Arm, FloatArray]:
    """The arm of a result with link lengths from it or given, and the covariance (q + 2, q + 2) of both.

    Noise levels are the result's; where it has none, the log's first stretch tells them.

    Raises
    ------
    ResultError
        If the result leaves a constant or a link length open.
    """
    if result.fit is None:
        raise ResultError(
            f"{result.log.path}: the result of --estimator {result.estimator} has no error bars; "
            "identify with --estimator refined or weak"
        )
    told = {name: result.settings.get(name) for name in ("friction", "torque_offset", "rotor_inertia", "gravity")}
    settings = Settings(**{name: value for name, value in told.items() if value is not None})
    prior = prior_of(result, settings)
    names = [*prior.names, *(n for n, given in (("l1", l1), ("l2", l2)) if given is None and _free(result, n))]
    places = [result.fit.covariance_names.index(name) for name in names]
    rows = [(*prior.names, "l1", "l2").index(name) for name in names]
    covariance = np.zeros((len(prior.names) + 2,) * 2)
    covariance[np.ix_(rows, rows)] = np.array(result.fit.covariance, dtype=np.float64)[np.ix_(places, places)]
    known = Arm(
        model_of(settings),
        prior.mean,
        _length(result, "l1", l1),
        _length(result, "l2", l2),
        _noise(result, first),
        _shift(result, first.dt),
    )
    return known, covariance


def _length(result: Result, name: str, given: float | None) -> float:
    known = [given, result.settings.get(name), result.payload[name].estimate if name in result.payload else None]
    found = next((value for value in known if value is not None), None)
    if found is None:
        raise ResultError(f"{result.log.path}: its result has no {name}; give the link's length with --{name}")
    return float(found)


def _free(result: Result, name: str) -> bool:
    return result.fit is not None and name in result.fit.covariance_names


def _noise(result: Result, first: Segment) -> NoiseLevels:
    noise = {} if result.fit is None else result.fit.noise
    if not all(noise.get(name, 0) > 0 for name in ("theta1", "theta2", "tau1", "tau2")):
        return first_guess(first.theta, first.tau)
    return NoiseLevels(np.array([noise["theta1"], noise["theta2"]]), np.array([noise["tau1"], noise["tau2"]]))


def _shift(result: Result, dt: float) -> float:
    """After how long a logged torque acts: the hold's half sample and the delay, in s."""
    delay = result.settings.get("delay") or 0.0
    if delay == "estimate":
        found = result.parameters.get("delay")
        delay = 0.0 if found is None or found.estimate is None else found.estimate
    return float(delay) + (0.5 * dt if result.settings.get("torque_hold") == "zoh" else 0.0)
