"""What a reference explains of a motion is found again; what explains nothing is no instrument."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from algid.arm import FloatArray
from algid.estimators.instruments import Explained, followed
from algid.estimators.problem import WeakSettings
from algid.log import Log, Origin, join
from algid.signals.segments import Segment, segments
from tests.estimators.conftest import problem_of

DT = 0.004
SETTINGS = WeakSettings()


def log(seed: int, *, disturbance: float = 0.3) -> tuple[Segment, FloatArray]:
    """Angles that lag behind references by 0.1 s, with a disturbance; and without it (2, N)."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(4000)
    turn, phase = 2 * np.pi * np.array([0.4, 0.9, 1.7]), rng.uniform(0, 6, (2, 3, 1))
    reference = np.sum(np.sin(turn[:, None] * t + phase), axis=1)
    share = 1 - np.exp(-DT / 0.1)
    steady = reference[:, :1]
    clean = lfilter([share], [1, share - 1], reference - steady, axis=1) + steady
    noise = lfilter([0.02], [1, -0.98], rng.standard_normal((2, t.size)), axis=1)
    theta = clean + disturbance * noise / noise.std()
    return Segment(0.0, DT, theta, theta - clean, reference=reference), clean


def asked(*logs: Segment) -> Explained | None:
    return followed(problem_of(*logs, settings=SETTINGS))


def test_the_motion_that_the_reference_makes_is_found_without_the_disturbance() -> None:
    """Of six logs of 16 s: within a fifth of the disturbance, whose power leaks by the share of the
    coefficients in the independent samples, some 30 in 6 × 16 s / 0.2 s.
    """
    made = [log(seed) for seed in range(6)]
    found = asked(*(one for one, _ in made))
    piece, clean = made[0]
    motion = found(piece)
    settled = slice(250, None)  # the longest lag: what was before the log nobody knows
    off = np.std(motion.theta[:, settled] - clean[:, settled], axis=1)
    disturbance = np.std(piece.theta[:, settled] - clean[:, settled], axis=1)
    assert np.all(off < 0.35 * disturbance)
    assert np.std(motion.tau[:, settled]) < 0.35 * np.std(piece.tau[:, settled])


def test_what_the_arm_does_not_follow_is_no_instrument() -> None:
    piece, _ = log(0)
    assert asked(piece) is not None
    other = np.sin(2 * np.pi * 2.9 * piece.t + np.array([[0.0], [1.0]]))
    assert asked(replace(piece, reference=other)) is None
    held = replace(piece, reference=np.zeros_like(piece.theta))
    assert asked(held) is asked(piece, replace(piece, reference=None)) is asked() is None


def test_a_reference_goes_where_its_samples_go() -> None:
    """Cut, joined, and put on the time base with them: a line stays the line."""
    rng = np.random.default_rng(0)
    stamps = (np.arange(5000) * 2_000_000 + rng.integers(0, 400_000, 5000)).astype(np.int64)
    line = np.outer([1.0, -2.0], stamps * 1e-9)
    whole = Log(stamps, line, line, Origin("", "", {}), reference=line + 1)
    blocks = [whole.part(first, first + 700) for first in range(0, 5000, 700)]
    again = join(blocks)
    assert np.array_equal(again.reference, line + 1)
    for segment in segments(blocks):
        assert segment.reference == pytest.approx(segment.theta + 1)
    none = replace(blocks[1], reference=None)
    assert join([blocks[0], none]).reference is None
