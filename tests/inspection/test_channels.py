"""Checks of channels and of stamps, on signals of closed form: what is told is what was put in, at
each limit.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.estimators.conventions import AS_READ
from algid.inspection.channels import lost_steps, samples_a_period
from algid.inspection.checks import examine
from algid.inspection.figures import saturated_share
from algid.log import ChannelReading, Log, Origin, Reading
from algid.notices import of_codes
from tests.inspection.test_checks import noticed, of_signals

ROWS = 2000
T = np.arange(ROWS) * 1e-3
NOISE = np.random.default_rng(1).standard_normal((4, ROWS))
TURN, DEGREE = 2 * math.pi, 180 / math.pi


def logged(
    theta2: FloatArray | None = None,
    tau2: FloatArray | None = None,
    *,
    theta1: FloatArray | None = None,
    tau1: FloatArray | None = None,
    omega: FloatArray | None = None,
    stamps: FloatArray = T,
    mapping: dict[str, str] | None = None,
    reading: Reading | None = None,
) -> Log:
    """A log at 1 kHz: by default slow sines, and torques of which no two samples are alike."""
    usual = (np.sin(T), np.cos(T), np.sin(3 * T) + T, np.cos(2 * T) + T)
    given = (theta1, theta2, tau1, tau2)
    count = min(len(one) for one in (stamps, *given) if one is not None)
    rows = [
        own[:count] if one is None else one[:count] for one, own in zip(given, usual, strict=True)
    ]
    whole = Origin("arm.csv", "csv", mapping or {}, reading=reading or Reading())
    stamp_ns = np.rint(stamps[:count] * 1e9).astype(np.int64)
    return Log(stamp_ns, np.stack(rows[:2]), np.stack(rows[2:]), whole, omega)


def with_run(values: FloatArray, length: int, first: int = 500) -> FloatArray:
    """The values (N,) with a run of one of them, 0.25 in the place of what is left out."""
    return np.concatenate([values[:first], np.full(length, 0.25), values[first + length :]])


def published(repeated: int) -> FloatArray:
    """A torque whose values stand so many times each, 400 of them in a run."""
    held = np.repeat(np.sin(0.05 * np.arange(ROWS)), repeated)[:ROWS]
    start = 20 * repeated if repeated < 50 else 1000
    return np.concatenate([held[:start], np.full(400, 0.123), held[start:-400]])


def jumped(turns: float) -> FloatArray:
    """An angle that jumps by so many turns in sample 700."""
    return np.asarray(0.1 * T + turns * TURN * (np.arange(ROWS) >= 700))


def late(periods: float, first: int = 700) -> FloatArray:
    """Stamps of which one step lasts so many periods."""
    return np.asarray(T + 1e-3 * (periods - 1) * (np.arange(ROWS) >= first))


def turning(first: float, second: float, reading: Reading | None = None) -> Log:
    """Angles that are so many times what the velocities say."""
    rate = np.stack([1.5 + np.sin(2 * T), 2 + np.cos(3 * T)])
    theta1, theta2 = 1.5 * T - np.cos(2 * T) / 2, 2 * T + np.sin(3 * T) / 3
    return logged(second * theta2, theta1=first * theta1, omega=rate, reading=reading)


def overshot() -> FloatArray:
    """A torque that is on its way to a step's end for a sample."""
    tau = -20.0 * T + 1e-3 * NOISE[0]
    tau[700:] += 10.0
    tau[700] -= 1.5
    return tau


EFFORTS = ("EFFORT_ZERO", "SATURATED_EFFORT")
STUCK = ("SENSOR_FAULT:torque", "SENSOR_FAULT:angle")
ANGLES = ("WRAPPED_ANGLE", "HARDLY_DRIVEN")
SCALES = ("DEGREES",)
SPIKES = ("SENSOR_FAULT:spikes",)
SAMPLING = ("SHORT_LOG", "SLOW_SAMPLING", "UNEVEN_STAMPS", "LOST_SAMPLES", "GAPS")
WIDE = -6.1 * TURN * T / T[-1]
FROZEN = np.concatenate([T[:600], np.full(21, T[600]), T[621:]])
RESTED = np.concatenate([T[:600], np.full(300, T[599]), T[600 : ROWS - 300]])
TOLD: list[tuple[tuple[str, ...], Log, str]] = [
    (EFFORTS, logged(tau2=0 * T, mapping={"tau2": "eff"}), "tau2 (eff) is zero in every sample"),
    (EFFORTS, logged(tau2=3.14159e-7 * np.sin(T)), "tau2 never exceeds 3.14e-07 N m: no torque"),
    (EFFORTS, logged(tau2=np.full(ROWS, -2.5)), "tau2 is -2.5 N m in every sample"),
    (EFFORTS, logged(tau2=1e-6 * np.cos(T)), ""),
    (EFFORTS, logged(tau2=0.999e-6 * np.cos(T)), "tau2 never exceeds 9.99e-07 N m: no torque"),
    (EFFORTS, logged(tau2=0 * T, reading=Reading(passive=2)), ""),
    # of a run of n samples at the limit n - 2 have neighbours there
    (EFFORTS, logged(tau1=with_run(np.sin(3 * T) / 9 - 1, 21)), ""),
    (
        EFFORTS,
        logged(tau1=with_run(np.sin(3 * T) / 9 - 1, 23)),
        "tau1 stands at its limit in 1.05 % of the samples",
    ),
    (
        STUCK,
        logged(tau2=with_run(np.sin(40 * T), 400)),
        "tau2 stands still for 0.4 s from t = 0.5 s; leave that out",
    ),
    (
        STUCK,
        logged(tau2=with_run(np.sin(40 * T), 100)),
        "tau2 stands still for 0.1 s from t = 0.5 s; leave that out",
    ),
    (STUCK, logged(tau2=with_run(np.sin(40 * T), 99)), ""),  # a tenth of a second is the least
    # a run of 400 samples is 20 usual ones where each value stands 20 times
    (
        STUCK,
        logged(tau2=published(20)),
        "tau2 stands still for 0.4 s from t = 0.4 s; leave that out",
    ),
    (STUCK, logged(tau2=published(21)), ""),
    (STUCK, logged(tau2=published(50)), ""),
    # a torque that stands at its largest or smallest value is at a limit
    (STUCK, logged(tau2=np.where((T > 0.5) & (T < 0.9), 1.5, np.sin(40 * T))), ""),
    (STUCK, logged(tau2=np.where((T > 0.5) & (T < 0.9), -1.5, np.sin(40 * T))), ""),
    (STUCK, logged(FROZEN), "theta2 freezes for 0.021 s from t = 0.6 s, then jumps"),
    (STUCK, logged(np.concatenate([FROZEN[:619], T[619:]])), ""),
    (STUCK, logged(RESTED), ""),  # it stood still, and went on as before
    (ANGLES, logged(np.linspace(0, TURN + 1, ROWS) % TURN), "theta2 jumps by a turn 1 time"),
    (ANGLES, logged(np.linspace(0, 3 * TURN + 1, ROWS) % TURN), "theta2 jumps by a turn 3 times"),
    (ANGLES, logged(np.linspace(0, 3 * TURN + 1, ROWS)), ""),
    # a joint may turn round while nothing is recorded; a gap that is filled in hides a wrap
    (ANGLES, logged(jumped(1), stamps=late(6)), ""),
    (ANGLES, logged(jumped(1), stamps=late(4)), "theta2 jumps by a turn 1 time"),
    (ANGLES, logged(jumped(0.89)), ""),
    (ANGLES, logged(0.95 * TURN * np.arange(ROWS)), ""),  # so fast that no step tells a turn
    (ANGLES, logged(jumped(0.92)), "theta2 jumps by a turn 1 time"),
    (ANGLES, logged(jumped(1.08)), "theta2 jumps by a turn 1 time"),
    (ANGLES, logged(jumped(1.11)), ""),
    (
        ANGLES,
        logged(theta1=np.full(ROWS, 0.5), mapping={"theta1": "q[0]"}),
        "theta1 (q[0]) is 0.5 rad in every sample",
    ),
    (SCALES, turning(1, 0.82 * DEGREE), "angles of joint 2 are in degrees by the other signal"),
    (SCALES, turning(1, 1.22 * DEGREE), "angles of joint 2 are in degrees by the other signal"),
    (SCALES, turning(1, 1 / DEGREE), "velocities of joint 2 are in degrees by the other signal"),
    (SCALES, turning(1, 0.78 * DEGREE), ""),
    (SCALES, turning(1, 1.28 * DEGREE), ""),
    (SCALES, turning(1, 1), ""),
    (
        SCALES,
        turning(DEGREE, 1, Reading(channels={"theta1": ChannelReading("q1", "rad", "flag")})),
        "angles of joint 1 are in degrees by the other signal; they are taken for rad as stated",
    ),
    (SCALES, logged(5.9 / 6.1 * WIDE), ""),
    # velocities agree with angles of many turns
    (SCALES, logged(WIDE, omega=np.stack([np.cos(T), np.full(ROWS, WIDE[-1] / T[-1])])), ""),
    (
        SCALES,
        logged(WIDE, omega=np.zeros((2, ROWS))),  # velocities that say nothing are none
        "angles reach 38.33: few arms turn that far in rad",
    ),
    (SPIKES, logged(tau2=overshot()), ""),
    (SPIKES, logged(tau2=np.where(T == 0.01, 9.0, np.cos(T))[:19]), ""),
    (
        ("UNEVEN_STAMPS:near",),
        logged(stamps=T - 0.8e-3 * (np.arange(ROWS) % 100 == 50)),
        "20 samples follow the one before by less than 0.3 of a period of 1 ms",
    ),
    (
        SAMPLING,
        logged(np.sin(T), stamps=late(251, 500) + late(1501, 1200) - T),
        "2 gaps, the longest 1.501 s; no window spans one",
    ),
    (SAMPLING, logged(np.sin(TURN * np.arange(ROWS) / math.sqrt(94))), "9.7 samples"),
    (SAMPLING, logged(np.sin(TURN * np.arange(ROWS) / math.sqrt(106))), ""),
    (SAMPLING, logged(stamps=late(2.4)), "stamps jitter"),  # a step of 2.4 periods is no gap
    (SAMPLING, logged(stamps=T[:1001]), ""),
    (
        SAMPLING,
        logged(stamps=T[:1000]),
        "the log lasts 0.999 s; an estimate needs a second of motion at least, ten are better",
    ),
]


@pytest.mark.parametrize("row", range(len(TOLD)))
def test_what_a_check_tells_is_what_was_put_in(row: int) -> None:
    codes, log, text = TOLD[row]
    told = [one.text for one in of_codes(of_signals(log), *codes)]
    assert len(told) == bool(text)
    assert all(one.startswith(text) for one in told)


def test_angles_of_many_turns_are_read_where_physics_holds() -> None:
    right = SimpleNamespace(convention=AS_READ, convincing=True, constants={}, score=0.0)
    trials = SimpleNamespace(reweighed=lambda: right, apart=1.0)
    judged: Any = SimpleNamespace(as_read=right, best=right, alone=False, trials=trials)
    assert not of_codes(examine(logged(WIDE), lambda: judged), *SCALES)


def test_what_is_refused_is_told_with_what_mends_it() -> None:
    (wrap,) = of_codes(of_signals(logged(jumped(1))), "WRAPPED_ANGLE")
    assert wrap.refuse
    assert wrap.advice == (
        "--set theta2.unwrap=true; to use it nevertheless: --accept WRAPPED_ANGLE"
    )
    name = "name the measured torque: --set tau{}.source=NAME"
    nevertheless = "to use it nevertheless: --accept EFFORT_ZERO"
    (zero,) = of_codes(of_signals(logged(tau2=0 * T)), "EFFORT_ZERO")
    assert zero.refuse
    passive = "for a joint without a motor: --set passive=2"
    assert zero.advice == f"{name.format(2)}; {passive}; {nevertheless}"
    none = of_codes(
        of_signals(logged(tau1=0 * T, tau2=0 * T)), "EFFORT_ZERO"
    )  # a passive joint needs another's motor
    assert [one.advice for one in none] == [f"{name.format(j)}; {nevertheless}" for j in (1, 2)]


@pytest.mark.parametrize(
    ("log", "unit", "name"),
    [
        (turning(DEGREE, 1), "angle_unit", "theta1"),
        (turning(1 / DEGREE, 1), "omega1.unit", "omega1"),
        (logged(WIDE), "angle_unit", "theta2"),
    ],
)
def test_what_is_in_degrees_is_told_with_its_flags(log: Log, unit: str, name: str) -> None:
    (stated,) = of_codes(of_signals(log), "DEGREES")  # arrays have the units of a `Log`
    assert not stated.refuse
    assert f"they are taken for {'rad/s' if 'omega' in name else 'rad'} as stated" in stated.text
    of_file = Reading({name: ChannelReading("q", "rad")})
    log = replace(log, origin=replace(log.origin, reading=of_file))
    (found,) = of_codes(of_signals(log), "DEGREES")
    assert found.refuse
    assert [one.settings for one in found.remedies] == [
        {unit: "deg"}, {f"{name}.gear_ratio": None}, {"accept": "DEGREES"},
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["theta1", "theta2", "tau1", "tau2"])
def test_spikes_are_counted_in_every_channel(name: str) -> None:
    every = dict(zip(("theta1", "theta2", "tau1", "tau2"), np.sin(T) + 1e-3 * NOISE, strict=True))
    if name != "theta1":
        every["theta1"] *= 0  # what stands still has none, and hides none
    every[name][[250, 900, 1300]] += 1.0
    (found,) = of_codes(of_signals(logged(**every)), *SPIKES)
    assert found.text == f"{name} has 3 spikes, the first at t = 0.25 s"


@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
def test_many_spikes_of_one_value_are_counted_and_a_value_that_fits_is_none(share: float) -> None:
    tau1 = 9 + np.sin(T) + 1e-3 * NOISE[2]
    missed = np.random.default_rng(1).random(T.size) < share
    coarse = np.round(np.sin(5 * T) + 1e-3 * NOISE[3], 1)  # at 0 for many samples
    (found,) = of_codes(of_signals(logged(tau1=np.where(missed, 0, tau1), tau2=coarse)), *SPIKES)
    assert found.text.startswith("tau1 has")
    assert found.numbers["count"] == pytest.approx(missed.sum(), rel=0.3)


def test_samples_between_two_gaps_are_no_spikes() -> None:
    """The torque has moved on while none was logged, and back."""
    whole = logged(tau2=10 * np.sin(TURN * T) + 1e-3 * NOISE[3])
    kept = (T < 0.15) | (T > 0.35) | (np.abs(T - 0.25) < 1e-3)
    theta, tau = whole.theta[:, kept], whole.tau[:, kept]
    log = Log(whole.stamp_ns[kept], theta, tau, whole.origin)
    assert not of_codes(of_signals(log), *SPIKES)


@pytest.mark.parametrize("period", [math.sqrt(53), math.sqrt(137), math.sqrt(1623)])
def test_samples_in_a_period_are_those_of_the_faster_joint(period: float) -> None:
    """Phases are spread evenly: medians of first and second differences are of one phase."""
    count = np.arange(20_000)
    fast, slow = (np.sin(TURN * count / one) for one in (period, math.sqrt(40_001)))
    for theta1, theta2, expected in (
        (fast, slow, period),
        (slow, fast, period),
        (0.01 * fast, slow, 200),  # of 100 periods
        (0.01 * fast, 0.5 * slow, math.inf),
        (count / 16, count / 16, math.inf),  # no bend, no period
    ):
        pair = np.stack([theta1, theta2])
        log = Log(count * 10**6, pair, pair, Origin("arm.csv", "csv", {}))
        assert samples_a_period(log) == pytest.approx(
            expected, rel=0.01 if expected == 200 else 1e-3
        )


@pytest.mark.parametrize(("lost", "told"), [(11, 11), (40, 40), (10, 0)])
def test_steps_twice_as_long_are_counted(lost: int, told: int) -> None:
    """At constant velocities each sample that is missing makes one step of two.

    With a halt for five of them all may be noise's.
    """
    steps = np.ones(ROWS)
    steps[20 + 40 * np.arange(lost)] = 2.0
    place = 1e-3 * np.cumsum(steps)
    assert lost_steps(logged(-2 * place, theta1=place)) == told
    steps[40 + 40 * np.arange(math.ceil(lost / 5))] = 0.0
    place = 1e-3 * np.cumsum(steps)
    assert lost_steps(logged(-2 * place, theta1=place)) == 0


def test_jitter_is_told_with_what_resampling_costs() -> None:
    """Each tenth stamp is late by d: the steps' deviation is d √0.2, and a parabola's chord is off
    by a dt²/8.
    """
    tenth = np.arange(ROWS) % 10 == 5
    for noise, note in ((0.0, False), (1e-4, True)):  # less than the angles' own noise
        theta1, theta2 = 40 * T**2 + noise * NOISE[0], 0.1 * T + noise * NOISE[1]
        log = logged(theta2, theta1=theta1, stamps=T + 0.2e-3 * tenth)
        (one,) = of_codes(of_signals(log), *SAMPLING)
        assert (one.code, one.note) == ("UNEVEN_STAMPS", note)
        assert one.numbers["jitter"] == pytest.approx(0.2 * math.sqrt(0.2), rel=1e-2)
        assert note or one.numbers["error"] == pytest.approx(80 * 1e-6 / 8)
    for late, jitters in ((0.022e-3, False), (0.0228e-3, True)):
        assert bool(of_codes(of_signals(logged(stamps=T + late * tenth)), *SAMPLING)) == jitters


@pytest.mark.parametrize(
    ("before", "after", "flags"),
    [
        (0.6, 0.0, "--start 0.602"),
        (0.0, 0.7, "--end 2.498"),
        (0.6, 0.7, "--start 0.602 --end 3.098"),
        (0.49, 0.49, ""),
        (0.499, 0.499, "--start 0.501 --end 2.997"),
    ],
)
def test_rest_lasts_until_a_thousandth_of_the_way(before: float, after: float, flags: str) -> None:
    """Joint 1 moves for 2.5 s at 1 rad/s: two samples of 1e-3 rad are within 2.5e-3 rad."""
    t = np.arange(round(1000 * (before + 2.5 + after)) + 1) * 1e-3
    pair = np.stack([np.clip(t - before, 0, 2.5), 0 * t])
    stamp_ns = np.arange(t.size) * 10**6
    log = Log(stamp_ns, pair, pair, Origin("arm.csv", "csv", {}))
    begin = flags.partition("--end")[0].rstrip()
    for whole, told in ((True, flags), (False, begin)):  # the end of a beginning is none
        found = of_codes(examine(log, lambda: None, whole=whole), "RESTS")
        assert [one.remedies[0].words for one in found] == [told] * bool(told)
        assert all(one.note for one in found)


def test_of_the_beginning_of_a_log_nothing_is_refused_and_the_place_is_told() -> None:
    log = logged(tau1=0 * T, tau2=0 * T)
    with pytest.raises(
        LogError, match=r"^arm\.csv: EFFORT_ZERO: tau1 is zero .*--accept EFFORT_ZERO$"
    ):
        noticed(log)
    told = noticed(log, whole=False)
    assert [one.code for one in told] == ["EFFORT_ZERO", "EFFORT_ZERO"]
    assert all(one.text.endswith(" (in its first 2 s)") for one in told)


def slowed(values: FloatArray, step: int) -> FloatArray:
    """A signal (N,) of which every so many samples are measured."""
    return values[np.arange(ROWS) // step * step]


@pytest.mark.parametrize("step", [2, 10, 20])
def test_a_held_torque_is_told_with_what_it_is_late(step: int) -> None:
    (found,) = of_codes(of_signals(logged(tau2=slowed(np.cos(2 * T) + T, step))), "HELD_EFFORT")
    assert (found.code, found.note, found.refuse) == ("HELD_EFFORT", False, False)
    assert found.numbers["held"] == pytest.approx(step)
    assert found.numbers["late"] == pytest.approx((step - 1) / 2)  # mean of 0 … step - 1 samples


def test_coarse_counts_and_logs_that_are_slow_as_a_whole_are_not_held() -> None:
    logs = [logged(slowed(np.cos(T), 10), slowed(np.cos(2 * T), 10))]
    for count in (1e-3, 1e-2, 0.1):  # of sines of amplitude one and more, with and without noise
        for noise in (0 * T, 0.3 * count * NOISE[0]):
            logs.append(logged(tau2=count * np.rint((np.sin(np.cos(T)) + noise) / count)))
    assert not [one for log in logs for one in of_codes(of_signals(log), "HELD_EFFORT")]


def test_dry_friction_makes_no_spikes_and_a_bus_does() -> None:
    """A joint turns back between two samples, or its torque changes while a step is logged."""
    omega = 30 * np.sin(2 * math.pi * 3 * T)
    turn = np.searchsorted(T, T[-1] / 2)
    omega = np.where(np.abs(T - T[turn]) < 6e-3, 5e5 * (T - T[turn]) ** 2 - 1e-6, omega)
    assert np.sign(omega[turn - 1 : turn + 2]).tolist() == [1, -1, 1]
    theta = np.cumsum(omega) * (T[1] - T[0]) + 3e-4 * NOISE[0]
    tau = 10 * np.sin(2 * math.pi * T) + 4 * np.tanh(omega / 1e-7) + 1e-2 * NOISE[1]
    assert not of_codes(of_signals(logged(theta, tau)), *SPIKES)
    tau[turn + 40] += 8.0
    (found,) = of_codes(of_signals(logged(theta, tau)), *SPIKES)
    assert found.numbers["count"] == 1


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ([0, 1, 2, 3, 4, 3, 2, 1], 0),
        ([1, 4, 4, 1, 4, 4, 1, 0, 0], 0),  # pairs
        ([1, 4, 4, 4, 1, 2, 0, 3], 1),
        ([1, 4, 4, 4, 4, 4, 2, 0, 0, 0], 4),
        ([4, 0, 4, 1, 2, 4], 1),  # from stop to stop
        ([3, 4, 2, 4, 4, 3, 0], 0),
        ([2, 2, 2, 2], 0),  # that never moves is none that stops
        ([0, 4], 0),
    ],
)
def test_samples_between_two_others_at_a_stop_are_counted(values: list[float], count: int) -> None:
    assert saturated_share(np.array(values, dtype=np.float64)) == pytest.approx(count / len(values))
