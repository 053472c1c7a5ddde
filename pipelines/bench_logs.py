"""The logs that `bench_processor` times: a periodic motion and the torque it takes, tiled.

The motion of 10 s is a sum of harmonics, so that its derivatives and, by eq. (1), its torque are
closed forms; each repetition gets torque noise of its own, and the encoder's steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from algid.arm import FloatArray, inverse_dynamics
from algid.log import Log, Origin
from algid.synth.cases import load_case
from algid.writers import write_log

RATE = 1000
PERIOD = 10.0  # s
START_NS = 1_700_000_000_000_000_000
ENCODER_STEP = 2 * np.pi / 2**20  # rad
TORQUE_STEP = 1e-3  # N m
TORQUE_NOISE = 0.01  # N m
_BLOCK = 25  # periods a block


def motion(seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles, velocities and accelerations (2, N) of one period: ten harmonics from 0.1 to 2 Hz a
    joint.
    """
    draw = np.random.default_rng(seed)
    t = np.arange(round(PERIOD * RATE)) / RATE
    order = np.arange(1, 21, 2)
    rate = 2 * np.pi * order / PERIOD
    amplitude = draw.uniform(0.3, 0.9, (2, order.size)) / np.sqrt(order)
    angle = rate * t[:, None]
    phase = draw.uniform(0, 2 * np.pi, (2, 1, order.size))
    theta, omega, alpha = (
        np.stack([wave @ row for wave, row in zip(waves, factor, strict=True)])
        for waves, factor in (
            (np.sin(angle + phase), amplitude),
            (np.cos(angle + phase), amplitude * rate),
            (-np.sin(angle + phase), amplitude * rate**2),
        )
    )
    return theta, omega, alpha


def blocks(rows: int, case: str = "case1") -> Iterator[Log]:
    """A log of `rows` samples in blocks; the same for the same length."""
    draw = np.random.default_rng(1)
    theta, omega, alpha = motion()
    clean = np.tile(
        inverse_dynamics(load_case(case).arm.constants(), theta, omega, alpha), (1, _BLOCK)
    )
    theta = np.tile(np.rint(theta / ENCODER_STEP) * ENCODER_STEP, (1, _BLOCK))
    for first in range(0, rows, theta.shape[1]):
        count = min(theta.shape[1], rows - first)
        noisy = clean[:, :count] + TORQUE_NOISE * draw.standard_normal((2, count))
        tau = np.rint(noisy / TORQUE_STEP) * TORQUE_STEP
        stamps = START_NS + (first + np.arange(count)) * (10**9 // RATE)
        yield Log(stamps, theta[:, :count], tau, Origin("", "", {}))


def log(path: Path, rows: int) -> Path:
    """The log as Parquet or MCAP, once."""
    if not path.exists():
        write_log(path, blocks(rows))
    return path
