"""The width of dry friction's step, at which a likelihood is largest.

The deviance D (minus twice the log-likelihood, all other parameters at their best) is walked down
over x = log ω_s, by octaves and then by half octaves. A parabola through the three lowest values
has its bottom at the width, and by its curvature

    Var(x) = 2 / D″,   Cov(β) gains  Var(x) β′ β′ᵀ

with β′ the change of the best parameters with x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.model import TERMS, Model

Profile = Callable[[float], tuple[float, FloatArray]]
"""By a width in rad/s the deviance, and the best parameters (Q,)."""
NARROWEST, WIDEST = 0.004, 1.0
"""rad/s: no joint's friction turns in less, and none in more."""
_HALF_OCTAVE = 0.5 * np.log(2.0)
_SHAPE = "coulomb_speed"


@dataclass(frozen=True, eq=False)
class Width:
    """The width in rad/s, and what not knowing it adds to the parameters' covariance (Q, Q)."""

    value: float
    covariance: FloatArray


def has_width(model: Model) -> bool:
    """Whether a term of the model has friction's step."""
    return any(_SHAPE in TERMS[term].shapes for term in model.terms)


def likeliest_width(profile: Profile, start: float) -> Width:
    """The width at which the deviance is least, walking from `start`.

    Parameters
    ----------
    profile : callable
    start : float, rad/s
    """
    low, high = np.log(NARROWEST), np.log(WIDEST)
    first = float(np.clip(np.log(start), low, high))
    seen: dict[int, tuple[float, FloatArray]] = {}  # by half octaves from the first width

    def deviance(place: int) -> float:
        x = first + place * _HALF_OCTAVE
        if not low <= x <= high:
            return np.inf
        if place not in seen:
            seen[place] = profile(float(np.exp(x)))
        return seen[place][0] if np.isfinite(seen[place][0]) else np.inf

    place = 0
    for step in (2, 1):
        while deviance(best := min(place - step, place + step, key=deviance)) < deviance(place):
            place = best
    x, h = first + place * _HALF_OCTAVE, _HALF_OCTAVE
    below, here, above = (deviance(place + side) for side in (-1, 0, 1))
    if not np.isfinite([below, above]).all():
        return Width(float(np.exp(x)), np.zeros((seen[place][1].size,) * 2))
    slope, curvature = (above - below) / (2 * h), max((below - 2 * here + above) / h**2, 1e-300)
    change = (seen[place + 1][1] - seen[place - 1][1]) / (2 * h)
    variance = min(2.0 / curvature, (high - low) ** 2 / 12)
    bottom = x + float(np.clip(-slope / curvature, -h, h))
    return Width(float(np.exp(bottom)), variance * np.outer(change, change))
