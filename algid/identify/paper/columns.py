"""Columns of the paper's linear systems: Páez-García et al. 2023, eq. (3), (4) and (5).

======  ========================================  ============  ==========
symbol  name                                      shape         unit
======  ========================================  ============  ==========
t       time since the window's start             (n,)          s
theta   joint angles θ1, θ2                       (2, ..., n)   rad
omega   joint velocities θ̇1, θ̇2                   (2, ..., n)   rad/s
tau     joint torques τ1, τ2                      (2, ..., n)   N m
======  ========================================  ============  ==========

Each equation is t² times a row of eq. (1), integrated twice from the window's start; t² removes the initial
conditions. The angles enter linear terms as differences to their first value, which changes nothing (those
terms vanish for a constant) and keeps digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.integrals import integral, nested_integral


@dataclass(frozen=True, eq=False)
class Columns:
    """What multiplies each unknown after t² and two integrations, each (..., n); and the torque's own integral.

    `inertia1` and `inertia2` multiply θ̈1 and θ̈2, `viscous1` and `viscous2` θ̇1 and θ̇2.
    """

    inertia1: FloatArray
    coupling1: FloatArray
    inertia2: FloatArray
    viscous1: FloatArray
    gravity1: FloatArray
    gravity12: FloatArray
    torque1: FloatArray
    coupling2: FloatArray
    viscous2: FloatArray
    torque2: FloatArray

    def first_joint(self) -> FloatArray:
        """The coefficients (6, ..., n) of x_r = [k5+k3, k1, k3, k6, k4, k2] in eq. (3)."""
        return np.stack([self.inertia1, self.coupling1, self.inertia2, self.viscous1, self.gravity1, self.gravity12])


def columns(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float) -> Columns:
    """The integrals of eq. (3) and (4) over windows that start at the first sample: see `Columns`."""
    t = dt * np.arange(theta.shape[-1], dtype=np.float64)
    omega1, omega2 = omega
    c2, s2 = np.cos(theta[1]), np.sin(theta[1])
    moved = theta - theta[..., :1]
    return Columns(
        inertia1=_of_acceleration(moved[0], t, dt),
        coupling1=_of_derivative(c2 * (2 * omega1 + omega2), t, dt),
        inertia2=_of_acceleration(moved[1], t, dt),
        viscous1=_of_derivative(moved[0], t, dt),
        gravity1=nested_integral(t**2 * np.cos(theta[0]), dt, 2),
        gravity12=nested_integral(t**2 * np.cos(theta[0] + theta[1]), dt, 2),
        torque1=nested_integral(t**2 * tau[0], dt, 2),
        coupling2=_of_derivative(c2 * omega1, t, dt) + nested_integral(t**2 * s2 * omega1 * (omega1 + omega2), dt, 2),
        viscous2=_of_derivative(moved[1], t, dt),
        torque2=nested_integral(t**2 * tau[1], dt, 2),
    )


def _of_acceleration(angle: FloatArray, t: FloatArray, dt: float) -> FloatArray:
    """∫^(2) t² θ̈ = t² θ − 4 ∫ t θ + 2 ∫^(2) θ."""
    return t**2 * angle + integral(2 * integral(angle, dt) - 4 * t * angle, dt)


def _of_derivative(signal: FloatArray, t: FloatArray, dt: float) -> FloatArray:
    """∫^(2) t² ḟ = ∫ t² f − 2 ∫^(2) t f."""
    return integral(t**2 * signal - 2 * integral(t * signal, dt), dt)


def stack_rows(first: FloatArray, dt: float, rows: int) -> FloatArray:
    """Rows (rows, ..., n): the first row, then each the integral of the one before (P_r and P_m's build)."""
    stacked = np.empty((rows, *first.shape))
    stacked[0] = first
    for row in range(1, rows):
        stacked[row] = integral(stacked[row - 1], dt)
    return stacked
