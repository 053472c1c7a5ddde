"""Limits of sensors: found by motion, and no other."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from algid.arm import Arm, FloatArray, forward_dynamics
from algid.estimators.saturation import Limit, _spread, saturation_of, sound
from algid.signals.segments import Segment, append

K = Arm(6, 3, 0.15, 0.1, 0.3, 0.2, 0.1, 0.02, 1.5, 0.3).constants()
DT, ROWS = 2e-3, 3000
LEVELS = (0.6, 0.8, 0.02)
SIZE = np.array([[6.0], [2.0]])  # N m


def asked(t: FloatArray) -> FloatArray:
    """A torque (2, n) of several sines."""
    rates, phases = np.array([[2.3, 5.1, 9.7], [3.1, 6.7, 11.3]]), np.array([[0, 1, 2], [2, 0, 1]])
    waves = np.sin(rates[..., None] * t + phases[..., None])
    return np.asarray(SIZE * waves.mean(axis=1))


@cache
def largest() -> FloatArray:
    return np.abs(asked(DT * np.arange(ROWS))).max(axis=1, keepdims=True)


@cache
def motions() -> FloatArray:
    """Angles (2, 4, ROWS) under the whole torque, and under those with each of `LEVELS`.

    Classical Runge-Kutta steps, side by side.
    """
    bounds = largest() * np.array([np.inf, *LEVELS])

    def slope(state: FloatArray, t: float) -> FloatArray:
        tau = np.clip(asked(np.array([t])), -bounds, bounds)
        return np.concatenate([state[2:], forward_dynamics(K, state[:2], state[2:], tau)])

    state = np.zeros((4, bounds.shape[1]))
    state[0] = -np.pi / 2
    found = np.empty((2, bounds.shape[1], ROWS))
    for row in range(ROWS):
        found[..., row] = state[:2]
        t = row * DT
        a = slope(state, t)
        b = slope(state + 0.5 * DT * a, t + 0.5 * DT)
        c = slope(state + 0.5 * DT * b, t + 0.5 * DT)
        d = slope(state + DT * c, t + DT)
        state = state + DT / 6 * (a + 2 * b + 2 * c + d)
    return found


@cache
def log(cause: str, level: float) -> Segment:
    """A log whose torque a sensor cuts off, or a limit that holds."""
    rng = np.random.default_rng(8)
    noise = rng.standard_normal((2, 2, ROWS))
    limit = level * largest()
    whole = asked(DT * np.arange(ROWS))
    place = 0 if cause == "sensor" else 1 + LEVELS.index(level)
    noisy = whole + 5e-3 * noise[1]
    tau = {
        "sensor": np.clip(noisy, -limit, limit),
        "true": np.clip(whole, -limit, limit),
    }[cause]
    return Segment(0.0, DT, motions()[:, place] + 2e-4 * noise[0], tau)


def found(one: Segment) -> dict[int, Limit]:
    return {limit.joint: limit for limit in saturation_of([one]).limits}


@pytest.mark.parametrize("level", [0.6, 0.8])
def test_a_limit_that_cuts_off_is_found_in_both_joints_at_its_level(level: float) -> None:
    limits = found(log("sensor", level))
    assert set(limits) == {0, 1}
    for joint, limit in limits.items():
        expected = level * largest()[joint, 0]
        assert 0.96 * expected < limit.high < expected  # what noise leaves open lies outside
        assert limit.low == -limit.high


@pytest.mark.parametrize("level", [0.6, 0.8])
def test_a_torque_that_is_truly_limited_is_let_stand(level: float) -> None:
    known = saturation_of([log("true", level)])
    assert known.limits == ()
    assert known.sound == {0, 1}


def test_a_torque_between_two_values_is_no_plateau() -> None:
    """Everything at an extreme: a bang-bang torque tells of no limit."""
    switched = log("true", 0.02)
    assert np.mean(np.abs(switched.tau[0]) == switched.tau[0].max()) > 0.5
    assert saturation_of([switched]).limits == ()


def test_a_torque_that_another_arm_moves_by_tells_nothing() -> None:
    wrong = log("sensor", 0.6)
    swapped = replace(wrong, tau=wrong.tau[::-1])
    known = saturation_of([swapped])
    assert known.limits == ()
    assert known.sound == frozenset()


LIMITS = (Limit(0, -np.inf, 1.0), Limit(1, -2.0, 2.0))


def ramp(count: int = 2000) -> Segment:
    rng = np.random.default_rng(3)
    theta = rng.standard_normal((2, count))
    tau = np.vstack(
        [1.2 * np.sin(0.013 * np.arange(count)), 2.3 * np.sin(0.011 * np.arange(count))]
    )
    return Segment(0.0, 1e-3, theta, tau)


def test_what_is_left_lies_within_the_limits_and_ten_milliseconds_off() -> None:
    whole = ramp()
    beyond = LIMITS[0].beyond(whole.tau) | LIMITS[1].beyond(whole.tau)
    near = np.array([beyond[max(0, place - 10) : place + 11].any() for place in range(len(whole))])
    left = list(sound([whole], LIMITS))
    np.testing.assert_array_equal(
        np.concatenate([part.theta for part in left], axis=1), whole.theta[:, ~near]
    )
    for part in left:
        place = round(part.start / part.dt)
        np.testing.assert_array_equal(part.theta, whole.theta[:, place : place + len(part)])
        assert part.continues == (place > 0 and not near[place - 1])


def stretches(parts: list[Segment]) -> list[Segment]:
    """Parts that continue each other as one."""
    joined: list[Segment] = []
    for part in parts:
        if part.continues:
            joined[-1] = append(joined[-1], part)
        else:
            joined.append(part)
    return joined


@pytest.mark.parametrize("size", [1, 7, 64, 700])
def test_stretches_do_not_depend_on_how_the_segments_were_cut(size: int) -> None:
    whole = ramp()
    parts = [whole.part(first, first + size) for first in range(0, len(whole), size)]
    cut, expected = (stretches(list(sound(one, LIMITS))) for one in (parts, [whole]))
    assert [one.start for one in cut] == pytest.approx([one.start for one in expected])
    for one, other in zip(cut, expected, strict=True):
        np.testing.assert_array_equal(one.theta, other.theta)
        np.testing.assert_array_equal(one.tau, other.tau)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
@pytest.mark.parametrize("reach", [2, 7, 60])
def test_samples_near_a_limit_are_those_of_another_library(share: float, reach: int) -> None:
    found = np.random.default_rng(reach).random(50) < share
    assert np.array_equal(_spread(found, reach), binary_dilation(found, iterations=reach))
