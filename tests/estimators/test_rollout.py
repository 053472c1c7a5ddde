"""Simulations from many states of a log at once, against the simulator from each of them alone."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.estimators.prediction import rollouts
from algid.model import Model
from algid.signals.segments import Segment
from algid.synth.simulator import simulate
from tests.exports.arms import ODD

K = ODD.constants()
DT = 0.005


def push(t: FloatArray) -> FloatArray:
    """A torque (2, N) that swings the arm about hanging."""
    return np.stack([2.5 * np.sin(4 * t), 0.7 * np.cos(5 * t)])


def test_a_wrong_arm_does_as_its_simulation_says() -> None:
    wrong = K * np.array([1, 1.1, 1, 1.1, 1, 1, 1])
    t = np.arange(0, 8 + DT / 2, DT)
    true = simulate(K, push, t)
    count, squares, _ = rollouts(Model(), wrong, [Segment(0.0, DT, true.theta, true.tau)], 8.0)
    errors, starts = [], range(60, t.size - 60 - 100, 30)
    for start in starts:
        ends = np.array([t[start], t[start + 100]])
        alone = simulate(wrong, push, ends, true.theta[:, start], true.omega[:, start])
        errors.append(alone.theta[:, 1] - true.theta[:, start + 100])
    found = np.sqrt(squares[1] / count[1])
    np.testing.assert_allclose(found, np.sqrt(np.mean(np.square(errors), axis=0)), rtol=0.02)
