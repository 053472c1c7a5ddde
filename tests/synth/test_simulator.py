"""The simulator against closed forms, energy, and another integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from algid.arm import forward_dynamics
from algid.base.errors import SettingError
from algid.synth.cases import load_case
from algid.synth.excitation import Hold, SampledTorque, Torque, wide_multi_sine
from algid.synth.run import Acquisition, held, synthesise
from algid.synth.simulator import simulate

CASE = load_case("case1")
K = CASE.arm.constants()


def test_angles_agree_with_another_integrator() -> None:
    torque = wide_multi_sine(CASE.arm)
    t = np.linspace(0, 0.3, 4)
    motion = simulate(K, torque, t)

    def rate(now: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [y[2:], forward_dynamics(K, y[:2], y[2:], torque(np.array([now]))[:, 0])]
        )

    other = solve_ivp(
        rate, (0, 0.3), [-np.pi / 2, 0, 0, 0], method="LSODA", t_eval=t, rtol=1e-11, atol=1e-12
    ).y
    np.testing.assert_allclose(motion.theta, other[:2], atol=1e-9)


def test_a_torque_that_no_arm_bears_is_refused() -> None:
    with pytest.raises(SettingError, match=r"grows without bound .* weaker torque"):
        simulate(K, lambda now: np.full((2, now.size), 1e30), np.linspace(0, 1, 11))


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_sampled_torque_is_integrated_from_corner_to_corner(hold: str) -> None:
    knots = np.linspace(0, 0.2, 21)
    tau = np.random.default_rng(3).normal(0, 0.5, (2, knots.size))
    torque = SampledTorque(knots, tau, hold)  # type: ignore[arg-type]
    coarse, fine = np.linspace(0, 0.2, 3), np.linspace(0, 0.2, 401)
    first, second = simulate(K, torque, coarse), simulate(K, torque, fine)
    np.testing.assert_allclose(first.theta, second.theta[:, ::200], atol=1e-11)


@pytest.mark.parametrize("hold", [None, "zoh"])
def test_the_simulation_tells_how_far_it_is_and_changes_nothing_by_it(hold: Hold | None) -> None:
    recording = Acquisition(rate=200.0, duration=0.5)
    torque: Torque = wide_multi_sine(CASE.arm)
    torque = torque if hold is None else held(torque, recording.rate, recording.duration, hold)
    calls: list[tuple[str, int, int]] = []
    watched = synthesise(CASE, torque, recording, lambda *call: calls.append(call))
    for stage in ("unloaded", "loaded"):
        done = [(done, total) for told, done, total in calls if told == stage]
        assert done == sorted(done)
        assert done[-1] == (101, 101)
    for log, alone in zip(watched, synthesise(CASE, torque, recording), strict=True):
        np.testing.assert_array_equal(log.theta, alone.theta)
