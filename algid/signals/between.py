"""The torque between the samples of a log, at the stages of an integrator's steps.

======  ====================================================  ===========  ======
symbol  name                                                  shape        unit
======  ====================================================  ===========  ======
tau     torque at the samples                                 (2, N)       N m
u       torque at three stages of every step of an interval   (m, 3, 2, n)  N m
w       weights of the samples from `first` on                (m, 3, K)    1
======  ====================================================  ===========  ======

An interval goes from a sample to the next. A torque that is held has jumps, on which no step need
end: a step sees its mean over the step. One that moves evenly lies on the polynomial through the
samples around, which follows it up to two thirds of half the sampling rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, floor

import numpy as np

from algid.arm import FloatArray

KNOTS = 12
"""Samples around an interval on which the polynomial of an even torque lies."""
_WHOLE = 1e-9  # of a sample: a shift this near to whole samples is whole


@dataclass(frozen=True, eq=False)
class Between:
    """Weights (m, 3, K) of the samples from `first` on, counted from that an interval begins at."""

    weights: FloatArray
    first: int

    @property
    def count(self) -> int:
        """Samples that an interval's torque rests on."""
        return int(self.weights.shape[-1])

    def at_stages(self, tau: FloatArray, low: int, n: int) -> FloatArray:
        """U (m, 3, 2, n) within the n intervals from sample `low` on; ends of `tau` go on."""
        before = max(0, -low - self.first)
        after = max(0, low + n + self.first + self.count - 1 - tau.shape[1])
        padded = np.pad(tau, ((0, 0), (before, after)), "edge")
        start = low + self.first + before
        u = np.zeros((*self.weights.shape[:2], 2, n))
        for place in range(self.count):
            samples = padded[:, start + place : start + place + n]
            u += self.weights[:, :, place, None, None] * samples
        return u


@lru_cache(maxsize=64)
def between(late: float, steps: int, *, held: bool, points: int = KNOTS) -> Between:
    """Weights of the samples at the stages of the steps of an interval.

    Parameters
    ----------
    late : float
        How late a torque acts, in samples.
    steps : int
    held : bool
        Whether each torque is held until the next.
    points : int, even
        On how many samples the polynomial of an even torque lies; 2 are straight lines.
    """
    ends = np.arange(steps + 1) / steps - late
    if held:
        return _held(ends)
    return _even(ends, points)


def _held(ends: FloatArray) -> Between:
    first, steps = floor(ends[0] + _WHOLE), ends.size - 1
    count = ceil(ends[-1] - _WHOLE) - first
    from_sample = first + np.arange(count)
    begin = np.maximum(ends[:-1, None], from_sample)
    end = np.minimum(ends[1:, None], from_sample + 1)
    shares = np.maximum(0.0, end - begin) * steps
    return Between(np.repeat(shares[:, None, :], 3, axis=1), first)


def _even(ends: FloatArray, points: int) -> Between:
    at = np.stack([ends[:-1], 0.5 * (ends[:-1] + ends[1:]), ends[1:]], axis=1)
    lowest = floor(ends[0] + _WHOLE)
    highest = ceil(ends[-1] - _WHOLE) - 1
    first = lowest - points // 2 + 1
    weights = np.zeros((*at.shape, highest - lowest + points))
    for place in np.ndindex(at.shape):
        base = min(max(floor(at[place] + _WHOLE), lowest), highest)
        knots = np.arange(base - points // 2 + 1, base + points // 2 + 1)
        weights[place][knots - first] = _lagrange(float(at[place]), knots)
    return Between(weights, first)


def _lagrange(at: float, knots: FloatArray) -> FloatArray:
    """Weights of the values at `knots` in their polynomial's value `at` a place."""
    weights = np.ones(knots.size)
    for place, knot in enumerate(knots):
        others = np.delete(knots, place)
        weights[place] = np.prod((at - others) / (knot - others))
    return weights
