"""From the numbers of a time column to int64 nanoseconds.

float64 seconds since 1970 resolve 0.24 µs, so whole and fractional seconds are converted apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.log import IntArray

NANOSECONDS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""Nanoseconds in one unit of time."""
_EPOCH = (("s", 1e8, 1e11), ("ms", 1e11, 1e14), ("us", 1e14, 1e17), ("ns", 1e17, 1e20))
_LARGEST = 9.2e18
_STEPS = (("s", 0.2), ("ms", 50.0), ("us", 50_000.0))
SLOWEST_NS = 200_000_000
"""A longer median step is no recording of an arm in motion: it has 5 Hz at least."""


def time_unit(times: NDArray[Any]) -> str:
    """The unit of a time column (N,) nobody named one for: "s", "ms", "us" or "ns".

    Times since 1970 tell by their size. Times since the start of a log tell by their median step, for logs
    between 20 Hz and 20 kHz: below 0.2 it is seconds, below 50 ms, below 50,000 µs, else ns.
    """
    first = abs(float(times[0]))
    for unit, low, high in _EPOCH:
        if low <= first < high and _plausible(times, NANOSECONDS[unit]):
            return unit
    return unit_of_step(median_step(times))


def unit_of_step(step: float) -> str:
    """The unit in which a median step is one of a log: see `time_unit`."""
    return next((unit for unit, longest in _STEPS if step < longest), "ns")


def median_step(times: NDArray[Any]) -> float:
    """Median size of the steps between times (N,) that differ; 0 where none do."""
    steps = np.abs(np.diff(times.astype(np.float64)))
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def _plausible(times: NDArray[Any], nanoseconds: int) -> bool:
    """Whether the median step is between 20 µs and 10 s in a unit of so many nanoseconds, if there is one."""
    step = median_step(times)
    return step == 0 or 2e4 <= step * nanoseconds <= 1e10


def to_nanoseconds(times: NDArray[Any], unit: str) -> IntArray:
    """Times (N,) in `unit` as int64 ns, to the nearest; integers stay exact.

    Raises
    ------
    ValueError
        If a time is not finite, or out of the 292 years that int64 nanoseconds span.
    """
    factor = NANOSECONDS[unit]
    if np.issubdtype(times.dtype, np.integer):
        if times.size and max(abs(int(times.min())), abs(int(times.max()))) * factor > _LARGEST:
            raise ValueError("a time beyond 292 years")
        whole_ns = times.astype(np.int64, copy=False)
        return whole_ns * factor if factor != 1 else whole_ns
    if not np.all(np.isfinite(times)):
        raise ValueError("a time that is not finite")
    if times.size and float(np.abs(times).max()) * factor > _LARGEST:
        raise ValueError("a time beyond 292 years")
    whole = np.floor(times)
    fraction = np.rint((times - whole) * factor)
    return whole.astype(np.int64) * factor + fraction.astype(np.int64)
