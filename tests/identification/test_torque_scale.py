"""What scales and mixes the torques: currents of motors whose constant is not known, a second
motor at the base, a unit that is advised where the fit shows an arm in it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import algid
from algid.arm import FloatArray
from algid.estimators import refined
from algid.identification.identify import identify
from algid.log import Log
from algid.settings import Settings
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines.accuracy_scenes import logged
from tests.estimators.conftest import problem_of
from tests.intervals import holds_95, in_axes

DT = 2e-3
CONSTANT = 0.093  # N m/A
CASE = load_case("case1")


@cache
def moved(*, loaded: bool) -> SimulatedMotion:
    k = CASE.arm.constants(CASE.payload if loaded else 0.0)
    return simulate(k, wide_multi_sine(CASE.arm, 3 + loaded), np.arange(2501) * DT)


def currents(*, loaded: bool, seed: int = 0) -> Log:
    """A log in amperes of motors with `CONSTANT`, read with a torque constant of 1."""
    motion, rng = moved(loaded=loaded), np.random.default_rng([seed, loaded])
    sigmas = 1e-3, 1e-2 / CONSTANT
    return logged(motion.t, motion.theta, motion.tau / CONSTANT, rng, sigmas)


def test_a_known_payload_tells_the_gain_of_the_torques() -> None:
    settings = Settings(model="plain", payload_mass=CASE.payload)
    result = identify(currents(loaded=False), currents(loaded=True), settings, report=False)
    gain = result.fit.torque_gain
    assert abs(gain.estimate - CONSTANT) < 4 * gain.std < 0.02 * CONSTANT
    for name, true in zip(("k1", "k4", "k7"), CASE.arm.constants()[[0, 3, 6]], strict=True):
        found = result.parameters[name]
        assert found.estimate * gain.estimate == pytest.approx(true, rel=0.03)
    l1 = result.payload["l1"]  # no gain changes a length
    assert l1.estimate == pytest.approx(CASE.arm.l1, rel=0.03)
    assert any("says to multiply by 0.09" in warning for warning in result.warnings)


@pytest.mark.slow
def test_intervals_hold_where_the_second_motor_stands_at_the_base() -> None:
    """Both joints' torques share the noise of the second motor."""
    motion, k = moved(loaded=False), CASE.arm.constants()

    def ratios(seed: int) -> FloatArray:
        noise = np.random.default_rng(seed).standard_normal((2, *motion.theta.shape))
        tau = motion.tau + 1e-2 * np.stack([noise[1, 0] + noise[1, 1], noise[1, 1]])
        log = Segment(0.0, DT, motion.theta + 1e-3 * noise[0], tau)
        fit = refined.fit(problem_of(log))
        return in_axes(fit.values - k, fit.covariance, fit.quantile)

    holds_95(np.array([ratios(seed) for seed in range(100)]))


@cache
def log_of(factor: float = 1.0) -> Log:
    """A log whose torques are `factor` times those in N m."""
    log = currents(loaded=False)
    return replace(log, tau=factor * CONSTANT * log.tau, omega=None)


HEAVY = "OTHER_UNIT:heavy"


def test_an_arm_of_lead_asks_for_the_unit_of_its_torques() -> None:
    """Torques in mN m that nobody labelled make every constant a thousand times too large."""
    (asked,) = [one for one in identify(log_of(1e3), report=False).notices if one.key == HEAVY]
    assert 200 < asked.numbers["mass"] < 350
    assert ": check the torque unit" in asked.clause
    (remedy,) = asked.remedies
    assert remedy.flags == ("--torque-unit", "mN m")
    arm = identify(log_of(), report=False)
    assert HEAVY not in {one.key for one in arm.notices}
    loaded = currents(loaded=True)
    for factor, seen in ((1, False), (1e3, True)):  # of a payload's log alone
        log = replace(loaded, tau=factor * CONSTANT * loaded.tau, omega=None)
        result = identify(None, log, parameters=arm, report=False)
        assert (HEAVY in {one.key for one in result.notices}) is seen


def test_the_gain_that_a_known_payload_shows_is_told_by_all_that_use_the_arm() -> None:
    unloaded, loaded = (
        algid.Log.from_arrays(log.t, log.theta, 0.8 * log.tau)
        for log in algid.synthesise("case1", duration=3.0, torque="wide", torque_noise=1e-3)
    )
    weak: dict[str, Any] = {"estimator": "weak", "model": "plain"}
    arm = algid.identify(unloaded, loaded, payload_mass=CASE.payload, **weak)
    assert arm.verdict.grade == "reservations"
    heard = [
        arm.notices,
        algid.identify(None, loaded, parameters=arm, **weak).notices,
        algid.track(loaded, arm).notices,
        algid.export(arm, "urdf").warnings,
    ]
    for notices in heard:
        (gain,) = (one.numbers["gain"] for one in notices if one.key == "TORQUE_GAIN:off")
        assert gain == pytest.approx(1.25, rel=0.02)
