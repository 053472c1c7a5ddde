"""Many arms swung open loop at once, each by a torque of its own: what a plan of torques does to all it is for.

Runge-Kutta of fourth order at a fixed step, which follows the fastest joint: friction over inertia.

======  ===============================================  =========
symbol  name                                             shape
======  ===============================================  =========
C       coefficients of the torque, a column an arm      (q, B)
s       angles and velocities                            (4, B)
M       inertia matrix                                   (2, 2, B)
======  ===============================================  =========
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.model import Model, Motion, friction_slope, regressor

_STABLE = 2.0  # largest product of step and fastest rate; the method's own limit is 2.8
_COARSEST = 0.01  # s
FINEST = 2e-4  # s: an arm that asks for less is taken to be slower than it is


@dataclass(frozen=True, eq=False)
class Swings:
    """Motions at equal steps: angles, velocities, accelerations (N, 2, B) at times t (N,) in s."""

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    alpha: FloatArray

    def motion(self, column: int) -> Motion:
        """The motion of one arm."""
        return Motion(*(signal[:, :, column].T.copy() for signal in (self.theta, self.omega, self.alpha)))


def step_for(model: Model, coefficients: FloatArray, duration: float) -> float:
    """A step in s, of which `duration` holds a whole number, that is stable for arms (q, B)."""
    fastest = 1.0
    for c in coefficients.T:
        still = np.zeros((2, 1))
        slope = friction_slope(model, model.values(c), still)[:, 0]
        inverse = np.linalg.inv(_inertia(model, c[:, None], still)[:, :, 0])
        fastest = max(fastest, float(np.abs(np.linalg.eigvals(inverse * slope)).max()))
    step = max(min(_COARSEST, _STABLE / fastest), FINEST)
    return duration / int(np.ceil(duration / step))


def swing(model: Model, C: FloatArray, torque: FloatArray, step: float, start: FloatArray) -> Swings:
    """Swing arms from rest at `start` (2,) rad.

    Parameters
    ----------
    model : Model
        Linear in its coefficients.
    C : (q, B)
    torque : (2 N + 1, 2, B), N m
        At every half step of `step` s.
    """
    steps = torque.shape[0] // 2
    state = np.zeros((4, C.shape[1]))
    state[:2] = start[:, None]
    states, slopes = np.empty((steps + 1, 4, C.shape[1])), np.empty((steps + 1, 2, C.shape[1]))
    for place in range(steps):
        before, middle, after = torque[2 * place : 2 * place + 3]
        first = _rate(model, C, state, before)
        second = _rate(model, C, state + 0.5 * step * first, middle)
        third = _rate(model, C, state + 0.5 * step * second, middle)
        fourth = _rate(model, C, state + step * third, after)
        states[place], slopes[place] = state, first[2:]
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    states[-1], slopes[-1] = state, _rate(model, C, state, torque[-1])[2:]
    return Swings(step * np.arange(steps + 1), states[:, :2], states[:, 2:], slopes)


def _rate(model: Model, C: FloatArray, state: FloatArray, torque: FloatArray) -> FloatArray:
    theta, omega = state[:2], np.clip(state[2:], -1e3, 1e3)
    passive = np.einsum("aqb,qb->ab", regressor(model, Motion(theta, omega, np.zeros_like(theta))), C)
    free = torque - passive
    M = _inertia(model, C, theta)
    determinant = M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0]
    return np.stack(
        [
            *omega,
            (M[1, 1] * free[0] - M[0, 1] * free[1]) / determinant,
            (M[0, 0] * free[1] - M[1, 0] * free[0]) / determinant,
        ]
    )


def _inertia(model: Model, C: FloatArray, theta: FloatArray) -> FloatArray:
    """M (2, 2, B) of eq. (2) with joint 2's rotor."""
    value = dict(zip(model.names, C, strict=True))
    coupling = value["k1"] * np.cos(theta[1])
    m12 = value["k3"] + coupling
    m22 = value["k3"] + value.get("j2", 0.0)
    return np.array([[value["k5"] + value["k3"] + 2 * coupling, m12], [m12, m22 + 0 * coupling]])


def sampled(t: FloatArray, motion: Motion, wanted: FloatArray) -> Motion:
    """The motion at the times `wanted` (N,), by cubics through angles and velocities, and through accelerations."""
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    theta = CubicHermiteSpline(t, motion.theta, motion.omega, axis=1)(wanted)
    omega = CubicHermiteSpline(t, motion.omega, motion.alpha, axis=1)(wanted)
    return Motion(theta, omega, CubicSpline(t, motion.alpha, axis=1)(wanted))
