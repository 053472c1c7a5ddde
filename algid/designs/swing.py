"""Simulate many arms open loop at once, each under its own torque.

Runge-Kutta of fourth order at a fixed step, which follows the fastest joint: friction over inertia.

======  ===============================================  =========
symbol  name                                             shape
======  ===============================================  =========
C       coefficients of the torque, a column an arm      (q, B)
s       angles and velocities                            (4, B)
M       inertia matrix with joint 2's rotor              (2, 2)
======  ===============================================  =========
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.model import Model, Motion, acceleration, damping, inertia

_STABLE = 2.0  # largest product of step and fastest rate; the method's own limit is 2.8
_COARSEST = 0.01  # s
_LOOK = 32  # steps, from one look to the next whether motions are lost
FAST = 1e3  # rad/s: what no arm reaches, lest one that breaks all bounds overflows
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
        return Motion(
            self.theta[:, :, column].T.copy(),
            self.omega[:, :, column].T.copy(),
            self.alpha[:, :, column].T.copy(),
        )


def step_for(model: Model, coefficients: FloatArray, duration: float) -> float:
    """A step in s, of which `duration` holds a whole number, that is stable for arms (q, B)."""
    fastest, still = 1.0, np.zeros((2, 1))
    for c in coefficients.T:
        M = inertia(model, c, still)[..., 0]
        fastest = max(
            fastest, float(np.abs(np.linalg.eigvals(np.linalg.inv(M) * damping(model, c))).max())
        )
    step = max(min(_COARSEST, _STABLE / fastest), FINEST)
    return duration / int(np.ceil(duration / step))


def swing(
    model: Model,
    C: FloatArray,
    torque: FloatArray,
    step: float,
    start: FloatArray,
    lost: Callable[[FloatArray], bool] | None = None,
) -> Swings:
    """Swing arms from rest at `start` (2,) rad.

    Parameters
    ----------
    model : Model
        Linear in its coefficients.
    C : (q, B)
    torque : (2 N + 1, 2, B), N m
        At every half step of `step` s.
    lost : callable
        Asked now and then whether states (4, B) are such that the rest does not matter: the
        motions end there.
    """

    def rate(state: FloatArray, torque: FloatArray) -> FloatArray:
        omega = np.clip(state[2:], -FAST, FAST)
        return np.concatenate([omega, acceleration(model, C, state[:2], omega, torque)])

    steps = torque.shape[0] // 2
    state = np.zeros((4, C.shape[1]))
    state[:2] = start[:, None]
    states, slopes = np.empty((steps + 1, 4, C.shape[1])), np.empty((steps + 1, 2, C.shape[1]))
    for place in range(steps):
        if lost is not None and place % _LOOK == 0 and lost(state):
            steps = place
            break
        before, middle, after = torque[2 * place : 2 * place + 3]
        first = rate(state, before)
        second = rate(state + 0.5 * step * first, middle)
        third = rate(state + 0.5 * step * second, middle)
        fourth = rate(state + step * third, after)
        states[place], slopes[place] = state, first[2:]
        state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    states[steps], slopes[steps] = state, rate(state, torque[2 * steps])[2:]
    states, slopes = states[: steps + 1], slopes[: steps + 1]
    return Swings(step * np.arange(steps + 1), states[:, :2], states[:, 2:], slopes)


def sampled(t: FloatArray, motion: Motion, wanted: FloatArray) -> Motion:
    """The motion at the times `wanted` (N,), by cubics of angle, velocity and acceleration."""
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    theta = CubicHermiteSpline(t, motion.theta, motion.omega, axis=1)(wanted)
    omega = CubicHermiteSpline(t, motion.omega, motion.alpha, axis=1)(wanted)
    return Motion(theta, omega, CubicSpline(t, motion.alpha, axis=1)(wanted))
