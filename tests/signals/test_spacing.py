"""Samples nearly on top of one another: late ones go back to their period, repeated ones count
once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.log import Log, Origin, join
from algid.signals.spacing import spaced

PERIOD = 1e-3
ROWS = 4000
RANDOM = np.random.default_rng(8)


def moving(t: FloatArray) -> FloatArray:
    """Angles (2, N) in closed form: up to 6 rad/s, so that a sample one period late is 6e-3 rad
    off.
    """
    return np.stack([2 * np.sin(3 * t), np.cos(2 * t)])


def log_of(t: FloatArray, stamps: FloatArray) -> Log:
    """The motion at times `t` (N,) in s, recorded with other stamps."""
    stamp_ns = np.rint(stamps * 1e9).astype(np.int64)
    assert np.all(np.diff(stamp_ns) > 0)
    return Log(stamp_ns, moving(t), 5 * moving(t + 1), Origin("log", "test", {}))


def regular() -> FloatArray:
    return np.arange(ROWS) * PERIOD


def some(count: int) -> FloatArray:
    """Places that are no neighbours."""
    return np.sort(RANDOM.choice(np.arange(10, ROWS - 20, 20), count, replace=False))


def late_pairs() -> tuple[FloatArray, FloatArray]:
    t, stamps, places = regular(), regular(), some(100)
    stamps[places] = t[places + 1] - 2e-6
    return t, stamps


def bursts() -> tuple[FloatArray, FloatArray]:
    t, stamps = regular(), regular()
    for place in some(60):
        size = int(RANDOM.integers(3, 15))
        stamps[place : place + size] = t[place + size] - 2e-6 * np.arange(size, 0, -1)
    return t, stamps


def batches() -> tuple[FloatArray, FloatArray]:
    t, stamps = regular(), regular()
    for place in range(0, ROWS, 10):
        stamps[place : place + 10] = t[place + 9] + 2e-6 * np.arange(10)
    return t, stamps


def repeated() -> tuple[FloatArray, FloatArray]:
    t = np.sort(np.concatenate([regular(), regular()[some(100)] + 2e-6]))
    return t, t


def half_a_period() -> tuple[FloatArray, FloatArray]:
    t = regular()
    t[1:-1] += RANDOM.uniform(-0.5, 0.5, ROWS - 2) * PERIOD
    t = np.unique(np.rint(t * 1e9)) * 1e-9
    return t, t


KINDS: list[Callable[[], tuple[FloatArray, FloatArray]]] = [
    late_pairs,
    bursts,
    batches,
    repeated,
    half_a_period,
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rows", [1, 7, 1000])
def test_blocks_make_no_difference(
    kind: Callable[[], tuple[FloatArray, FloatArray]], rows: int
) -> None:
    log = log_of(*kind())
    whole = join(spaced([log], PERIOD))
    parts = join(
        spaced([log.part(first, first + rows) for first in range(0, len(log), rows)], PERIOD)
    )
    assert parts.stamp_ns.tolist() == whole.stamp_ns.tolist()
    assert np.array_equal(parts.theta, whole.theta)
    assert np.array_equal(parts.tau, whole.tau)
