"""Simulations from many states of a log at once, against the simulator from each of them alone."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import Arm, FloatArray
from algid.estimators.rollout import (
    HORIZONS,
    RolloutScore,
    _angles_at_horizons,
    _starts,
    rollouts,
    time_step,
)
from algid.model import Model
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift
from algid.synth.simulator import simulate
from tests.exports.arms import ODD

K = ODD.constants()
DT = 0.005


def push(t: FloatArray) -> FloatArray:
    """A torque (2, N) that swings the arm about hanging."""
    return np.stack([2.5 * np.sin(4 * t), 0.7 * np.cos(5 * t)])


@pytest.fixture(scope="module")
def segment() -> Segment:
    t = np.arange(0, 8 + DT / 2, DT)
    moved = simulate(K, push, t)
    return Segment(0.0, DT, moved.theta, moved.tau)


def test_angles_are_the_simulators() -> None:
    step = 2e-3
    starts = np.array([[-1.5, -1.0], [0.2, -0.4], [1.0, -2.0], [0.5, 3.0]])
    t = np.arange(2 * round(HORIZONS[-1] / step) + 1) * step / 2
    u = np.repeat(push(t).T[:, :, None], 2, axis=2)
    found = _angles_at_horizons(Model(), K, starts, u, step)
    for start in range(2):
        whole = simulate(K, push, np.array([0.0, *HORIZONS]), starts[:2, start], starts[2:, start])
        for place, angles in enumerate(found):
            # step⁴ twice
            np.testing.assert_allclose(
                angles[:, start], whole.theta[:, place + 1], rtol=0, atol=1e-7
            )


def test_a_wrong_arm_does_as_its_simulation_says(segment: Segment) -> None:
    wrong = K * np.array([1, 1.1, 1, 1.1, 1, 1, 1])
    score = rollouts(Model(), wrong, [segment], 8.0)
    t = np.arange(len(segment)) * DT
    true = simulate(K, push, t)
    errors, starts = [], range(60, len(segment) - 60 - 100, 30)
    for start in starts:
        ends = np.array([t[start], t[start + 100]])
        alone = simulate(wrong, push, ends, true.theta[:, start], true.omega[:, start])
        errors.append(alone.theta[:, 1] - true.theta[:, start + 100])
    np.testing.assert_allclose(
        score.rmse[1], np.sqrt(np.mean(np.square(errors), axis=0)), rtol=0.02
    )


def test_a_delay_that_is_known_is_made_up_for(segment: Segment) -> None:
    late = Segment(0.0, DT, segment.theta[:, 8:], segment.tau[:, 8:])
    # torques that act 8 samples before their stamp
    early = Segment(0.0, DT, segment.theta[:, 8:], segment.tau[:, :-8])
    good = rollouts(Model(), K, [late], 8.0).rmse
    np.testing.assert_allclose(
        rollouts(Model(), K, [early], 8.0, TorqueShift(delay=-8 * DT)).rmse,
        good,
        rtol=0.1,
        atol=1e-4,
    )
    assert rollouts(Model(), K, [early], 8.0).rmse[1].min() > 10 * good[1].max()


def test_short_logs_have_no_starts_and_wild_arms_no_bounds(segment: Segment) -> None:
    short = rollouts(Model(), K, [segment.part(0, 100)], 0.5)
    assert isinstance(short, RolloutScore)
    assert not short.count.any()
    assert np.isnan(short.rmse).all()
    wild = rollouts(Model(), K * np.array([1, 1, 1, 1, 1, -20, -20]), [segment], 8.0)
    assert np.isinf(wild.rmse[2]).all()


def test_the_step_is_as_long_as_the_stiffest_friction_leaves_stable() -> None:
    """h λ below 2.78, λ the largest eigenvalue of M⁻¹ D at rest over θ2, D friction's slopes: and
    not far below.
    """
    rng = np.random.default_rng(0)
    cos = np.cos(np.linspace(0, np.pi, 37))
    steps = []
    for _ in range(300):
        m1, m2, l1, l2, i1, i2 = rng.uniform(0.05, 1.0, 6)
        arm = Arm(5 * m1, 5 * m2, l1 / 2, l2 / 2, l1, l2, i1**4, i2**4, 0.0, 0.0)
        k, f, j2 = arm.constants(), rng.uniform(0, 2, 4) ** 4, rng.uniform(0, 0.1)
        k[5:] = f[:2]
        speed = rng.uniform(0.02, 0.3)
        model = Model(("coulomb", "rotor"), coulomb_speed=speed)
        step = time_step(model, np.concatenate([k, f[2:] / 10, [j2]]))
        M = np.array(
            [
                [k[4] + k[2] + 2 * k[0] * cos, k[2] + k[0] * cos],
                [k[2] + k[0] * cos, np.full(cos.size, k[2] + j2)],
            ]
        )
        D = np.diag(f[:2] + f[2:] / 10 / speed)
        stiffest = np.abs(np.linalg.eigvals(np.linalg.solve(np.moveaxis(M, 2, 0), D))).max()
        assert step in 2e-3 * 0.5 ** np.arange(8)
        assert step * stiffest < 2.78 or step < 1e-4
        assert step == 2e-3 or step * stiffest > 0.05
        steps.append(step)
    assert len(set(steps)) >= 3
    assert time_step(Model(), K) == 2e-3


@pytest.mark.parametrize("dt", [5e-4, 2e-3 / 3, 2e-3, 5e-3])
def test_the_torque_of_a_start_is_what_acts_from_there_on(dt: float) -> None:
    """At every half step, late by the shift.

    Of a fast log the mean over a step, which errs by τ'' h² / 24.
    """
    t = np.arange(round(4 / dt)) * dt
    theta = np.stack([0.4 * np.sin(2 * t), 0.5 * np.cos(3 * t)])
    step, shift = 2e-3, 0.013
    x, u, y = _starts(
        Model(), K, Segment(0.0, dt, theta, push(t)), 0.1, step, TorqueShift(delay=shift)
    )
    edge = round(0.3 / dt)  # where filters ring
    at = np.arange(edge, t.size - edge - round(0.1 / dt), round(0.1 / dt)) * dt
    assert u.shape == (2 * round(HORIZONS[-1] / step) + 1, 2, at.size)
    when = at + 0.5 * step * np.arange(len(u))[:, None] - shift
    inside = (when > step) & (when < t[-1] - step)
    # and between samples a straight line, which errs by τ'' dt² / 8
    atol = 40 * (step**2 / 24 + dt**2 / 8)
    for joint in range(2):
        np.testing.assert_allclose(
            u[:, joint][inside], push(when.ravel())[joint].reshape(when.shape)[inside], atol=atol
        )
    np.testing.assert_allclose(
        x[:2], np.stack([0.4 * np.sin(2 * at), 0.5 * np.cos(3 * at)]), atol=1e-3
    )
    np.testing.assert_allclose(
        x[2:], np.stack([0.8 * np.cos(2 * at), -1.5 * np.sin(3 * at)]), atol=5e-3
    )
    for horizon, angles in zip(HORIZONS, y, strict=True):
        known = np.isfinite(angles[0])
        np.testing.assert_array_equal(known, at + horizon < t[-1] - 0.3 + 1e-9)
        np.testing.assert_allclose(
            angles[0, known], 0.4 * np.sin(2 * (at + horizon))[known], atol=1e-3
        )
