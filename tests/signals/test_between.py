"""The torque within an interval against integrals and polynomials by hand."""

from __future__ import annotations

import numpy as np
import pytest

from algid.signals.between import KNOTS, between

STEPS = 5


@pytest.mark.parametrize("late", [0.0, 0.3, 0.5, 1.0, 2.7, -0.4])
def test_a_step_sees_the_mean_of_a_held_torque(late: float) -> None:
    tau = np.random.default_rng(0).standard_normal((2, 40))
    u = between(late, STEPS, held=True).at_stages(tau, 10, 12)
    for interval in range(12):
        for step in range(STEPS):
            # a thousand instants within the step, none of them on a jump
            at = 10 + interval + (step + (np.arange(1000) + 0.5) / 1000) / STEPS - late
            mean = tau[:, np.floor(at).astype(int)].mean(axis=1)
            for stage in range(3):
                # one instant more or less on the far side of the jump
                assert u[step, stage, :, interval] == pytest.approx(mean, abs=5e-3)


@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, -0.4])
@pytest.mark.parametrize("points", [2, 6, KNOTS])
def test_an_even_torque_is_a_polynomial_through_its_samples(late: float, points: int) -> None:
    coefficients = np.random.default_rng(1).standard_normal((2, points))

    def torque(t: np.ndarray) -> np.ndarray:
        return np.stack([np.polyval(row, (t - 20) / 20) for row in coefficients])

    tau = torque(np.arange(40.0))
    u = between(late, STEPS, held=False, points=points).at_stages(tau, 12, 10)
    for step in range(STEPS):
        for stage in range(3):
            at = 12 + np.arange(10) + (step + stage / 2) / STEPS - late
            # weights of 12 points cancel by factors up to a thousand
            np.testing.assert_allclose(u[step, stage], torque(at), atol=1e-9)


def test_eight_hertz_at_fifty_are_followed_to_a_ten_thousandth() -> None:
    def torque(t: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(2 * np.pi * 8 * t), np.cos(2 * np.pi * 8 * t)])

    tau = torque(np.arange(100) / 50)
    u = between(0.0, STEPS, held=False).at_stages(tau, 10, 80)
    at = (10 + np.arange(80) + 0.5 / STEPS) / 50
    np.testing.assert_allclose(u[0, 1], torque(at), atol=1e-4)


def test_before_and_after_the_log_its_ends_go_on() -> None:
    tau = np.array([[1.0, 2.0, 4.0], [0.0, 1.0, 0.0]])
    u = between(1.0, 1, held=True).at_stages(tau, 0, 2)
    np.testing.assert_allclose(u[0, 0], [[1.0, 1.0], [0.0, 0.0]])
