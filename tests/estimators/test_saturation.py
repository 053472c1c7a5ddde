"""Limits of sensors: found by motion, and no other."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from algid.estimators.saturation import Limit, saturation_of, sound
from algid.signals.segments import Segment
from pipelines import saturation

DT = 1e-3


@cache
def log(cause: str, level: float) -> Segment:
    """Case 1's log, whose torque a sensor cuts off, or a limit that holds."""
    _, made = saturation.log_of("case1", cause, level, 0)
    return Segment(0.0, DT, made.theta, made.tau)


def found(one: Segment) -> dict[int, Limit]:
    return {limit.joint: limit for limit in saturation_of([one]).limits}


@pytest.mark.parametrize("level", [0.6, 0.8])
def test_a_limit_that_cuts_off_is_found_in_both_joints_at_its_level(level: float) -> None:
    limits = found(log("sensor", level))
    assert set(limits) == {0, 1}
    for joint, limit in limits.items():
        expected = log("sensor", level).tau[joint].max()
        assert 0.96 * expected < limit.high < expected  # what noise leaves open lies outside
        assert limit.low == -limit.high


def test_a_torque_that_is_truly_limited_is_let_stand() -> None:
    known = saturation_of([log("true", 0.8)])
    assert known.limits == ()
    assert known.sound == {0, 1}


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
    return Segment(0.0, DT, theta, tau)


@pytest.mark.parametrize("size", [1, 7, 64, 700, 2000])
def test_what_is_left_lies_ten_milliseconds_off_the_limits_however_it_was_cut(size: int) -> None:
    whole = ramp()
    parts = [whole.part(first, first + size) for first in range(0, len(whole), size)]
    beyond = LIMITS[0].beyond(whole.tau) | LIMITS[1].beyond(whole.tau)
    near = np.array([beyond[max(0, place - 10) : place + 11].any() for place in range(len(whole))])
    left = list(sound(parts, LIMITS))
    np.testing.assert_array_equal(
        np.concatenate([part.theta for part in left], axis=1), whole.theta[:, ~near]
    )
    for part in left:
        place = round(part.start / part.dt)
        np.testing.assert_array_equal(part.theta, whole.theta[:, place : place + len(part)])
        assert part.continues == (place > 0 and not near[place - 1])
