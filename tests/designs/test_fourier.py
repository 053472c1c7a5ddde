"""The family of motions against SymPy, and its limits on a grid finer than the search's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp

from algid.arm import FloatArray
from algid.designs.position import Fourier, middles


def by_sympy(wave: str) -> list[Callable[..., FloatArray]]:
    """A windowed wave of velocity one and its two derivatives, of time, frequency and rise, while
    the window rises.
    """
    t, omega, rise = sp.symbols("t omega rise")
    s = t / rise
    window = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    expression = window * getattr(sp, wave)(omega * t) / omega
    return [
        sp.lambdify((t, omega, rise), sp.diff(expression, t, order), "numpy") for order in range(3)
    ]


@pytest.mark.parametrize("duration", [1.5, 12.0])
def test_waves_and_their_derivatives_are_those_of_sympy(duration: float) -> None:
    family = Fourier(duration)
    rise = min(0.1 * duration, 1.0)
    t = np.array([0.1, 0.5, 0.95]) * rise
    whole = np.array([1.1 * rise, 0.3 * duration, 0.7 * duration])  # where the window is one
    early, flat, late = (family.basis(times) for times in (t, whole, duration - t))
    omega = family.harmonics[:, None]
    count = family.harmonics.size
    for half, wave in ((slice(0, count), "sin"), (slice(count, None), "cos")):
        # towards the end the window is mirrored, and so are the waves: whole periods fit, a sine
        # is odd
        odd = -1 if wave == "sin" else 1
        for order, function in enumerate(by_sympy(wave)):
            expected = function(t, omega, rise)
            np.testing.assert_allclose(
                early[order, half], expected, atol=1e-11 * np.abs(expected).max()
            )
            mirrored = odd * (-1) ** order * expected
            np.testing.assert_allclose(
                late[order, half], mirrored, atol=1e-9 * np.abs(expected).max()
            )
            # each derivative is a quarter of a period ahead
            turned = omega * whole + order * np.pi / 2
            np.testing.assert_allclose(
                flat[order, half], getattr(np, wave)(turned) * omega ** (order - 1.0), atol=1e-9
            )


def test_a_motion_is_its_centre_and_its_waves() -> None:
    family = Fourier(1.5)
    x = family.random(np.random.default_rng(3), np.array([0.4, -0.2]))
    basis = family.basis(np.array([0.3, 0.7]))
    a1, b1, a2, b2 = x[2:].reshape(4, family.harmonics.size)
    found = family.motion(x, basis)
    for joint, weights in enumerate((np.concatenate([a1, b1]), np.concatenate([a2, b2]))):
        np.testing.assert_allclose(found.theta[joint], x[joint] + weights @ basis[0], rtol=1e-13)
        np.testing.assert_allclose(found.omega[joint], weights @ basis[1], rtol=1e-12)
        np.testing.assert_allclose(found.alpha[joint], weights @ basis[2], rtol=1e-12)


@pytest.mark.parametrize("duration", [0.5, 4.0, 60.0])
def test_the_window_rises_and_falls_alike_with_a_jerk_that_vanishes_at_its_ends(
    duration: float,
) -> None:
    family = Fourier(duration)
    t = np.linspace(0, duration, 2001)
    value, slope, bend = family.window(t)
    assert np.all((value >= 0) & (value <= 1))
    np.testing.assert_allclose(value, value[::-1], atol=1e-9)
    np.testing.assert_allclose(slope, -slope[::-1], atol=1e-9 / duration)
    np.testing.assert_allclose(bend, bend[::-1], atol=1e-6 / duration**2)
    rise = min(0.1 * duration, 1.0)
    np.testing.assert_array_equal(value[(t > rise) & (t < duration - rise)], 1.0)
    # angle, velocity and acceleration, and the jerk as the acceleration's slope, vanish where the
    # window meets 0 and 1
    for edge, level in ((0.0, 0.0), (rise, 1.0), (duration - rise, 1.0), (duration, 0.0)):
        at = family.window(np.array([edge]))[:, 0]
        np.testing.assert_allclose(at, [level, 0, 0], atol=1e-9)
        h = 1e-6 * rise
        jerk = np.diff(family.window(np.array([edge - h, edge + h]))[2])[0] / (2 * h)
        assert abs(jerk) < 1e-2 / rise**3


@pytest.mark.parametrize(
    ("duration", "numbers"),
    [
        (0.5, range(1, 6)),  # five at least, whatever their frequency
        (4.0, range(1, 9)),  # up to 2 Hz
        (10.0, range(1, 21)),
        # twenty at most
        (
            60.0,
            [1, 7, 14, 20, 26, 32, 39, 45, 51, 57, 64, 70, 76, 82, 89, 95, 101, 107, 114, 120],
        ),
    ],
)
def test_harmonics_reach_two_hertz_and_are_no_more_than_twenty(
    duration: float, numbers: list[int]
) -> None:
    family = Fourier(duration)
    np.testing.assert_allclose(family.harmonics * duration / (2 * np.pi), list(numbers), rtol=1e-12)
    assert family.size == 2 + 4 * len(list(numbers))


def test_the_gradient_is_the_transpose_of_the_motion() -> None:
    """The motion is linear in x: for any weights, ⟨weights, motion(x)⟩ = ⟨gradient(weights), x⟩."""
    family, rng = Fourier(3.0), np.random.default_rng(8)
    basis = family.basis(middles(3.0, 40.0))
    weights = rng.standard_normal((5, 6, 120))
    x = rng.standard_normal(family.size)
    motion = family.motion(x, basis)
    signals = np.concatenate([motion.theta, motion.omega, motion.alpha])
    np.testing.assert_allclose(
        family.gradient(weights, basis) @ x, np.einsum("bcn,cn->b", weights, signals), rtol=1e-10
    )
    np.testing.assert_allclose(
        family.gradient(weights[2], basis), family.gradient(weights, basis)[2], rtol=1e-12
    )


def test_middles_are_in_the_middle_of_equal_samples() -> None:
    np.testing.assert_allclose(middles(2.0, 3.0), [1 / 6, 3 / 6, 5 / 6, 7 / 6, 9 / 6, 11 / 6])
    np.testing.assert_allclose(middles(2.1, 1.0), [0.525, 1.575])
    np.testing.assert_allclose(middles(0.1, 1.0), [0.05])


def test_random_motions_have_as_much_velocity_in_each_harmonic() -> None:
    family = Fourier(4.0)
    rng = np.random.default_rng(0)
    drawn = np.array([family.random(rng, np.array([0.1, 0.2])) for _ in range(2000)])
    np.testing.assert_array_equal(drawn[:, :2], [[0.1, 0.2]] * 2000)
    np.testing.assert_allclose(drawn[:, 2:].std(axis=0), 1.0, atol=5 / np.sqrt(4000))
