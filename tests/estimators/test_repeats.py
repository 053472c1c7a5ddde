"""Runs of one motion are found by the motion, and count as one."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import robust
from algid.estimators.problem import WeakSettings
from algid.estimators.repeats import grouped
from algid.signals.segments import Segment
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.accuracy_scenes import random_arm
from tests.estimators.conftest import problem_of


def run(seed: int, shift: float = 0.0, dt: float = 2e-3, seconds: float = 6.0) -> Segment:
    """Both joints under sines of random phases, with an encoder's noise of its own."""
    rng = np.random.default_rng(seed)
    phase, turn = rng.uniform(0, 6, (2, 4, 1)), rng.uniform(2, 15, (2, 4, 1))
    t = dt * np.arange(round(seconds / dt)) + shift
    theta = np.sin(turn * t + phase).sum(axis=1) / 3
    noise = np.random.default_rng(round(1e6 * shift)).standard_normal(theta.shape)
    return Segment(0.0, dt, theta + 1e-3 * noise, np.zeros_like(theta))


def test_repeats_are_found_by_their_motion() -> None:
    """At another rate, begun later, a little shorter.

    Another motion and a loaded log are no repeats.
    """
    logs = [run(1), run(2), run(1, shift=0.3), run(1, dt=4e-3), run(1, seconds=5.5), run(3)]
    known = problem_of(*logs, loaded=[run(1)])
    assert grouped(known.unloaded, known.loaded) == ((0, 2, 3, 4), (1,), (5,), (6,))


def test_a_repeat_may_be_recorded_some_seconds_later() -> None:
    logs = [run(1, seconds=24.0), run(1, seconds=24.0, shift=4.0), run(2, seconds=24.0)]
    assert grouped(problem_of(*logs).unloaded, []) == ((0, 1), (2,))


def fitted(logs: list[Segment]) -> tuple[FloatArray, FloatArray]:
    found = robust.fit(problem_of(*logs, settings=WeakSettings(bandwidth=60.0)))
    return found.values[:7], found.std[:7]


def test_six_repeats_tell_what_one_run_tells() -> None:
    """Cogging is the same in each: without grouping the error bars would shrink by √6."""
    arm, _ = random_arm(81)
    t = np.arange(5000) * 2e-3
    motion = simulate(arm.constants(), wide_multi_sine(arm, 81), t)
    cogging = 0.03 * np.sqrt(2) * motion.tau.std(axis=1, keepdims=True) * np.sin(12 * motion.theta)
    rng = np.random.default_rng(5)

    def repeat() -> Segment:
        theta = motion.theta + 3e-4 * rng.standard_normal(motion.theta.shape)
        tau = motion.tau + cogging + 1e-2 * rng.standard_normal(motion.tau.shape)
        return Segment(0.0, 2e-3, theta, tau)

    alone, once = fitted([repeat()])
    together, six = fitted([repeat() for _ in range(6)])
    assert together == pytest.approx(alone, rel=0.05)
    assert np.all(six > 0.7 * once)
