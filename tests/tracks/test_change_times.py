"""When a payload changed, told by the rows around it; and what a log is cut to for them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import algid
from algid.log import Log
from algid.signals.differences import POINTS, Stencil
from algid.signals.segments import segments
from algid.synth.run import Acquisition, excitation, synthesise
from algid.tracks.change_times import (
    ChangeTime,
    confirmed,
    place,
    rows_of,
    step_response,
    windows,
)
from algid.tracks.drift import Drift
from tests.tracks.folders import CASE, carrier, noisy

ARM = carrier()
STEADY = Drift(np.array([0.0, 5.0]), np.zeros((2, 2)), np.zeros((4, 4)), np.zeros((1, 4)))


def rough(*moments: float) -> tuple[ChangeTime, ...]:
    """Changes as cells have them."""
    return tuple(ChangeTime(one, (one, one), (one - 0.1, one + 0.1), np.inf) for one in moments)


def kept(log: Log, moments: tuple[float, ...], masses: tuple[float, ...]) -> list[ChangeTime]:
    ends = (0.0, 4.5)
    return confirmed(lambda: segments([log]), ARM, STEADY, ends, 1.0, rough(*moments), masses)


def test_a_step_of_acceleration_is_seen_as_differences_see_it() -> None:
    """Second differences of ½ (t − s)₊² itself, and of a motion whose acceleration has been there
    for long.
    """
    dt, s = 2e-3, 0.0503
    t = dt * np.arange(60)
    seen = Stencil(dt).differences(np.tile(0.5 * np.maximum(t - s, 0.0) ** 2, (2, 1)))[2, 0]
    inner = t[POINTS // 2 : -(POINTS // 2)]
    np.testing.assert_allclose(step_response((inner - s) / dt), seen, atol=1e-9)
    far = step_response(np.array([-5.0, 5.0, 1e4]))
    np.testing.assert_allclose(far, [0.0, 1.0, 1.0], atol=1e-12)


def test_brackets_hold_the_time_of_the_change(picking: Log) -> None:
    rng, held, late = np.random.default_rng(0), [], []
    for _ in range(12):
        for found, moment in zip(
            kept(noisy(picking, rng), (1.6, 2.9), (0, 0.05, 0)), (1.5, 3.0), strict=True
        ):
            held.append(found.bracket[0] <= moment <= found.bracket[1])
            late.append(abs(found.time - moment))
            assert (
                found.safe[0] <= found.bracket[0] < found.time < found.bracket[1] <= found.safe[1]
            )
    assert sum(held) >= 20  # of 24 at 95 %: fewer are one chance in 200
    assert np.median(late) < 0.02


def test_a_sliver_beside_a_change_is_made_one_with_it_and_a_change_of_nothing_goes(
    picking: Log,
) -> None:
    log = noisy(picking, np.random.default_rng(1))
    found = kept(log, (1.55, 1.75, 2.3, 3.0), (0.0, 0.08, 0.05, 0.05, 0.0))
    assert [one.time for one in found] == pytest.approx([1.5, 3.0], abs=0.05)


def test_nothing_is_carried_for_less_than_a_fifth_of_a_second() -> None:
    """Whatever a jolt explains of the rows."""
    recording = Acquisition(duration=4.5)
    schedule = [(1.5, 0.4), (1.62, 0.2), (3.0, 0.0)]
    (log,) = synthesise(CASE, excitation(CASE, "wide"), recording, schedule=schedule)
    noise = np.random.default_rng(5)
    found = kept(noisy(log, noise), (1.5, 1.62, 3.0), (0.0, 0.4, 0.2, 0.0))
    assert [one.time for one in found] == pytest.approx([1.5, 3.0], abs=0.1)


def test_a_change_in_a_hole_is_left_where_cells_have_it(picking: Log) -> None:
    """Rows on one side of it show none."""
    log = noisy(picking, np.random.default_rng(6))
    sides = [log.part(0, 1400), log.part(1800, len(log))]
    (hidden, told) = confirmed(
        lambda: segments(sides), ARM, STEADY, (0.0, 4.5), 1.0, rough(1.8, 3.0), (0.0, 0.05, 0.0)
    )
    assert (hidden.time, hidden.bracket) == (1.8, (1.8, 1.8))
    assert told.time == pytest.approx(3.0, abs=0.05)


def test_rows_do_not_depend_on_how_a_log_was_cut(picking: Log) -> None:
    log = noisy(picking, np.random.default_rng(3))
    spans = [(0.5, 1.9), (1.7, 3.4)]
    whole = dict(windows(segments([log]), spans, 0.0))
    blocks = [log.part(first, min(first + 700, len(log))) for first in range(0, len(log), 700)]
    parts = dict(windows(segments(blocks), spans, 0.0))
    assert list(whole) == list(parts) == [0, 1]
    for at, piece in whole.items():
        np.testing.assert_array_equal(piece.theta, parts[at].theta)
        assert piece.start == pytest.approx(parts[at].start)


def test_the_residual_of_the_arm_and_its_payload_is_white(picking: Log) -> None:
    """Of variance one, on both sides of a change: its column explains what the payload adds,
    memory included.
    """
    log = noisy(picking, np.random.default_rng(4))
    (piece,) = (piece for _, piece in windows(segments([log]), [(0.5, 2.5)], 0.0))
    rows = rows_of(piece, ARM, STEADY, [1.5], [0.0, 0.05])
    left = rows.e - 0.05 * rows.steps(np.array([1.5]))[0]
    assert np.mean(left**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / left.size))
    behind = left[np.repeat((rows.t > 1.45) & (rows.t < 1.7), 2)]
    assert np.mean(behind**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / behind.size))
    found = place(rows, 1.3, 1.7, 1.0)
    assert found.time == pytest.approx(1.5, abs=0.03)
    # rows of a fifth of a second that err alike: what is explained counts by their scores' scatter
    x, a = rows.steps(np.array([found.time]))[0], rows.whitened(rows.g[None])[0]
    x -= (a @ x) / (a @ a) * a
    cluster = np.arange(x.size) // (2 * round(0.2 / rows.dt))
    e = rows.e + 20 * x * (-1.0) ** cluster
    alike = place(replace(rows, e=e), found.time, found.time, 1.0)
    score = x @ e / (x @ x)
    scatter = np.bincount(cluster, x * (e - (a @ e) / (a @ a) * a - score * x))
    assert alike.gain == pytest.approx(3 * (x @ e) ** 2 / (scatter @ scatter))
    assert alike.gain < 0.1 * found.gain


def test_brackets_hold_the_time_of_a_heavy_payload_amid_noisy_angles() -> None:
    noise: dict[str, Any] = {
        "position_noise": 1e-3,
        "torque_noise": 1e-2,
        "rate": 200.0,
        "torque": "wide",
    }
    arm = algid.identify(
        *algid.synthesise("case1", duration=4.0, seed=3, **noise), model="plain", report=False
    )
    for seed, time in ((22, 2.274), (24, 2.548), (26, 2.822)):
        schedule = [(time, 0.3)]
        log = algid.synthesise(
            "case1", duration=5.0, seed=seed, payload_schedule=schedule, **noise
        )[0]
        ((_, low, high),) = algid.track(log, arm).track.changes
        assert low <= time <= high


def test_a_heavy_payload_is_set_down_when_it_was_and_not_when_cells_had_it() -> None:
    """A trajectory that holds the masses had drawn changes to where cells have them, by 70 ms."""
    noise: dict[str, Any] = {"position_noise": 1e-3, "torque_noise": 1e-2, "torque": "wide"}
    arm = algid.identify(
        *algid.synthesise("case1", duration=4.0, seed=3, **noise), model="plain", report=False
    )
    schedule = [(1.2, 0.3), (2.6, 0.0), (4.1, 0.5), (5.5, 0.0)]
    log = algid.synthesise("case1", duration=7.0, seed=41, payload_schedule=schedule, **noise)[0]
    track = algid.track(log, arm).track
    for (_, low, high), (time, _) in zip(track.changes, schedule, strict=True):
        assert low <= time <= high
    # the jolts of changes are in no stretch: one had left 4 times the noise, and 0.494 for 0.5 kg
    assert track.colour < 2
    for stretch, mass in zip(track.stretches, (0.0, 0.3, 0.0, 0.5, 0.0), strict=True):
        assert abs(stretch.m_p - mass) < 3.5 * stretch.std
