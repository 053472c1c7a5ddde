"""The two-link arm: Páez-García et al. 2023, eq. (1), (2), Tables 1 and 2.

======  ==================================  ==========  ===============
symbol  name                                shape       unit
======  ==================================  ==========  ===============
theta   joint angles θ1, θ2                 (2, ...)    rad
omega   joint velocities θ̇1, θ̇2             (2, ...)    rad/s
alpha   joint accelerations θ̈1, θ̈2          (2, ...)    rad/s^2
tau     joint torques τ1, τ2                (2, ...)    N m
k       constants k1 … k7 (Table 1)         (7,)        `algid.model.UNITS`
z       payload constants z1 … z5 (Table 2) (5,)        kg m^2 and N m
m_p     tip payload                         scalar      kg
======  ==================================  ==========  ===============

θ1 is measured from the horizontal, θ2 from link 1; gravity pulls along −y. An arm with a payload
obeys the same equations with other constants, so everything below serves both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]  # float64 throughout; numpy types its arithmetic no tighter


def read_only(array: FloatArray) -> FloatArray:
    """A view of `array` that cannot be written to: what is handed out stays as it was."""
    view = array.view()
    view.flags.writeable = False
    return view


def keep_arrays(holder: object) -> None:
    """Make the arrays of a frozen dataclass `read_only`."""
    for name, value in list(vars(holder).items()):
        if isinstance(value, np.ndarray):
            object.__setattr__(holder, name, read_only(value))


CONSTANT_NAMES = ("k1", "k2", "k3", "k4", "k5", "k6", "k7")


@dataclass(frozen=True)
class Arm:
    """Physical parameters of a 2-DOF arm without payload (Table 3), in SI units.

    Parameters
    ----------
    m1, m2 : float, kg
    lc1, lc2 : float, m, from each joint to its link's centre of gravity
    l1, l2 : float, m
    I1, I2 : float, kg m^2, about each link's centre of gravity
    b1, b2 : float, N m s/rad
    g : float, m/s^2, 0 for an arm that moves in a horizontal plane
    delta1, delta2 : float, rad
        How far each link's centre of gravity is turned off the link's line, seen from its joint.
    """

    m1: float
    m2: float
    lc1: float
    lc2: float
    l1: float
    l2: float
    I1: float
    I2: float
    b1: float
    b2: float
    g: float = 9.81
    delta1: float = 0.0
    delta2: float = 0.0

    def constants(self, m_p: float = 0.0) -> FloatArray:
        """Constants k1 … k7 (Table 1): (7,), in `algid.model.UNITS`; with `m_p` kg at the tip.

        Of phasors the parts along the links.
        """
        return self.phasors(m_p)[:7]

    def sines(self) -> FloatArray:
        """The sine parts of k1, k2 and k4: (3,), in their units.

        Nothing where the links are straight.
        """
        return self.phasors()[7:]

    def phasors(
        self, m_p: float = 0.0, x: float | None = None, y: float = 0.0, J: float = 0.0
    ) -> FloatArray:
        """Constants k1 … k7 and their sine parts (10,) of the arm with a payload of `m_p` kg.

        Its centre of mass is at `x` (the tip by default), `y` m in the frame of link 2, its
        inertia about it is `J`. The payload's share is that of eq. (5) against eq. (3).
        """
        one, two = self.lc1 * np.exp(1j * self.delta1), self.lc2 * np.exp(1j * self.delta2)
        at = complex(self.l2 if x is None else x, y)
        z1, z2, z3, z4, z5 = payload_phasors(m_p, self.l1, at, J, self.g)
        K1 = self.m2 * self.l1 * two + z3
        K2 = self.m2 * self.g * two + z5
        k3 = self.I2 + self.m2 * self.lc2**2 + z2
        K4 = self.m1 * self.g * one + self.m2 * self.g * self.l1 + z4
        k5 = self.I1 + self.m1 * self.lc1**2 + self.m2 * self.l1**2 + z1
        along = [K1.real, K2.real, k3, K4.real, k5, self.b1, self.b2]
        return np.array([*along, K1.imag, K2.imag, K4.imag])

    def payload_constants(self, m_p: float) -> FloatArray:
        """Constants z1 … z5 of a tip payload of `m_p` kg (Table 2): (5,), in kg m^2 and N m."""
        return np.real(payload_phasors(m_p, self.l1, self.l2, 0.0, self.g))


def payload_phasors(
    m_p: float, l1: float, r: complex, J: float, g: float, turn: float = 0.0
) -> tuple[float, float, complex, complex, complex]:
    """Constants z1, z2 and phasors z3, z4, z5 of a payload that is a body.

    Parameters
    ----------
    m_p : float, kg
    l1 : float, m, length of link 1
    r : complex, m
        Its centre of mass x + i y in the frame of link 2: x along the link from joint 2.
    J : float, kg m^2, its inertia about its centre of mass
    g : float, m/s^2
    turn : float, rad
        What has to be added to the logged θ1 to be the angle from the horizontal.

    Notes
    -----
    Table 2 for y = J = 0.
    """
    upright = g * m_p * complex(np.cos(turn), np.sin(turn))
    return m_p * l1**2, m_p * abs(r) ** 2 + J, m_p * l1 * r, upright * l1, upright * r


Moment = tuple[FloatArray, FloatArray | None]
"""A phasor as its cosine and sine part, None where the arm is straight: of one arm or of many."""


def _moments(k: FloatArray) -> tuple[Moment, Moment, Moment]:
    """The moments k1, k2 and k4 of constants (7, ...), or with their sine parts (10, ...)."""
    if len(k) == 7:
        return (k[0], None), (k[1], None), (k[3], None)
    return (k[0], k[7]), (k[1], k[8]), (k[3], k[9])


def _cosine(moment: Moment, angle: FloatArray) -> FloatArray:
    """Real part of (c + i s) exp(i angle) for a moment (c, s).

    It is written out, so that it stays analytic in `moment`: derivatives by complex steps pass
    through.
    """
    along, across = moment
    if across is None:
        return along * np.cos(angle)
    return along * np.cos(angle) - across * np.sin(angle)


def _sine(moment: Moment, angle: FloatArray) -> FloatArray:
    """Imaginary part of (c + i s) exp(i angle) for a moment (c, s)."""
    along, across = moment
    if across is None:
        return along * np.sin(angle)
    return along * np.sin(angle) + across * np.cos(angle)


def mass_matrix(k: FloatArray, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M11, M12 = M21 and M22 of eq. (2) at `theta` (2, ...), each (...) in kg m^2.

    `k` is (7,), or (10,) of phasors.
    """
    first, _, _ = _moments(k)
    k3, k5 = k[2], k[4]
    coupling = _cosine(first, theta[1])
    return k5 + k3 + 2 * coupling, k3 + coupling, np.full_like(coupling, k3)


def passive_torque(k: FloatArray, theta: FloatArray, omega: FloatArray) -> FloatArray:
    """V + U + W of eq. (1): the torque (2, ...) in N m that the arm needs at zero acceleration.

    `k` as for M.
    """
    first, second, fourth = _moments(k)
    k6, k7 = k[5], k[6]
    theta1, theta2 = theta
    omega1, omega2 = omega
    k1_s2 = _sine(first, theta2)
    k2_c12 = _cosine(second, theta1 + theta2)
    k4_c1 = _cosine(fourth, theta1)
    return np.stack(
        [
            -k1_s2 * (2 * omega1 + omega2) * omega2 + k6 * omega1 + k4_c1 + k2_c12,
            k1_s2 * omega1**2 + k7 * omega2 + k2_c12,
        ]
    )


def inverse_dynamics(
    k: FloatArray, theta: FloatArray, omega: FloatArray, alpha: FloatArray
) -> FloatArray:
    """Torque (2, ...) in N m that moves the arm so: eq. (1)."""
    m11, m12, m22 = mass_matrix(k, theta)
    inertial = np.stack([m11 * alpha[0] + m12 * alpha[1], m12 * alpha[0] + m22 * alpha[1]])
    return inertial + passive_torque(k, theta, omega)


def forward_dynamics(
    k: FloatArray, theta: FloatArray, omega: FloatArray, tau: FloatArray
) -> FloatArray:
    """Acceleration (2, ...) in rad/s^2 under the torque `tau` (2, ...): eq. (1) solved for θ̈."""
    m11, m12, m22 = mass_matrix(k, theta)
    free1, free2 = tau - passive_torque(k, theta, omega)
    determinant = m11 * m22 - m12 * m12
    return np.stack([m22 * free1 - m12 * free2, m11 * free2 - m12 * free1]) / determinant
