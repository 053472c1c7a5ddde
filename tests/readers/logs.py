"""Logs for the tests of readers and writers."""

from __future__ import annotations

import numpy as np

from algid.arm import Arm, FloatArray
from algid.log import Log, Origin, Truth

TRUTH = Truth(Arm(6, 3, 0.15, 0.1, 0.3, 0.2, 0.1, 0.02, 1.5, 0.3), 0.5, "case1")
EPOCH_NS = 1_700_000_000_123_456_789


def noise_log(rows: int = 500, *, start_ns: int = 0, velocity: bool = True, seed: int = 0) -> Log:
    """A log of noise, 1 kHz with jitter: every bit of every value matters."""
    draw = np.random.default_rng(seed)
    stamps = start_ns + np.arange(rows) * 1_000_000 + draw.integers(0, 1000, rows)
    values = draw.normal(size=(3, 2, rows)) * 10.0 ** draw.integers(-8, 3, size=(3, 2, rows))
    return Log(stamps, values[0], values[1], Origin("", "", {}), values[2] if velocity else None)


def same(one: Log, other: Log) -> bool:
    """Whether two logs agree in every bit."""
    return (
        np.array_equal(one.stamp_ns, other.stamp_ns)
        and _bits(one.theta, other.theta)
        and _bits(one.tau, other.tau)
        and (one.omega is None) == (other.omega is None)
        and (one.omega is None or other.omega is None or _bits(one.omega, other.omega))
    )


def _bits(one: FloatArray, other: FloatArray) -> bool:
    return one.shape == other.shape and one.tobytes() == other.tobytes()
