"""Logs of a case: schedules, rehearsals and controllers, against closed forms and the simulator by
pieces.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from algid.arm import Arm, FloatArray, inverse_dynamics, mass_matrix, with_payload
from algid.base.errors import SettingError
from algid.identification.identify import identify
from algid.log import Log
from algid.synth.cases import Case
from algid.synth.excitation import MultiSine, no_torque, wide_multi_sine
from algid.synth.follow import STIFFNESS, Reference, follow, read_plan
from algid.synth.run import Acquisition, rehearse, synthesise, with_schedule
from algid.synth.sensors import Sensors
from algid.synth.simulator import Driven, simulate, steered

ARM = Arm(2.0, 1.0, 0.2, 0.15, 0.4, 0.3, 0.03, 0.01, 0.5, 0.25)
CASE = Case("mine", ARM, 0.5, None, {})
WAVE = MultiSine(((4.0,), (1.5,)), ((0.7,), (1.1,)), ((0.0,), (0.4,)))
SHORT = Acquisition(rate=100.0, duration=0.6, initial=(-1.0, 0.3, 0.5, -0.2))


def loaded_constants(mass: float) -> FloatArray:
    return with_payload(ARM.constants(), ARM.payload_constants(mass))


def test_the_logs_of_a_case_are_the_simulators_motions() -> None:
    unloaded, loaded = synthesise(CASE, WAVE, SHORT)
    t = np.arange(61) / 100
    for log, mass, role in ((unloaded, 0.0, "unloaded"), (loaded, 0.5, "loaded")):
        motion = simulate(
            loaded_constants(mass), WAVE, t, np.array([-1.0, 0.3]), np.array([0.5, -0.2])
        )
        np.testing.assert_allclose(log.theta, motion.theta, atol=1e-12)
        np.testing.assert_allclose(log.tau, WAVE(t), atol=1e-12)
        assert log.origin.path == f"mine-{role}"
        assert log.origin.truth is not None
        assert (log.origin.truth.payload, log.origin.truth.case, log.origin.truth.arm) == (
            mass,
            "mine",
            ARM,
        )


def test_the_loaded_log_has_noise_of_its_own() -> None:
    noisy = replace(SHORT, sensors=Sensors(torque_noise=1.0, seed=7))
    first, second = synthesise(replace(CASE, payload=0.0), no_torque, noisy)
    assert abs(np.corrcoef(first.tau.ravel(), second.tau.ravel())[0, 1]) < 0.5
    again, _ = synthesise(
        CASE, no_torque, replace(SHORT, sensors=Sensors(torque_noise=1.0, seed=8))
    )
    np.testing.assert_array_equal(second.tau, again.tau)  # that of the next seed


def test_an_object_is_grasped_and_let_go_without_a_step() -> None:
    schedule = [(0.2, 0.5), (0.405, 0.0)]  # on a sample, and between two
    log = with_schedule(CASE, WAVE, SHORT, schedule)
    t = np.arange(61) / 100
    np.testing.assert_allclose(log.t, t, atol=1e-12)
    state, places = np.array(SHORT.initial), [0.0, 0.2, 0.405, 0.6]
    for (start, end), mass in zip(pairwise(places), (0.0, 0.5, 0.0), strict=True):
        own = t[(t >= start - 1e-9) & (t < end - 1e-9)]
        every = np.unique(np.concatenate([[start], own, [end]]))
        motion = simulate(loaded_constants(mass), WAVE, every, state[:2], state[2:])
        np.testing.assert_allclose(
            log.theta[:, np.isin(t, own)], motion.theta[:, np.isin(every, own)], atol=1e-10
        )
        state = np.concatenate([motion.theta[:, -1], motion.omega[:, -1]])
    assert log.origin.truth is not None
    assert log.origin.truth.schedule == ((0.2, 0.5), (0.405, 0.0))
    assert log.origin.truth.payload == 0.0
    assert log.origin.path == "mine-schedule"


def test_a_schedule_that_begins_at_once_or_after_the_log_is_a_constant_payload() -> None:
    unloaded, loaded = synthesise(CASE, WAVE, SHORT)
    np.testing.assert_allclose(
        with_schedule(CASE, WAVE, SHORT, [(0.0, 0.5)]).theta, loaded.theta, atol=1e-11
    )
    np.testing.assert_allclose(
        with_schedule(CASE, WAVE, SHORT, [(5.0, 0.5)]).theta, unloaded.theta, atol=1e-11
    )
    np.testing.assert_allclose(
        with_schedule(CASE, WAVE, SHORT, []).theta, unloaded.theta, atol=1e-11
    )


@pytest.mark.parametrize(
    "schedule",
    [
        [(1.0, 0.1), (1.0, 0.2)],
        [(2.0, 0.1), (1.0, 0.2)],
        [(1.0, -0.1)],
        [(1.0, np.inf)],
        [(np.nan, 0.1)],
    ],
)
def test_a_schedule_that_makes_no_sense_is_refused(schedule: list[tuple[float, float]]) -> None:
    with pytest.raises(
        ValueError, match="schedule must hold increasing times and payloads of 0 or more, got "
    ):
        with_schedule(CASE, WAVE, SHORT, schedule)


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
    plan = plan_of(ARM.constants(), loaded_constants(0.5))
    logs = rehearse(CASE, plan, Acquisition(rate=400.0, duration=1.0))
    assert [log.origin.path for log in logs] == ["mine-unloaded", "mine-loaded"]
    for log, torque in zip(logs, (plan.tau, plan.loaded_tau), strict=True):
        # the plan is a spline through knots at 200 Hz, of sixth order in their distance
        np.testing.assert_allclose(log.theta, plan.theta, atol=1e-7)
        np.testing.assert_allclose(log.tau, torque, atol=1e-3)
    (alone,) = rehearse(replace(CASE, payload=0.0), plan, Acquisition(rate=50.0, duration=0.1))
    assert alone.origin.path == "mine-unloaded"


def test_beyond_its_end_a_plan_holds_its_last_posture() -> None:
    plan = plan_of(ARM.constants(), loaded_constants(0.5))
    log: Log = rehearse(replace(CASE, payload=0.0), plan, Acquisition(rate=50.0, duration=1.6))[0]
    late = log.t > 1.3
    assert late.sum() > 10
    # at rest where gravity is what the plan's last torque holds, which is that of its last
    # acceleration too
    k = ARM.constants()
    still = np.zeros((2, 1))
    end = plan.theta[:, -1:]
    push = plan.tau[:, -1:] - inverse_dynamics(k, end, still, still)
    m11, m12, m22 = (value[0] for value in mass_matrix(k, end))
    error = np.linalg.solve(np.array([[m11, m12], [m12, m22]]), push) / STIFFNESS**2
    settled = np.repeat(end + error, late.sum(), axis=1)
    np.testing.assert_allclose(log.theta[:, late], settled, atol=0.1 * np.abs(error).max())


def test_the_controller_is_a_critically_damped_second_order_at_its_bandwidth() -> None:
    """Without gravity and Coriolis, M (θ̈ + 2 ω_c θ̇ + ω_c² θ) = 0: x₀ (1 + ω_c t) exp(−ω_c t)."""
    k = np.array([0.0, 0.0, 0.05, 0.0, 0.2, 0.0, 0.0])
    t = np.linspace(0, 0.1, 41)
    still = np.zeros((2, 5))
    plan = Reference(np.linspace(0, 1, 5), still, still, still, still)

    def controller(_times: FloatArray) -> Driven:
        def torque(theta: FloatArray, omega: FloatArray) -> FloatArray:
            push = -(STIFFNESS**2) * theta - 2 * STIFFNESS * omega
            return np.stack([0.25 * push[0] + 0.05 * push[1], 0.05 * push[0] + 0.05 * push[1]])

        return torque

    ours = steered(k, controller, t, np.array([0.1, -0.3]))
    exact = np.array([[0.1], [-0.3]]) * (1 + STIFFNESS * t) * np.exp(-STIFFNESS * t)
    np.testing.assert_allclose(ours.theta, exact, atol=1e-9)
    np.testing.assert_allclose(follow(k, plan, t, k, False, None).theta, 0.0, atol=1e-12)


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
        ("", (f"expected {HEAD.replace(',', ', ')}, found no column t; give what algid design "
             "wrote")),
        (f"{HEAD[:-5]}\n0,1,2,3,4,5\n1,1,2,3,4,5\n", "found no column tau2"),
        (f"{HEAD}\n0,1,2,3,4,5,6\n", "found no motion"),
        (f"{HEAD}\n0,1,2,3,4,5,6\n0,1,2,3,4,5,6\n", ("finite numbers at increasing times; write "
                                                    "the design anew")),
        (f"{HEAD}\n0,1,2,3,4,5,nan\n1,1,2,3,4,5,6\n", ("expected finite numbers at increasing "
                                                      "times")),
        (f"{HEAD}\n0,1,2,3,4,5\n1,1,2,3,4,5,6\n", "not the trajectory of a design ("),
        (f"{HEAD}\n0,1,2,3,4,5,six\n", ("not the trajectory of a design (could not convert string "
                                       "to float: 'six')")),
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


@pytest.mark.slow
def test_bent_links_and_a_body_at_the_tip_are_found_without_a_flag() -> None:
    """Centres of mass 10° off both links, a payload of 5 cm radius of gyration: all within their
    intervals' reach.
    """
    arm = Arm(
        4.0, 2.5, 0.2, 0.15, 0.4, 0.35, 0.06, 0.03, 0.8, 0.5, 9.81, np.radians(10), np.radians(10)
    )
    case = Case("bent", arm, 0.5, None, {}, (None, 0.0), 0.5 * 0.05**2)
    sensors = Sensors(position_noise=1e-4, torque_noise=2e-2, seed=1)
    logs = synthesise(
        case, wide_multi_sine(arm, 3), Acquisition(rate=500.0, duration=10.0, sensors=sensors)
    )
    unloaded, loaded = (replace(log, origin=replace(log.origin, truth=None)) for log in logs)
    result = identify(unloaded, loaded)
    names = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "k1s", "k2s", "k4s")
    truth = dict(zip(names, arm.phasors().tolist(), strict=True))
    truth |= {"m_p": 0.5, "l1": 0.4, "l2": 0.35, "J_p": 0.5 * 0.05**2}
    found = {name: one for name, one in result.estimates.items() if name in truth}
    assert set(found) == set(truth)
    for name, one in found.items():
        assert one.status == "OK", name
        assert one.estimate is not None
        assert one.std is not None
        assert abs(one.estimate - truth[name]) < 4 * one.std, name
    assert not result.fit.broken_bounds  # type: ignore[union-attr]
