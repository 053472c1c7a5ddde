"""A motion, and the widths that give friction its shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from algid.arm import FloatArray


@dataclass(frozen=True)
class Widths:
    """The widths of friction.

    Parameters
    ----------
    coulomb_speed : float, rad/s
        ω_s: speed at which Coulomb friction has reached three quarters of its value.
    stribeck_speed : float, rad/s
        ω_S: speed at which a third of Stribeck's additional friction is left.
    """

    coulomb_speed: float = 0.2
    stribeck_speed: float = 0.3


@dataclass(frozen=True, eq=False)
class Motion:
    """Angles, velocities, accelerations (2, N) and what eq. (1) needs of them.

    `load` (3, 2, N) is what bends the joints where they are elastic, in N m, with its two rates.
    """

    theta: FloatArray
    omega: FloatArray
    alpha: FloatArray
    load: FloatArray | None = None

    @cached_property
    def trigonometry(self) -> tuple[FloatArray, ...]:
        """Sine and cosine of θ1, of θ2 and of θ1 + θ2, each (N,)."""
        (s1, s2), (c1, c2) = sine_cosine(self.theta)
        return s1, c1, s2, c2, s1 * c2 + c1 * s2, c1 * c2 - s1 * s2


def sine_cosine(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of angles, each in the shape of `theta`, by one tangent of the half angle.

    Exact to a unit in the last place of 1, also where the tangent has its poles. NumPy has vector
    instructions for the tangent on more processors than for sine and cosine: this is several times
    faster there.
    """
    half = np.tan(0.5 * theta)
    square = half * half
    scale = 1 / (1 + square)
    return 2 * half * scale, (1 - square) * scale
