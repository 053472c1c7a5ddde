"""Checks of channels and of stamps, on signals of closed form: what is told is what was put in, at
each limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.inspection import channels
from algid.inspection.sampling import lost_steps, rests, samples_a_period, sampling
from algid.log import ChannelReading, IntArray, Log, Origin, Reading
from algid.notices import Notice, of_codes
from tests.inspection.test_checks import noticed

ROWS = 2000
T = np.arange(ROWS) * 1e-3


def logged(
    theta: FloatArray | None = None,
    tau: FloatArray | None = None,
    *,
    omega: FloatArray | None = None,
    stamps: FloatArray | None = None,
    mapping: dict[str, str] | None = None,
    reading: Reading | None = None,
) -> Log:
    """A log at 1 kHz: by default slow sines, and torques of which no two samples are alike."""
    angles = np.stack([np.sin(T), np.cos(T)]) if theta is None else theta
    stamp_ns = (
        np.arange(angles.shape[1]) * 10**6
        if stamps is None
        else np.rint(stamps * 1e9).astype(np.int64)
    )
    t = stamp_ns * 1e-9
    torques = np.stack([np.sin(3 * t) + t, np.cos(2 * t) + t]) if tau is None else tau
    origin = Origin("arm.csv", "csv", mapping or {}, reading=reading or Reading())
    return Log(stamp_ns, angles, torques, origin, omega)


def only(found: Sequence[Notice]) -> Notice:
    (one,) = found
    return one


def test_each_torque_that_is_none_is_told_with_its_source_and_what_names_another() -> None:
    tau = logged().tau
    other = "--set tau2.source=NAME"
    zero = only(
        [*channels.efforts(logged(tau=np.stack([tau[0], 0 * tau[1]]), mapping={"tau2": "effort"}))]
    )
    assert (zero.code, zero.refuse) == ("EFFORT_ZERO", True)
    rest = f"name the measured torque: {other}; for a joint without a motor: --set passive=2"
    assert zero.clause == f"tau2 (effort) is zero in every sample: {rest}"
    none = [*channels.efforts(logged(tau=0 * tau))]  # a joint that is passive needs another's motor
    assert [one.advice for one in none] == [
        f"name the measured torque: --set tau{joint}.source=NAME" for joint in (1, 2)
    ]
    tiny = only([*channels.efforts(logged(tau=np.stack([tau[0], 3.14159e-7 * np.sin(T)])))])
    assert tiny.code == "EFFORT_ZERO"
    assert tiny.clause.startswith(
        "tau2 never exceeds 3.14e-07 N m: no torque: name the measured torque: --set tau2.source="
    )
    held = only([*channels.efforts(logged(tau=np.stack([tau[0], np.full(ROWS, -2.5)])))])
    assert held.code == "EFFORT_ZERO"
    assert held.clause == f"tau2 is -2.5 N m in every sample: {rest}"


def test_a_millionth_of_a_newton_metre_is_a_torque_and_a_passive_joint_needs_none() -> None:
    small = np.stack([1e-6 * np.cos(T), 0.999e-6 * np.cos(T)])
    assert [one.code for one in channels.efforts(logged(tau=small))] == ["EFFORT_ZERO"]
    nothing = np.zeros((2, ROWS))
    passive = logged(tau=nothing, reading=Reading(passive=1))
    assert [one.text.partition(" ")[0] for one in channels.efforts(passive)] == ["tau2"]


@pytest.mark.parametrize(("clipped", "told"), [(21, None), (23, "1.05"), (402, "20")])
def test_a_hundredth_of_the_samples_at_the_limit_is_told(clipped: int, told: str | None) -> None:
    """Of a run of n samples at the limit n - 2 have neighbours there."""
    tau = logged().tau
    tau[0, 300 : 300 + clipped] = 9.0
    found = [*channels.efforts(logged(tau=tau))]
    texts = [] if told is None else [f"tau1 stands at its limit in {told} % of the samples"]
    assert [one.text for one in found] == texts
    assert not any(one.refuse for one in found)


@pytest.mark.parametrize(
    ("first", "length", "told"),
    [
        (500, 400, "tau2 stands still for 0.4 s from t = 0.5 s; leave that out"),
        (500, 100, "tau2 stands still for 0.1 s from t = 0.5 s; leave that out"),
        (500, 99, None),  # a tenth of a second is the least
    ],
)
def test_a_torque_that_drops_out_is_told_with_when_and_how_long(
    first: int, length: int, told: str | None
) -> None:
    tau = np.stack([np.sin(3 * T) + T, np.sin(40 * T)])
    tau[1, first : first + length] = 0.25
    assert [one.text for one in channels.stuck(logged(tau=tau))] == ([] if told is None else [told])


@pytest.mark.parametrize(("repeated", "dead"), [(1, True), (20, True), (21, False), (50, False)])
def test_a_slow_publisher_is_told_from_a_torque_that_drops_out(repeated: int, dead: bool) -> None:
    """A run of 400 samples is 20 usual ones where each value stands 20 times."""
    held = np.repeat(np.sin(0.05 * np.arange(ROWS)), repeated)[:ROWS]
    start = 20 * repeated if repeated < 50 else 1000
    tau = np.stack(
        [np.sin(3 * T) + T, np.concatenate([held[:start], np.full(400, 0.123), held[start:-400]])]
    )
    assert bool([*channels.stuck(logged(tau=tau))]) == dead


@pytest.mark.parametrize("turns", [1, 3])
def test_wraps_are_counted(turns: int) -> None:
    angle = np.linspace(0, 2 * math.pi * turns + 1, ROWS)
    found = only([*channels.angles(logged(np.stack([np.sin(T), angle % (2 * math.pi)])))])
    times = "1 time" if turns == 1 else "3 times"
    assert found.refuse
    assert found.clause == f"theta2 jumps by a turn {times}: --set theta2.unwrap=true"
    assert [*channels.angles(logged(np.stack([np.sin(T), angle])))] == []


def test_a_turn_over_a_gap_is_no_wrap() -> None:
    """A joint may turn round while nothing is recorded; a gap that is filled in hides a wrap."""
    theta = np.stack([np.sin(T), 0.1 * T])
    theta[1, 700:] += 2 * math.pi
    for periods, told in ((6.0, []), (4.0, ["WRAPPED_ANGLE"])):
        stamps = T + 1e-3 * (periods - 1) * (np.arange(ROWS) >= 700)
        assert [one.code for one in channels.angles(logged(theta, stamps=stamps))] == told


@pytest.mark.parametrize(
    ("jump", "wraps"), [(0.89, False), (0.92, True), (1.08, True), (1.11, False)]
)
def test_a_jump_is_a_wrap_where_it_is_a_turn_within_a_tenth(jump: float, wraps: bool) -> None:
    theta = np.stack([np.sin(T), 0.1 * T])
    theta[1, 700:] += jump * 2 * math.pi
    assert ([one.code for one in channels.angles(logged(theta))] == ["WRAPPED_ANGLE"]) == wraps


@pytest.mark.parametrize(("length", "told"), [(21, True), (20, False)])
def test_a_sensor_that_freezes_and_jumps_is_told_with_when_and_how_long(
    length: int, told: bool
) -> None:
    """A step of a sample is 1e-3 rad.

    Behind 21 samples or more without one comes all that was left out.
    """
    theta = np.stack([np.sin(T), T.copy()])
    theta[1, 600 : 600 + length] = theta[1, 600]
    found = [*channels.stuck(logged(theta))]
    if told:
        assert only(found).text == "theta2 freezes for 0.021 s from t = 0.6 s, then jumps"
        assert not only(found).refuse
    else:
        assert found == []
    rested = np.stack(
        [np.sin(T), np.concatenate([T[:600], np.full(300, T[599]), T[600 : ROWS - 300]])]
    )
    assert [*channels.stuck(logged(rested))] == []  # it stood still, and went on as before


def test_an_angle_that_never_changes_is_told_beside_what_the_other_one_does() -> None:
    theta = np.stack([np.full(ROWS, 0.5), np.linspace(0, 7, ROWS) % (2 * math.pi)])
    found = [*channels.angles(logged(theta, mapping={"theta1": "q[0]"}))]
    assert [one.code for one in found] == ["HARDLY_DRIVEN", "WRAPPED_ANGLE"]
    assert found[0].text == "theta1 (q[0]) is 0.5 rad in every sample"


def turning(factors: tuple[float, float]) -> Log:
    """Angles that are so many times what the velocities say."""
    rate = np.stack([1.5 + np.sin(2 * T), 2 + np.cos(3 * T)])
    angle = np.stack([1.5 * T - np.cos(2 * T) / 2, 2 * T + np.sin(3 * T) / 3])
    return logged(angle * np.array(factors)[:, None], omega=rate)


def never() -> bool:
    raise AssertionError("physics is asked where the velocities tell nothing")


@pytest.mark.parametrize(
    ("factor", "told"),
    [
        (180 / math.pi, "angles of joint 2 are in degrees by the other signal"),
        (math.pi / 180, "velocities of joint 2 are in degrees by the other signal"),
        (0.82 * 180 / math.pi, "angles of joint 2 are in degrees by the other signal"),
        (1.22 * 180 / math.pi, "angles of joint 2 are in degrees by the other signal"),
        (0.78 * 180 / math.pi, None),
        (1.28 * 180 / math.pi, None),
        (1.0, None),
    ],
)
def test_degrees_are_told_by_angles_and_velocities(factor: float, told: str | None) -> None:
    found = [*channels.degrees(turning((1.0, factor)), never)]
    assert [one.text.partition(": ")[0] for one in found] == ([] if told is None else [told])


def test_what_is_in_degrees_is_told_with_the_flags_of_its_channel() -> None:
    angle = only([*channels.degrees(turning((180 / math.pi, 1.0)), never)])
    assert [one.settings for one in angle.remedies] == [
        {"angle_unit": "deg"},
        {"theta1.gear_ratio": None},
        {"theta1.unit": "rad"},
    ]
    velocity = only([*channels.degrees(turning((math.pi / 180, 1.0)), never)])
    assert [one.settings for one in velocity.remedies] == [
        {"omega1.unit": "deg"},
        {"omega1.gear_ratio": None},
        {"omega1.unit": "rad"},
    ]
    assert angle.refuse
    assert velocity.refuse


def test_a_unit_that_the_user_said_is_believed() -> None:
    log = turning((180 / math.pi, 1.0))
    said = Reading(channels={"theta1": ChannelReading("q1", "rad", "flag")})
    found = only([*channels.degrees(replace(log, origin=replace(log.origin, reading=said)), never)])
    assert not found.refuse
    assert (
        found.text
        == "angles of joint 1 are in degrees by the other signal; they are taken for rad as "
        "configured"
    )


@pytest.mark.parametrize(
    ("turns", "right", "told"), [(5.9, False, False), (6.1, False, True), (6.1, True, False)]
)
def test_without_velocities_angles_may_turn_six_times_or_as_physics_allows(
    turns: float, right: bool, told: bool
) -> None:
    theta = np.stack([np.sin(T), -turns * 2 * math.pi * T / T[-1]])
    found = [*channels.degrees(logged(theta), lambda: right)]
    assert [one.text.partition(":")[0] for one in found] == (["angles reach 38.33"] if told else [])
    # velocities that say nothing are none
    still = replace(logged(theta), omega=np.zeros((2, ROWS)))
    assert bool([*channels.degrees(still, lambda: right)]) == told


@pytest.mark.parametrize("name", ["theta1", "theta2", "tau1", "tau2"])
def test_spikes_are_counted_in_every_channel(name: str) -> None:
    draw = np.random.default_rng(1)
    values = {
        one: np.sin(T) + draw.normal(0, 1e-3, ROWS) for one in ("theta1", "theta2", "tau1", "tau2")
    }
    values[name][[250, 900, 1300]] += 1.0
    log = logged(
        np.stack([values["theta1"], values["theta2"]]), np.stack([values["tau1"], values["tau2"]])
    )
    assert only([*channels.spikes(log)]).text == f"{name} has 3 spikes, the first at t = 0.25 s"


@pytest.mark.parametrize("period", [math.sqrt(53), math.sqrt(137), math.sqrt(1623)])
def test_samples_in_a_period_are_those_of_the_faster_joint(period: float) -> None:
    count = np.arange(20_000)
    fast, slow = (np.sin(2 * math.pi * count / one) for one in (period, math.sqrt(40_001)))
    for pair in ((fast, slow), (slow, fast)):
        # the phases are spread evenly: medians of first and second differences stand for the same
        # phase
        assert samples_a_period(logged(np.stack(pair))) == pytest.approx(period, rel=1e-3)
    # of 100 periods
    assert samples_a_period(logged(np.stack([0.01 * fast, slow]))) == pytest.approx(200, rel=0.01)
    assert samples_a_period(logged(np.stack([0.01 * fast, 0.5 * slow]))) == math.inf
    # no bend, no period
    assert samples_a_period(logged(np.stack([count / 16, count / 16]))) == math.inf


@pytest.mark.parametrize(("lost", "told"), [(11, 11), (40, 40), (10, 0)])
def test_steps_twice_as_long_are_counted(lost: int, told: int) -> None:
    """At constant velocities each sample that is missing makes one step of two."""
    steps = np.ones(ROWS - 1)
    steps[20 + 40 * np.arange(lost)] = 2.0
    place = 1e-3 * np.concatenate([[0.0], np.cumsum(steps)])
    assert lost_steps(logged(np.stack([place, -2 * place]))) == told
    steps[40 + 40 * np.arange(math.ceil(lost / 5))] = (
        0.0  # a halt for five of them: all may be noise's
    )
    place = 1e-3 * np.concatenate([[0.0], np.cumsum(steps)])
    assert lost_steps(logged(np.stack([place, -2 * place]))) == 0


def codes(log: Log) -> dict[str, str]:
    return {one.code: one.text for one in sampling(log)}


def test_gaps_are_counted_and_measured() -> None:
    stamps = T.copy()
    stamps[500:] += 0.25
    stamps[1200:] += 1.5
    assert codes(logged(stamps=stamps)) == {
        "GAPS": "2 gaps, the longest 1.501 s; no window spans one"
    }
    stamps = T.copy()
    stamps[500:] += 1.4e-3  # a step of 2.4 periods is none
    assert "GAPS" not in codes(logged(stamps=stamps))


def test_jitter_is_told_with_what_resampling_costs() -> None:
    """Each tenth stamp is late by d: the steps' deviation is d √0.2, and a parabola's chord is off
    by a dt²/8.
    """
    tenth = np.arange(ROWS) % 10 == 5
    angle = np.stack([0.5 * 80 * T**2, 0.1 * T])
    told = (
        "stamps jitter by 0.0895 ms about a period of 1 ms; resampling moves angles by 1e-05 "
        "rad at most, linearly"
    )
    assert codes(logged(angle, stamps=T + 0.2e-3 * tenth))["UNEVEN_STAMPS"] == told
    noisy = angle + 1e-4 * np.random.default_rng(0).standard_normal(angle.shape)
    for moved, note in ((angle, False), (noisy, True)):  # less than the angles' own noise
        (one,) = of_codes(sampling(logged(moved, stamps=T + 0.2e-3 * tenth)), "UNEVEN_STAMPS")
        assert one.note is note
    for late, jitters in ((0.022e-3, False), (0.0228e-3, True)):
        assert ("UNEVEN_STAMPS" in codes(logged(stamps=T + late * tenth))) == jitters


def test_a_log_of_a_second_is_long_enough() -> None:
    assert "SHORT_LOG" not in codes(logged(np.stack([np.sin(T[:1001])] * 2)))
    told = codes(logged(np.stack([np.sin(T[:1000])] * 2)))["SHORT_LOG"]
    assert (
        told
        == "the log lasts 0.999 s; an estimate needs a second of motion at least, ten are better"
    )


def held(before: float, after: float, creep: float = 0.0) -> Log:
    """Joint 1 stands, moves for 2.5 s at 1 rad/s, and stands; joint 2 creeps all the time."""
    t = np.arange(round(1000 * (before + 2.5 + after)) + 1) * 1e-3
    return logged(np.stack([np.clip(t - before, 0, 2.5), creep * t]))


@pytest.mark.parametrize(
    ("before", "after", "flags"),
    [
        (0.6, 0.0, ("--start 0.602",)),
        (0.0, 0.7, ("--end 2.498",)),
        (0.6, 0.7, ("--start 0.602", "--end 3.098")),
        (0.49, 0.49, ()),
        (0.499, 0.499, ("--start 0.501", "--end 2.997")),
    ],
)
def test_rest_lasts_until_a_thousandth_of_the_way(
    before: float, after: float, flags: tuple[str, ...]
) -> None:
    """Two samples of 1e-3 rad are within 2.5e-3 rad."""
    found = [*rests(held(before, after), True)]
    assert [" ".join(one.remedies[0].flags) for one in found] == (
        [" ".join(flags)] if flags else []
    )
    for one in found:
        assert one.clause.endswith(f"leave the rest out: {' '.join(flags)}")
        assert one.note


def test_of_the_beginning_of_a_log_nothing_is_refused_and_the_place_is_told() -> None:
    log = logged(tau=np.zeros((2, ROWS)))
    with pytest.raises(
        LogError, match=r"^arm\.csv: EFFORT_ZERO: tau1 is zero .*--accept EFFORT_ZERO$"
    ):
        noticed(log)
    told = noticed(log, whole=False)
    assert [one.code for one in told] == ["EFFORT_ZERO", "EFFORT_ZERO"]
    assert all(
        one.code == "EFFORT_ZERO" and one.text.endswith(" (in its first 2 s)") for one in told
    )


def slowed(tau: FloatArray, every: IntArray) -> FloatArray:
    """A torque (2, N) that is measured at the samples `every` alone."""
    rows = np.arange(tau.shape[1])
    return tau[:, every[np.searchsorted(every, rows, side="right") - 1]]


@pytest.mark.parametrize("step", [2, 10, 20])
def test_a_held_torque_is_told_with_what_it_is_late(step: int) -> None:
    log = logged()
    found = list(
        channels.held_efforts(replace(log, tau=slowed(log.tau, np.arange(0, T.size, step))))
    )
    assert [one.code for one in found] == ["HELD_EFFORT"] * 2
    assert found[0].numbers["held"] == pytest.approx(step)
    assert found[0].numbers["late"] == pytest.approx((step - 1) / 2)  # mean of 0 … step - 1 samples
    assert not any(one.note or one.refuse for one in found)


def test_coarse_counts_and_logs_that_are_slow_as_a_whole_are_not_held() -> None:
    log = logged()
    assert not list(channels.held_efforts(log))
    for count in (1e-3, 1e-2, 0.1):  # of sines of amplitude one and more, with and without noise
        noise = 0.3 * count * np.random.default_rng(1).standard_normal(log.tau.shape)
        for tau in (np.sin(log.theta), np.sin(log.theta) + noise):
            assert not list(channels.held_efforts(replace(log, tau=count * np.rint(tau / count))))
    every = np.arange(0, T.size, 10)
    slow = replace(log, theta=slowed(log.theta, every), tau=slowed(log.tau, every))
    assert not list(channels.held_efforts(slow))


def test_dry_friction_makes_no_spikes_and_a_bus_does() -> None:
    """A joint turns back between two samples, or its torque changes while a step is logged."""
    draw = np.random.default_rng(3)
    omega = 30 * np.sin(2 * math.pi * 3 * T)
    turn = np.searchsorted(T, T[-1] / 2)
    omega = np.where(np.abs(T - T[turn]) < 6e-3, 5e5 * (T - T[turn]) ** 2 - 1e-6, omega)
    theta = np.cumsum(omega) * (T[1] - T[0]) + draw.normal(0, 3e-4, ROWS)
    tau = 10 * np.sin(2 * math.pi * T) + 4 * np.tanh(omega / 1e-7) + draw.normal(0, 1e-2, ROWS)
    assert np.sign(omega[turn - 1 : turn + 2]).tolist() == [1, -1, 1]
    log = logged(np.stack([theta, np.sin(T)]), np.stack([tau, np.sin(T)]))
    assert [*channels.spikes(log)] == []
    moved = replace(log, tau=log.tau.copy())
    moved.tau[0, turn + 40] += 8.0
    assert only([*channels.spikes(moved)]).numbers["count"] == 1


def test_the_overshoot_of_a_step_is_no_spike() -> None:
    draw = np.random.default_rng(4)
    tau = -20.0 * T + draw.normal(0, 1e-3, ROWS)
    tau[700:] += 10.0
    tau[700] -= 1.5  # the torque is on its way
    log = logged(np.stack([np.sin(T), np.sin(T)]), np.stack([tau, np.sin(T)]))
    assert [*channels.spikes(log)] == []
