"""What a driver calls effort: told by the logs, named, or said by a flag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import algid
from algid.api.identify import identify
from algid.arm import CONSTANT_NAMES, FloatArray, inverse_dynamics, passive_torque
from algid.base.errors import LogError, SettingError
from algid.inspection.checks import inspect_log
from algid.log import Log
from algid.notices import has_code
from algid.profile import Profile
from algid.results import Result, read_result
from algid.settings import Settings
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from algid.writers import write_log
from tests.cli.commands import call
from tests.golden.scenes import log_of, times
from tests.intervals import distances
from tests.readers.headers import opened

CHANCE = 4.5  # standard deviations: once in 150 000
CASE = load_case("case1")
ARM = CASE.arm.constants()
LOADED = CASE.arm.phasors(CASE.payload)[:7]


@cache
def moved(loaded: bool) -> SimulatedMotion:
    wide = wide_multi_sine(CASE.arm, 5 + loaded)
    return simulate(LOADED if loaded else ARM, wide, times(duration=3.0))


def weight(k: FloatArray, motion: SimulatedMotion) -> FloatArray:
    only = np.array([0.0, k[1], 0.0, k[3], 0.0, 0.0, 0.0])
    return passive_torque(only, motion.theta, np.zeros_like(motion.theta))


def of_payload(motion: SimulatedMotion) -> FloatArray:
    alpha = np.gradient(motion.omega, motion.t, axis=1)
    return inverse_dynamics(LOADED - ARM, motion.theta, motion.omega, alpha)


def friction(motion: SimulatedMotion) -> FloatArray:
    return ARM[5:, None] * motion.omega


Taken = Callable[[SimulatedMotion, float], FloatArray]
TAKEN: dict[str, Taken] = {
    "raw": lambda motion, _: np.zeros_like(motion.tau),
    "gravity-compensated": lambda motion, _: weight(ARM, motion),
    "payload-compensated": lambda motion, loaded: weight(LOADED if loaded else ARM, motion),
    "friction-compensated": lambda motion, _: friction(motion),
    "external": lambda motion, loaded: motion.tau - loaded * of_payload(motion),
}
"""What a driver takes off the torque before it logs it."""


def logs(effort: str) -> tuple[Log, Log]:
    bare, burdened = (
        log_of(moved(loaded), moved(loaded).tau - TAKEN[effort](moved(loaded), loaded), loaded)
        for loaded in (False, True)
    )
    return bare, burdened


@cache
def told(effort: str) -> Result:
    return identify(*logs(effort), report=False)


def right(result: Result, names: str = "m_p l1 l2") -> None:
    truth = dict(zip(CONSTANT_NAMES, ARM.tolist(), strict=True))
    truth |= {"m_p": CASE.payload, "l1": CASE.arm.l1, "l2": CASE.arm.l2}
    wanted = [truth[name] for name in names.split()]
    assert np.abs(distances(result, wanted, names.split())).max() < CHANCE


def codes(result: Result) -> set[str]:
    return {notice.code for notice in result.notices}


def test_an_unloaded_arm_without_weight_may_lie_or_be_compensated() -> None:
    result = identify(logs("gravity-compensated")[0], report=False)
    assert result.complete
    (notice,) = (one for one in result.notices if one.code == "GRAVITY_COMPENSATED")
    flags = [remedy.flags for remedy in notice.remedies]
    assert flags == [("--effort", "gravity-compensated"), ("--gravity", "0")]
    right(result, "k1 k3 k5 k6 k7")


@pytest.mark.parametrize("said", [{"effort": "gravity-compensated"}, {"gravity": 0.0}])
def test_weight_that_is_said_not_to_be_there_is_named(said: dict[str, Any]) -> None:
    log = logs("raw")[0]
    found = identify(log, report=False, **said)
    assert found.verdict.failed
    assert "effort and gravity" in found.verdict.reasons[0].text
    remedy = found.verdict.reasons[0].remedy
    assert identify(log, report=False, **{**said, **remedy.settings}).verdict.grade == "good"


def test_a_payload_that_is_compensated_too_needs_a_length() -> None:
    result = told("payload-compensated")
    assert not result.complete
    assert "GRAVITY_COMPENSATED" in codes(result)
    (asked,) = (one for one in result.notices if one.key == "GRAVITY_COMPENSATED:stated")
    assert asked.remedies[0].flags == ("--l1", "M")
    given = identify(*logs("payload-compensated"), report=False, l1=CASE.arm.l1)
    assert given.complete
    right(given, "m_p l2")


@pytest.mark.parametrize(
    ("effort", "code"),
    [("friction-compensated", "FRICTION_COMPENSATED"), ("external", "EXTERNAL_EFFORT")],
)
def test_other_efforts_are_named_and_their_flag_gives_the_payload(effort: str, code: str) -> None:
    (named,) = (one for one in told(effort).notices if one.code == code)
    assert named.remedies[0].flags == ("--effort", effort)
    result = identify(*logs(effort), report=False, **named.remedies[0].settings)
    assert result.complete
    assert not result.verdict.failed
    right(result)


def test_a_raw_torque_says_nothing_of_effort() -> None:
    assert codes(told("raw")) == set()
    assert told("raw").settings["effort"] is None


def test_a_force_sensor_that_rests_is_no_fault() -> None:
    log = logs("external")[1]
    tau = log.tau.copy()
    tau[:, len(log) // 3 : 2 * len(log) // 3] = 0.0
    resting = replace(log, tau=tau)
    said = Profile(effort="external")
    assert not has_code(inspect_log(resting, said).findings, "SENSOR_FAULT")
    assert has_code(inspect_log(resting).findings, "SENSOR_FAULT")


def test_external_torque_needs_no_unloaded_log(tmp_path: Path) -> None:
    write_log(tmp_path / "arm.csv", logs("external")[1])
    typed = ["--loaded", str(tmp_path / "arm.csv"), "--effort", "external", "--no-report"]
    assert call("identify", *typed, "-o", str(tmp_path)).code == 0
    result = read_result(tmp_path / "arm.algid")
    right(result)
    assert set(result.parameters) <= {"o1", "o2", "delay"}


def test_a_result_of_compensated_torque_predicts_and_serves_later_payloads() -> None:
    result = told("gravity-compensated")
    for log, loaded in zip(logs("gravity-compensated"), (False, True), strict=True):
        found = algid.Result.of(result).predict(log, loaded=loaded).drop_nans()
        left = found["tau1"] - found["tau1_predicted"]
        assert np.std(left.to_numpy()) < 0.1 * np.std(found["tau1"].to_numpy())
    again = identify(None, logs("gravity-compensated")[1], report=False, parameters=result)
    assert again.settings["effort"] == "gravity-compensated"
    right(again)


def test_contradictions_have_one_line() -> None:
    for wrong in (
        lambda: Settings(effort="external", gravity=1.62),
        lambda: identify(logs("raw")[0], profile={"effort": "external", "gravity": 9.7}),
        lambda: Settings(effort="friction-compensated", model="coulomb"),
    ):
        with pytest.raises(SettingError, match=r"^--(effort external|model): ") as raised:
            wrong()
        assert "\n" not in str(raised.value)
    with pytest.raises(SettingError, match=r"or --effort external, found unloaded ones alone$"):
        identify(logs("raw")[0], effort="external")


def test_a_current_is_in_amperes() -> None:
    with pytest.raises(LogError, match="torque_constant"):
        opened(["t", "q1", "q2", "tau1", "tau2"], {"effort": "current"})
    assert Settings().but(effort="command").effort == "command"
