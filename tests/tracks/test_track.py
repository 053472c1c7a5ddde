"""Payloads in time: found where they change, weighed within their intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import algid
from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.identification.identify import identify
from algid.log import Log
from algid.signals.segments import segments
from algid.synth.run import Acquisition, excitation, synthesise
from algid.tracks import drift
from algid.tracks.cells import CELL
from algid.tracks.payload import HALF_BAND, track
from algid.tracks.result import Track
from algid.writers import write_log
from tests.intervals import holds_95, holds_at_least_95
from tests.tracks.folders import CASE, RUBBING, carrier, noisy, rubbing

MASSES = (0.0, 0.05, 0.0)


def _track(log: Log, k: FloatArray | None = None, covariance: FloatArray | None = None) -> Track:
    known = np.zeros((9, 9)) if covariance is None else covariance
    return track(lambda: segments([log]), carrier(k=k), known)


def test_changes_of_50_g_are_found(picking: Log) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        found = _track(noisy(picking, rng))
        assert [stretch.end for stretch in found.stretches] == pytest.approx(
            [1.5, 3.0, 4.5], abs=0.1
        )
        for stretch, mass in zip(found.stretches, MASSES, strict=True):
            assert abs(stretch.m_p - mass) < 4.5 * stretch.std < 0.01


@pytest.mark.slow
def test_masses_lie_within_their_intervals() -> None:
    """Those of stretches, and those of m_p(t) at two instants a stretch that have no cell in
    common.
    """
    (log,) = synthesise(
        CASE,
        excitation(CASE, "wide"),
        Acquisition(rate=250.0, duration=4.5),
        schedule=[(1.5, 0.05), (3.0, 0.0)],
    )
    rng = np.random.default_rng(0)
    stretches, instants = [], []
    for _ in range(110):
        found = _track(noisy(log, rng))
        assert len(found.stretches) == 3
        stretches += [
            (s.m_p - m) / (1.959964 * s.std) for s, m in zip(found.stretches, MASSES, strict=True)
        ]
        for number, mass in enumerate(MASSES):
            own = np.flatnonzero(found.stretch == number)
            apart = own[[own.size // 4, 3 * own.size // 4]]
            assert np.diff(found.t[apart]) > 2 * HALF_BAND + CELL
            instants += [*(found.m_p[apart] - mass) / (1.959964 * found.std[apart])]
    holds_at_least_95(np.array(stretches))
    holds_95(np.array(instants))


@pytest.mark.parametrize("drifts", [False, True])
def test_an_uncertain_arm_widens_the_intervals_by_what_moves_the_masses(
    picking: Log, drifts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Constants and lengths off by a standard deviation in two directions: the masses' moves,
    squared and added.

    Whether or not friction is free to follow.
    """
    monkeypatch.setattr(drift, "SURE", -np.inf if drifts else np.inf)
    log = replace(picking, omega=None)  # without noise, so that the changes stay where they are
    known = np.array([*CASE.arm.constants(), CASE.arm.l1, CASE.arm.l2])
    spread = 1e-3 * known * np.random.default_rng(2).standard_normal((2, 9))
    before = _track(log)
    moves = []
    for k, (l1, l2) in ((known[:7] + step[:7], known[7:] + step[7:]) for step in spread):
        after = track(lambda: segments([log]), carrier(None, k, l1, l2), np.zeros((9, 9)))
        moves.append(
            [a.m_p - b.m_p for a, b in zip(after.stretches, before.stretches, strict=True)]
        )
    wider = _track(log, covariance=spread.T @ spread)
    found = [a.std**2 - b.std**2 for a, b in zip(wider.stretches, before.stretches, strict=True)]
    np.testing.assert_allclose(found, np.square(moves).sum(axis=0), rtol=0.05)


@pytest.mark.parametrize("known", [0.0, 0.12])
def test_friction_that_changed_biases_no_mass(picking: Log, known: float) -> None:
    """Friction of 0.1 N m, of an arm identified with less or with more: χ² of the masses' errors.

    Where rows are linearised at the arm's friction instead of that of the log, masses are off by
    two to three of their own deviations, all to one side.
    """
    k = np.append(CASE.arm.constants(), [known, known])
    arm = carrier(RUBBING, k)
    log, rng, errors = rubbing(picking, 0.1), np.random.default_rng(0), []
    for _ in range(6):
        noise = noisy(log, rng)
        found = track(lambda log=noise: segments([log]), arm, np.zeros((11, 11)))  # type: ignore[misc]
        for stretch, mass in zip(found.stretches, MASSES, strict=True):
            errors.append((stretch.m_p - mass) / stretch.std)
    low, high = chi2.interval(1 - 1e-3, len(errors))
    assert low < np.sum(np.square(errors)) < high


def test_slow_errors_of_the_torque_pass_for_no_payload(picking: Log) -> None:
    """As unmodelled friction does, they alternate between the joints' turning points."""
    log = picking.part(0, 1500)
    slow = 0.05 * np.sin(2 * np.pi * 1.7 * log.t + np.array([[0.0], [1.0]]))
    found = _track(replace(noisy(log, np.random.default_rng(5)), tau=log.tau + slow))
    assert len(found.stretches) == 1
    assert found.colour > 5
    low, high = found.stretches[0].ci95
    assert low < 0 < high


def test_errors_of_the_constants_are_no_colour(picking: Log) -> None:
    rng = np.random.default_rng(7)
    k = CASE.arm.constants()
    covariance = np.zeros((9, 9))
    covariance[:7, :7] = np.diag((1e-2 * k) ** 2)
    wrong = k * (1 + 1e-2 * rng.standard_normal(7))
    log = noisy(picking, rng)
    assert _track(log, wrong, covariance).colour < _track(log, wrong).colour / 3


@pytest.mark.parametrize("suffix", ["mcap", "parquet", "csv"])
def test_a_log_carries_its_schedule(picking: Log, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picking.{suffix}"
    write_log(path, picking.part(0, 50), truth=picking.origin.truth)
    truth = algid.read_log(path).origin.truth
    assert truth.schedule == ((1.5, 0.05), (3.0, 0.0))
    with pytest.raises(LogError, match="the payload changes; weigh it with algid track"):
        identify(path)


def test_held_torques_move_a_payload_as_they_were_held() -> None:
    """Slow samples of a held torque are no torque amid them: 0.2 g, six deviations, were seen."""
    noise = {"position_noise": 1e-4, "torque_noise": 1e-3, "torque": "wide"}
    held: dict[str, Any] = noise | {"torque_hold": "zoh", "rate": 100.0}
    arm = algid.identify(*algid.synthesise("case2", duration=10.0, **held), model="plain")
    log = algid.synthesise("case2", duration=6.0, payload_schedule=[(3.0, 0.3)], **held)[0]
    found = algid.track(log, arm).track
    for stretch, mass in zip(found.stretches, (0.0, 0.3), strict=True):
        assert abs(stretch.m_p - mass) < 4 * stretch.std < 1e-3
    assert found.colour < 1.5
