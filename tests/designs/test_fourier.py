"""The family of motions against SymPy, and its limits on a grid finer than the search's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp

from algid.arm import FloatArray
from algid.designs.search import Fourier


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
