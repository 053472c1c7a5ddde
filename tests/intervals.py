"""What tells intervals of 95 % from those of 90 %: exact binomial bounds, and enough draws."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.stats import binom

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.results import Result

# half width of a normal interval of 90 % over one of 95 %
AS_90 = 1.6448536269514722 / 1.959963984540054
CHANCE = 1e-3  # that right intervals fail, one side and the other together


def holds_95(ratios: FloatArray) -> None:
    """Fail unless independent errors over the half widths of their intervals, `ratios`, are those
    of 95 % intervals.

    As many as 95 % of them have to lie within ±1, by the binomial distribution; and had the
    intervals been of 90 %, the same draws would fail: a test that could not tell them apart fails
    too.
    """
    size = np.abs(np.ravel(ratios))
    low, high = binom.interval(1 - CHANCE, size.size, 0.95)
    inside, narrower = int(np.sum(size <= 1)), int(np.sum(size <= AS_90))
    assert low <= inside <= high, f"{inside} of {size.size} within, {low:g} to {high:g} expected"
    assert narrower < low, (
        f"{narrower} of {size.size} within intervals of 90 %, of {low:g} at least: too few draws"
    )


def holds_at_least_95(ratios: FloatArray) -> None:
    """Fail unless errors over half widths are those of 95 % intervals or of wider ones.

    For intervals that are wider by design, where noise is assumed that the simulation does not
    have.
    """
    size = np.abs(np.ravel(ratios))
    low, _ = binom.interval(1 - CHANCE, size.size, 0.95)
    inside = int(np.sum(size <= 1))
    assert inside >= low, f"{inside} of {size.size} within, {low:g} at least expected"


def in_axes(error: FloatArray, covariance: FloatArray, quantile: float) -> FloatArray:
    """Errors (Q,) over half widths along the covariance's own axes (Q,), where they are
    independent.
    """
    return np.linalg.solve(np.linalg.cholesky(covariance), error) / quantile


def distances(
    result: Result, true: Iterable[float], names: Sequence[str] = CONSTANT_NAMES
) -> FloatArray:
    """Errors (n,) of a result's estimates in their standard deviations."""
    found = [result.estimates[name] for name in names]
    values, stds = np.array([(one.estimate, one.std) for one in found], dtype=np.float64).T
    return np.asarray((values - list(true)) / stds)


def holding(result: Result, true: Iterable[float]) -> int:
    """How many intervals of k1 … k7 hold the truth."""
    ends = [result.parameters[name].ci95 or (None, None) for name in CONSTANT_NAMES]
    low, high = np.array(ends, dtype=np.float64).T
    k = np.array(list(true))
    return int(np.sum((low <= k) & (k <= high)))
