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
_STEPS = (np.log(2.0), 0.5 * np.log(2.0))
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
    seen: dict[float, tuple[float, FloatArray]] = {}

    def at(x: float) -> float:
        if x not in seen:
            seen[x] = profile(float(np.exp(x)))
        return seen[x][0]

    x = float(np.clip(np.log(start), low, high))
    for step in _STEPS:
        while True:
            beside = [one for one in (x - step, x + step) if low <= one <= high]
            best = min(beside, key=at)
            if at(best) >= at(x):
                break
            x = best
    before, after = x - step, x + step
    if not low <= before < after <= high:
        return Width(float(np.exp(x)), np.zeros((seen[x][1].size,) * 2))
    curvature = (at(before) - 2 * at(x) + at(after)) / step**2
    slope = (at(after) - at(before)) / (2 * step)
    moved = float(np.clip(-slope / max(curvature, 1e-300), -step, step))
    change = (seen[after][1] - seen[before][1]) / (2 * step)
    variance = min(2.0 / max(curvature, 1e-300), (high - low) ** 2 / 12)
    return Width(float(np.exp(x + moved)), variance * np.outer(change, change))
