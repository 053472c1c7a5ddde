"""The simulator against closed forms, energy, and another integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from algid.arm import forward_dynamics
from algid.base.errors import SettingError
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
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
    for times in (np.zeros(1), np.zeros(2)):
        with pytest.raises(ValueError, match="at least two increasing times"):
            simulate(K, lambda now: np.zeros((2, now.size)), times)
