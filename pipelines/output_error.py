"""An output-error fit of an arm, a contender of the race.

Each stretch of `WINDOW` s is simulated with the logged torque from a state of its own, which is
estimated: the parameters and all states minimise what the simulated angles miss of the measured
ones, each joint weighed by its misfit. Gauss-Newton steps with Levenberg's damping eliminate the
states, of which a window's residual knows four (Golub & Pereyra 1973).

======  =================================================  ==============
symbol  name                                               shape
======  =================================================  ==============
V       variants that are simulated side by side           scalar
p       parameters `NAMES`, of which some are estimated    (15,)
x       θ1, θ2, ω1, ω2 of windows side by side             (4, W)
r       measured less simulated angles of a window         (R, W), R = 2 N
======  =================================================  ==============
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
from algid.signals.segments import Segment
from pipelines.race_regressions import NAMES, Choice, acceleration, smoothed
from pipelines.simulator import swung

WINDOW = 0.5  # s
_DROPPED = 0.3  # s at each end, where the filter of the first states rings
_STEPS = 15
_NUDGE = 1e-4
_SIZE = np.array([*[0.02] * 7, 0.05, 0.05, 0.05, 0.05, 1e-3, *[0.02] * 3])
"""What a parameter is at least taken to be, of those near zero."""


def fit(logs: Sequence[Segment], first: FloatArray, choice: Choice) -> FloatArray:
    """The chosen parameters (P,) of logs, from a first guess `first` (P,)."""
    here = choice.columns
    starts, tau, theta = _cut(logs, choice.motion)
    p = np.zeros(len(NAMES))
    p[here] = first
    x, dt, damping = starts, logs[0].dt, 1e-3
    residual = theta - _simulated(p[None], x[None], tau, dt)[0]
    for _ in range(_STEPS):
        weight = 1 / np.sqrt(np.mean(residual**2, axis=(0, 2), keepdims=True))
        size = np.maximum(np.abs(p), _SIZE)[here]
        ps, xs = np.repeat(p[None], len(here) + 4, axis=0), np.repeat(x[None], len(here) + 4, 0)
        ps[range(len(here)), here] += _NUDGE * size
        xs[range(-4, 0), range(4)] += _NUDGE
        slope = _simulated(ps, xs, tau, dt) - (theta - residual)
        J = (slope * weight / _NUDGE).reshape(len(ps), -1, x.shape[1]).transpose(2, 1, 0)
        r = (residual * weight).reshape(-1, x.shape[1]).T[..., None]  # (W, R, 1)
        A, B = J[..., : len(here)], J[..., len(here) :]
        inverse = np.linalg.pinv(B)  # (W, 4, R)
        free = A - B @ (inverse @ A)  # what no initial state explains
        H = np.einsum("wrp,wrq->pq", free, free)
        g = np.einsum("wrp,wr->p", free, r[..., 0])
        while damping < 1e6:
            step = np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            moved = p.copy()
            moved[here] += size * step
            state = x + (inverse @ (r - A @ step[:, None]))[..., 0].T
            trial = theta - _simulated(moved[None], state[None], tau, dt)[0]
            if np.sum((trial * weight) ** 2) < np.sum(r**2):
                break
            damping *= 10
        else:
            break
        settled = np.sum((trial * weight) ** 2) > (1 - 1e-5) * np.sum(r**2)
        p, x, residual, damping = moved, state, trial, max(damping / 10, 1e-9)
        if settled:
            break
    return p[here]


def _cut(logs: Sequence[Segment], cutoff: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First states (4, W), torques (N + 1, 2, W) and measured angles (N + 1, 2, W) of windows."""
    pieces = []
    for log in logs:
        smooth, omega, _ = smoothed(log, cutoff)
        count, edge = round(WINDOW / log.dt), round(_DROPPED / log.dt)
        starts = np.arange(edge, len(log) - edge - count, count)
        places = starts + np.arange(count + 1)[:, None]
        tau, theta = (np.moveaxis(signal[:, places], 0, 1) for signal in (log.tau, log.theta))
        pieces.append((np.concatenate([smooth[:, starts], omega[:, starts]]), tau, theta))
    states, torques, angles = (np.concatenate(part, axis=-1) for part in zip(*pieces, strict=True))
    return states, torques, angles


def _simulated(p: FloatArray, x: FloatArray, tau: FloatArray, h: float) -> FloatArray:
    """Angles (V, N + 1, 2, W) of V parameters (V, 15) and first states (V, 4, W), by the classical
    Runge-Kutta method.
    """
    p, x = p.T[:, :, None], np.moveaxis(x, 0, 1)
    last = len(tau) - 1

    def rate(half: int, x: FloatArray) -> FloatArray:
        torque = 0.5 * (tau[min(half // 2, last)] + tau[min((half + 1) // 2, last)])
        x = np.clip(x, -1e3, 1e3)
        return np.concatenate([x[2:], acceleration(p, x[:2], x[2:], torque[:, None])])

    states, _ = swung(rate, lambda *_: x[:0], x, len(tau), h)
    return np.moveaxis(states[:, :2], 2, 0)
