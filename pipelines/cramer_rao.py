"""The Cramér-Rao bound of a two-link arm's constants and payload, by a road of its own.

Angles are measured with white noise, and so are the torques that drive the arm. Linearised along
the true motion, the arm is a linear system driven by the torque's noise; a Kalman filter whitens
what the angles tell, and the sensitivity of its innovations to the initial state and to the
parameters gives Fisher's information (Friedland 1969, separated bias). Nothing is shared with
`algid.estimators`: no stencil, no window, no regressor.

======  ====================================================  =======================
symbol  name                                                  shape
======  ====================================================  =======================
x       state: two angles, two velocities                     (4,)
p       parameters: k1 … k7, then m_p, l1, l2 with a payload  (7,) or (10,)
F, B, E  derivatives of ẋ by x, by the torque, by p           (N, 4, 4), (N, 4, 2), …
======  ====================================================  =======================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray, forward_dynamics

_STEP = 1e-30  # complex step: derivatives exact to rounding


@dataclass(frozen=True, eq=False)
class Truth:
    """True motion of a log at its samples: t (N,), theta, omega, tau (2, N)."""

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    tau: FloatArray


Constants = Callable[[FloatArray], FloatArray]
"""The arm's constants of parameters p, which may be complex."""


def of_payload(m_p: float, l1: float, l2: float, gravity: float) -> FloatArray:
    """What a payload at the tip adds to k1 … k7 (Table 2); a complex number stays one."""
    return m_p * np.array([l1 * l2, gravity * l2, l2**2, gravity * l1, l1**2, 0.0, 0.0])


def information(
    truth: Truth, p: FloatArray, gravity: float, sigma_theta: float, sigma_tau: float, loaded: bool
) -> FloatArray:
    """Fisher's information on p (len(p), len(p)) of one log, its initial state unknown."""

    def constants(q: FloatArray) -> FloatArray:
        if loaded:
            return q[:7] + of_payload(q[7], q[8], q[9], gravity)
        return q[:7]

    return information_on(truth, p, constants, sigma_theta, sigma_tau)


def information_on(
    truth: Truth, p: FloatArray, constants: Constants, sigma_theta: float, sigma_tau: float
) -> FloatArray:
    """The same on parameters p of which `constants` makes those of the arm that moves."""
    dt = float(truth.t[1] - truth.t[0])
    F, B, E = _linear(truth, p, constants)
    A, Bd, Ed = _discrete(F, B, E, dt)
    count = 4 + p.size
    V = np.hstack([np.eye(4), np.zeros((4, p.size))])
    P = np.zeros((4, 4))
    total = np.zeros((count, count))
    R = sigma_theta**2 * np.eye(2)
    for step in range(truth.t.size):
        weight = np.linalg.inv(P[:2, :2] + R)
        total += V[:2].T @ weight @ V[:2]
        if step == truth.t.size - 1:
            break
        gain = P[:, :2] @ weight
        V = A[step] @ (V - gain @ V[:2])
        V[:, 4:] += Ed[step]
        P = A[step] @ (P - gain @ P[:2]) @ A[step].T + sigma_tau**2 * Bd[step] @ Bd[step].T
    start, cross, rest = total[:4, :4], total[:4, 4:], total[4:, 4:]
    return rest - cross.T @ np.linalg.solve(start, cross)


def _linear(
    truth: Truth, p: FloatArray, constants: Constants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """F, B, E at the middle of each interval, by complex steps."""
    middle = [
        0.5 * (signal[:, 1:] + signal[:, :-1]) for signal in (truth.theta, truth.omega, truth.tau)
    ]
    n = middle[0].shape[1]

    def rate(theta: FloatArray, omega: FloatArray, tau: FloatArray, q: FloatArray) -> FloatArray:
        return np.concatenate([omega, forward_dynamics(constants(q), theta, omega, tau)])

    def slope(group: int, row: int) -> FloatArray:
        moved = [signal.astype(complex) for signal in middle]
        q = p.astype(complex)
        if group == 3:
            q[row] += 1j * _STEP
        else:
            moved[group][row] += 1j * _STEP
        return np.imag(rate(moved[0], moved[1], moved[2], q)) / _STEP

    F = np.stack([slope(group, row) for group in (0, 1) for row in (0, 1)], axis=-1)
    B = np.stack([slope(2, row) for row in (0, 1)], axis=-1)
    E = np.stack([slope(3, row) for row in range(p.size)], axis=-1)
    assert F.shape == (4, n, 4)
    return F.swapaxes(0, 1), B.swapaxes(0, 1), E.swapaxes(0, 1)


def _discrete(
    F: FloatArray, B: FloatArray, E: FloatArray, dt: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Transition over a sample and the integrals of what drives it, to fourth order in dt."""
    eye = np.eye(4)
    integral = dt * (eye + F @ (eye * dt / 2 + F @ (eye * dt**2 / 6 + F * dt**3 / 24)))
    return eye + F @ integral, integral @ B, integral @ E


def joint_bound(
    bare: Truth,
    burdened: Truth,
    p: FloatArray,
    gravity: float,
    sigma_theta: float,
    sigma_tau: float,
) -> FloatArray:
    """Least standard deviations (10,) of k1 … k7, m_p, l1, l2 from an unloaded and a loaded log."""
    total = information(burdened, p, gravity, sigma_theta, sigma_tau, loaded=True)
    total[:7, :7] += information(bare, p[:7], gravity, sigma_theta, sigma_tau, loaded=False)
    return np.sqrt(np.diag(np.linalg.inv(total)))
