"""Logs of a case: schedules, rehearsals and controllers, against closed forms and the simulator by
pieces.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from algid.arm import Arm, FloatArray, inverse_dynamics
from algid.base.errors import SettingError
from algid.synth.cases import Case
from algid.synth.excitation import MultiSine
from algid.synth.follow import Reference, read_plan
from algid.synth.run import Acquisition, synthesise
from algid.synth.simulator import simulate

ARM = Arm(2.0, 1.0, 0.2, 0.15, 0.4, 0.3, 0.03, 0.01, 0.5, 0.25)
CASE = Case("mine", ARM, 0.5, None, {})
WAVE = MultiSine(((4.0,), (1.5,)), ((0.7,), (1.1,)), ((0.0,), (0.4,)))
SHORT = Acquisition(rate=100.0, duration=0.6, initial=(-1.0, 0.3, 0.5, -0.2))


def test_an_object_is_grasped_and_let_go_without_a_step() -> None:
    schedule = [(0.2, 0.5), (0.405, 0.0)]  # on a sample, and between two
    (log,) = synthesise(CASE, WAVE, SHORT, schedule=schedule)
    t = np.arange(61) / 100
    np.testing.assert_allclose(log.t, t, atol=1e-12)
    state, places = np.array(SHORT.initial), [0.0, 0.2, 0.405, 0.6]
    for (start, end), mass in zip(pairwise(places), (0.0, 0.5, 0.0), strict=True):
        own = t[(t >= start - 1e-9) & (t < end - 1e-9)]
        every = np.unique(np.concatenate([[start], own, [end]]))
        motion = simulate(ARM.constants(mass), WAVE, every, state[:2], state[2:])
        np.testing.assert_allclose(
            log.theta[:, np.isin(t, own)], motion.theta[:, np.isin(every, own)], atol=1e-10
        )
        state = np.concatenate([motion.theta[:, -1], motion.omega[:, -1]])
    assert log.origin.truth.schedule == ((0.2, 0.5), (0.405, 0.0))
    assert log.origin.truth.payload == 0.0
    assert log.origin.path == "mine-schedule"


@pytest.mark.parametrize(
    "schedule",
    [
        [(1.0, 0.1), (1.0, 0.2)],
        [(2.0, 0.1), (1.0, 0.2)],
        [],
    ],
)
def test_a_schedule_that_makes_no_sense_is_refused(schedule: list[tuple[float, float]]) -> None:
    with pytest.raises(SettingError, match=r"^--payload-schedule: expected increasing times"):
        synthesise(CASE, WAVE, SHORT, schedule=schedule)


def test_each_log_tells_in_samples_how_far_it_is() -> None:
    told = list[tuple[str, int, int]]()
    synthesise(CASE, WAVE, SHORT, lambda *step: told.append(step))
    for role in ("unloaded", "loaded"):
        done = [count for stage, count, _ in told if stage == role]
        assert done == sorted(set(done))
        assert 1 < done[0] < done[-1] == 61
    assert {(stage, total) for stage, _, total in told} == {("unloaded", 61), ("loaded", 61)}


@pytest.mark.parametrize(("rate", "duration"), [(2.0, 0.1), (1e6, 1e6)])
def test_a_log_of_no_step_or_of_too_many_is_refused(rate: float, duration: float) -> None:
    with pytest.raises(SettingError, match=r"^--duration: .* Hz are .* samples; expected 2 to "):
        Acquisition(rate=rate, duration=duration)


def plan_of(k: FloatArray, loaded: FloatArray, amplitude: float = 0.4) -> Reference:
    t = np.arange(401) / 400
    wave = 2 * np.pi * t
    theta = np.stack([-1.2 + amplitude * (1 - np.cos(wave)), 0.5 * amplitude * (1 - np.cos(wave))])
    omega = np.stack([np.ones(401), np.full(401, 0.5)]) * amplitude * 2 * np.pi * np.sin(wave)
    alpha = np.stack([np.ones(401), np.full(401, 0.5)]) * amplitude * 4 * np.pi**2 * np.cos(wave)
    return Reference(
        t, theta, omega, *(inverse_dynamics(c, theta, omega, alpha) for c in (k, loaded))
    )


def test_an_arm_that_is_as_believed_follows_its_plan() -> None:
    plan = plan_of(ARM.constants(), ARM.constants(0.5))
    logs = synthesise(CASE, plan, Acquisition(rate=400.0, duration=1.0))
    assert [log.origin.path for log in logs] == ["mine-unloaded", "mine-loaded"]
    for log, torque in zip(logs, (plan.tau, plan.loaded_tau), strict=True):
        # the plan is a spline through knots at 200 Hz, of sixth order in their distance
        np.testing.assert_allclose(log.theta, plan.theta, atol=1e-7)
        np.testing.assert_allclose(log.tau, torque, atol=1e-3)
    (alone,) = synthesise(replace(CASE, payload=0.0), plan, Acquisition(rate=50.0, duration=0.1))
    assert alone.origin.path == "mine-unloaded"


HEAD = "t,theta1,theta2,omega1,omega2,tau1,tau2"


def test_a_plan_is_read_with_or_without_the_loaded_torque(tmp_path: Path) -> None:
    rows = "5,1,2,3,4,5,6,7,8\n5.5,1,2,3,4,5.5,6.5,7.5,8.5\n"
    (tmp_path / "trajectory.csv").write_text(
        f"{HEAD},loaded_tau1,loaded_tau2\n{rows}", encoding="utf-8"
    )
    plan = read_plan(tmp_path)
    np.testing.assert_array_equal(plan.t, [0, 0.5])
    assert plan.duration == 0.5
    np.testing.assert_array_equal(plan.omega, [[3, 3], [4, 4]])
    np.testing.assert_array_equal(plan.tau, [[5, 5.5], [6, 6.5]])
    np.testing.assert_array_equal(plan.loaded_tau, [[7, 7.5], [8, 8.5]])
    (tmp_path / "bare.csv").write_text(f"{HEAD}\n0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n", encoding="utf-8")
    bare = read_plan(tmp_path / "bare.csv")
    np.testing.assert_array_equal(bare.loaded_tau, bare.tau)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "not the trajectory of a design ("),
        (f"{HEAD[:-5]}\n0,1,2,3,4,5\n1,1,2,3,4,5\n", "no column 'tau2'; give what algid design"),
        (f"{HEAD}\n0,1,2,3,4,5,6\n", "expected finite numbers at increasing times"),
        (f"{HEAD}\n0,1,2,3,4,5,6\n0,1,2,3,4,5,6\n", "expected finite numbers at increasing times"),
        (f"{HEAD}\n0,1,2,3,4,5,nan\n1,1,2,3,4,5,6\n", "expected finite numbers at increasing"),
        (f"{HEAD}\n0,1,2,3,4,5\n1,1,2,3,4,5,6\n", "not the trajectory of a design ("),
        (f"{HEAD}\n0,1,2,3,4,5,six\n", "(could not convert string to float: 'six')"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_plan_is_refused(text: str, found: str, tmp_path: Path) -> None:
    file = tmp_path / "plan.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SettingError) as refused:
        read_plan(file)
    assert str(refused.value).startswith(f"{file}: ")
    assert found in str(refused.value)
    with pytest.raises(SettingError, match="expected what algid design wrote"):
        read_plan(tmp_path)
