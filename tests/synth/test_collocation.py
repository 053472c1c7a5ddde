"""Gauss collocation against closed forms and another library's integrator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from algid.arm import FloatArray
from algid.base.limits import PHYSICAL
from algid.synth.collocation import Acceleration, integrate

Timed = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


def at(acceleration: Timed) -> Callable[[FloatArray], Acceleration]:
    return lambda times: lambda theta, omega: acceleration(times, theta, omega)


def test_a_pendulum_swings_as_jacobi_s_elliptic_sine() -> None:
    top = 2.5
    modulus = np.sin(top / 2) ** 2
    t = np.linspace(0, 20, 173)
    states = integrate(at(lambda _t, theta, _omega: -np.sin(theta)), np.array([top, 0.0]), t)
    exact = 2 * np.arcsin(np.sqrt(modulus) * ellipj(ellipk(modulus) - t, modulus)[0])
    np.testing.assert_allclose(states[0], exact, atol=1e-10)


def test_corners_between_and_on_samples_are_met() -> None:
    # a push that begins and ends: velocity and angle in closed form
    corners = np.array([0.1, 0.25, 0.2501, 0.7])
    t = np.linspace(0, 1, 11)
    levels = np.array([0.0, 3.0, -7.0, 2.0, 0.0])

    def pushed(times: FloatArray, theta: FloatArray, _omega: FloatArray) -> FloatArray:
        return np.broadcast_to(levels[np.searchsorted(corners, times)], theta.shape)

    states = integrate(at(pushed), np.zeros(2), t, corners)
    edges = np.concatenate([[0.0], corners, [1.0]])
    spans = np.clip(t[:, None] - edges[:-1], 0, np.diff(edges))
    after = t[:, None] - edges[:-1] - spans  # time since each push ended
    np.testing.assert_allclose(states[1], spans @ levels, atol=1e-13)
    np.testing.assert_allclose(
        states[0], (spans**2 / 2 + spans * np.maximum(after, 0)) @ levels, atol=1e-13
    )


def test_a_motion_without_bound_is_refused_before_it_gets_there() -> None:
    def accelerate(_t: FloatArray, theta: FloatArray, _omega: FloatArray) -> FloatArray:
        return 6 * theta**2  # θ(0) = 1, θ̇(0) = 2: θ = (1 − t)^−2 and θ̇ = 2 (1 − t)^−3

    fastest = PHYSICAL.speed[1]
    reached = 1 - (2 / fastest) ** (1 / 3)  # s, when θ̇ is that fast
    with pytest.raises(ArithmeticError, match=r"faster than \d+ rad/s beyond (\S+) s") as refused:
        integrate(at(accelerate), np.array([1.0, 2.0]), np.array([0.0, 2.0]))
    beyond = float(str(refused.value).split()[-2])
    assert reached <= beyond < 1
