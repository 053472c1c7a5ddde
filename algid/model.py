"""The torque of an arm with drives: eq. (1) and the columns that real joints add.

======  ==========================================  =========  =========
symbol  name                                        shape      unit
======  ==========================================  =========  =========
c       coefficients of the columns switched on     (q,)       `UNITS`
Y       regressor, τ = Y c                          (2, q, N)
f1, f2  Coulomb friction of the joints              scalars    N m
o1, o2  torque offsets                              scalars    N m
j2      rotor inertia of joint 2, at the joint      scalar     kg m^2
======  ==========================================  =========  =========

The rotor of joint 1 adds to k5 alone, which is why it has no column. Coulomb friction follows
tanh(ω / ω_s) instead of sign(ω), so that a velocity error near standstill does not flip a whole sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from algid.arm import CONSTANT_NAMES, CONSTANT_UNITS, FloatArray

COULOMB_NAMES = ("f1", "f2")
OFFSET_NAMES = ("o1", "o2")
ROTOR_NAMES = ("j2",)
COLUMN_NAMES = CONSTANT_NAMES + COULOMB_NAMES + OFFSET_NAMES + ROTOR_NAMES
UNITS = {
    **CONSTANT_UNITS,
    "f1": "N m",
    "f2": "N m",
    "o1": "N m",
    "o2": "N m",
    "j2": "kg m^2",
    "delay": "s",
    "m_p": "kg",
    "l1": "m",
    "l2": "m",
}


@dataclass(frozen=True)
class Model:
    """Which columns the torque has beside eq. (1).

    Parameters
    ----------
    coulomb, offset, rotor : bool
        Columns f1, f2; o1, o2; j2.
    gravity : float, m/s^2
        0 for an arm that moves in a horizontal plane: k2 and k4 have no column then.
    coulomb_speed : float, rad/s
        ω_s: speed at which Coulomb friction has reached three quarters of its value.
    """

    coulomb: bool = False
    offset: bool = False
    rotor: bool = False
    gravity: float = 9.81
    coulomb_speed: float = 0.2

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in their order."""
        names = [name for name in CONSTANT_NAMES if self.gravity != 0 or name not in ("k2", "k4")]
        names += COULOMB_NAMES if self.coulomb else ()
        names += OFFSET_NAMES if self.offset else ()
        names += ROTOR_NAMES if self.rotor else ()
        return tuple(names)

    @cached_property
    def columns(self) -> list[int]:
        """Where each column stands in `COLUMN_NAMES`."""
        return [COLUMN_NAMES.index(name) for name in self.names]

    def expand(self, c: FloatArray) -> FloatArray:
        """Coefficients of all `COLUMN_NAMES` (12,): zero where a column is switched off."""
        full = np.zeros(len(COLUMN_NAMES))
        full[self.columns] = c
        return full


@dataclass(frozen=True, eq=False)
class Motion:
    """Angles, velocities, accelerations (2, N) and what eq. (1) needs of them."""

    theta: FloatArray
    omega: FloatArray
    alpha: FloatArray

    @cached_property
    def trigonometry(self) -> tuple[FloatArray, ...]:
        """Sine and cosine of θ1, of θ2 and of θ1 + θ2, each (N,)."""
        (s1, s2), (c1, c2) = sine_cosine(self.theta)
        return s1, c1, s2, c2, s1 * c2 + c1 * s2, c1 * c2 - s1 * s2


def sine_cosine(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of angles, each in the shape of `theta`, through one tangent of the half angle.

    Exact to a unit in the last place of 1, also where the tangent has its poles. NumPy has vector instructions
    for the tangent on more processors than for sine and cosine: this is several times faster there.
    """
    half = np.tan(0.5 * theta)
    square = half * half
    scale = 1 / (1 + square)
    return 2 * half * scale, (1 - square) * scale


def regressor(model: Model, motion: Motion) -> FloatArray:
    """Y (2, q, N) with τ = Y c: eq. (1) and the model's further columns."""
    _, c1, s2, c2, _, c12 = motion.trigonometry
    omega1, omega2 = motion.omega
    alpha1, alpha2 = motion.alpha
    Y = np.zeros((2, len(model.names), c1.size))
    column = {name: Y[:, place] for place, name in enumerate(model.names)}
    column["k1"][0] = c2 * (2 * alpha1 + alpha2) - s2 * (2 * omega1 + omega2) * omega2
    column["k1"][1] = c2 * alpha1 + s2 * omega1**2
    column["k3"][:] = alpha1 + alpha2
    column["k5"][0] = alpha1
    column["k6"][0] = omega1
    column["k7"][1] = omega2
    if model.gravity != 0:
        column["k2"][:] = c12
        column["k4"][0] = c1
    if model.coulomb:
        friction = np.tanh(motion.omega / model.coulomb_speed)
        column["f1"][0], column["f2"][1] = friction
    if model.offset:
        column["o1"][0] = 1.0
        column["o2"][1] = 1.0
    if model.rotor:
        column["j2"][1] = alpha2
    return Y


def partials(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """Derivatives (3, 2, 2, N) of the torque: order of θ's derivative, torque of joint, angle of joint."""
    k1, k2, k3, k4, k5, k6, k7, f1, f2, _, _, j2 = model.expand(c)
    s1, _, s2, c2, s12, _ = motion.trigonometry
    omega1, omega2 = motion.omega
    alpha1, alpha2 = motion.alpha
    k1_s2, k1_c2, k2_s12 = k1 * s2, k1 * c2, k2 * s12
    P = np.empty((3, 2, 2, s1.size))
    position, velocity, acceleration = P
    position[0, 0] = -k4 * s1 - k2_s12
    position[0, 1] = -k1_s2 * (2 * alpha1 + alpha2) - k1_c2 * (2 * omega1 + omega2) * omega2 - k2_s12
    position[1, 0] = -k2_s12
    position[1, 1] = k1_c2 * omega1**2 - k1_s2 * alpha1 - k2_s12
    velocity[0, 0] = k6 - 2 * k1_s2 * omega2
    velocity[0, 1] = -2 * k1_s2 * (omega1 + omega2)
    velocity[1, 0] = 2 * k1_s2 * omega1
    velocity[1, 1] = k7
    acceleration[0, 0] = k5 + k3 + 2 * k1_c2
    acceleration[0, 1] = acceleration[1, 0] = k3 + k1_c2
    acceleration[1, 1] = k3 + j2
    if model.coulomb:
        slope = (1 - np.tanh(motion.omega / model.coulomb_speed) ** 2) / model.coulomb_speed
        velocity[0, 0] += f1 * slope[0]
        velocity[1, 1] += f2 * slope[1]
    return P
