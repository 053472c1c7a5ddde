"""Medians, quantiles and distinct values, as `numpy.median`, `quantile` and `unique` give them.

Those ask for NumPy's masked arrays, whose import takes longer than all of these of a short log.
"""

from __future__ import annotations

from math import floor

import numpy as np
from numpy.typing import ArrayLike

from algid.arm import FloatArray


def median(values: ArrayLike) -> float:
    """The median of all values; NaN where one is NaN, or where there are none."""
    return float(medians(np.ravel(values)))


def medians(rows: ArrayLike) -> FloatArray:
    """The medians (...) over the last axis of values (..., n); NaN as for `median`."""
    rows = np.asarray(rows)
    n = rows.shape[-1]
    if n == 0:
        return np.full(rows.shape[:-1], np.nan)
    places = ((n - 1) // 2, n // 2, n - 1)
    ordered = np.partition(rows, sorted(set(places)), axis=-1)
    low, high, last = (ordered[..., place] for place in places)
    middle = np.asarray(low, dtype=np.float64) + np.asarray(high, dtype=np.float64)
    return np.where(np.isnan(last), np.nan, 0.5 * middle)  # NaN is sorted to the end


def quantile(values: ArrayLike, share: float) -> float:
    """The value below which a `share` of all values lies, on a line between two of them.

    NaN where one is NaN, or where there are none.
    """
    flat = np.ravel(values)
    if flat.size == 0:
        return float("nan")
    place = share * (flat.size - 1)
    below = min(floor(place), flat.size - 1)
    above = min(below + 1, flat.size - 1)
    ordered = np.partition(flat, sorted({below, above, flat.size - 1}))
    if np.isnan(ordered[-1]):
        return float("nan")
    low, high, part = float(ordered[below]), float(ordered[above]), place - below
    step = high - low
    return high - step * (1 - part) if part >= 0.5 else low + step * part


def distinct(values: FloatArray) -> FloatArray:
    """The values (N,) without repetition, the smallest first."""
    ordered = np.sort(values)
    return ordered[np.append(True, np.diff(ordered) != 0)[: ordered.size]]
