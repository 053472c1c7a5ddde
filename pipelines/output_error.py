"""An output-error fit of an arm: the peer beside which repeatability on real runs is judged.

Each stretch of `WINDOW` s starts at the state of the motion below `CUTOFF` Hz, is simulated with
the logged torque, and the parameters minimise what the simulated angles miss of the measured ones,
each joint weighed by its own misfit and each log as the others. Viscous and Coulomb friction of
width `WIDTH` and the rotor of joint 2 are in the model, and nothing of the estimators is used.

======  ===============================================  ======
symbol  name                                             shape
======  ===============================================  ======
p       k1 … k7, f1, f2, j2 and, where asked, gain2      (P,)
x       θ1, θ2, ω1, ω2 of windows side by side           (4, W)
======  ===============================================  ======
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, filtfilt

from algid.arm import FloatArray
from algid.signals.segments import Segment

WINDOW = 0.2  # s
CUTOFF = 20.0  # Hz
WIDTH = 0.05  # rad/s
NAMES = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "f1", "f2", "j2")
_DROPPED = 0.3  # s at each end, where the filter rings
_STEPS = 12
_NUDGE = 1e-4


@dataclass(frozen=True, eq=False)
class _Windows:
    """Starts (4, W), torques (N + 1, 2, W) and measured angles (N, 2, W) after each
    step of dt s.
    """

    dt: float
    start: FloatArray
    tau: FloatArray
    theta: FloatArray


def fit(logs: Sequence[Segment], first: FloatArray, gain: bool = False) -> FloatArray:
    """Parameters `NAMES`, and gain2 where asked, of logs.

    `first` (7,) are constants to start from.
    """
    windows = [_cut(log) for log in logs]
    p = np.concatenate([first, [0.05, 0.05, 0.1 * first[2]], [0.0] * gain])
    damping = 1e-3
    size = np.maximum(np.abs(p), [*np.full(7, 0.02), 0.05, 0.05, 1e-3, *[0.1] * gain])
    residual = _residual(windows, p[None])[0]
    for _ in range(_STEPS):
        scale = np.sqrt(np.mean(residual**2, axis=(0, 2), keepdims=True))
        r = (residual / scale).ravel()
        nudged = _residual(windows, p + _NUDGE * np.diag(size))
        J = ((nudged - residual) / scale).reshape(len(p), -1).T / _NUDGE
        H = J.T @ J
        while damping < 1e6:
            step = size * np.linalg.solve(H + damping * np.diag(np.diag(H)), -J.T @ r)
            trial = _residual(windows, (p + step)[None])[0]
            if np.all(np.isfinite(trial)) and np.sum((trial / scale) ** 2) < r @ r:
                break
            damping *= 10
        else:
            return p
        settled = np.sum((trial / scale) ** 2) > (1 - 1e-8) * (r @ r)
        p, residual, damping = p + step, trial, max(damping / 10, 1e-9)
        if settled:
            break
    return p


def _cut(log: Segment) -> _Windows:
    b, a = butter(3, CUTOFF * 2 * log.dt)
    smooth = filtfilt(b, a, log.theta, axis=1)
    omega = np.gradient(smooth, log.dt, axis=1)
    count, edge = round(WINDOW / log.dt), round(_DROPPED / log.dt)
    starts = np.arange(edge, len(log) - edge - count, count)
    places = starts + np.arange(count + 1)[:, None]
    tau = np.moveaxis(log.tau[:, places], 0, 1)
    theta = np.moveaxis(log.theta[:, places[1:]], 0, 1)
    return _Windows(log.dt, np.concatenate([smooth[:, starts], omega[:, starts]]), tau, theta)


def _residual(logs: Sequence[_Windows], p: FloatArray) -> FloatArray:
    """Measured less simulated angles (V, N, 2, W) of all windows by each of V parameters (V, P).

    Logs of a higher rate give fewer of their samples.
    """
    least = min(log.theta.shape[0] for log in logs)
    return np.concatenate([_simulated(log, p)[:, :least] for log in logs], axis=3)


def _simulated(log: _Windows, p: FloatArray) -> FloatArray:
    """Measured less simulated angles (V, N, 2, W), by the classical Runge-Kutta method."""
    p = p.T[:, :, None]
    x, h = np.repeat(log.start[:, None], p.shape[1], axis=1), log.dt
    found = np.empty((p.shape[1], *log.theta.shape))
    for step in range(len(log.theta)):
        first, last = log.tau[step], log.tau[step + 1]
        middle = 0.5 * (first + last)
        a = _rate(p, x, first)
        b = _rate(p, x + 0.5 * h * a, middle)
        c = _rate(p, x + 0.5 * h * b, middle)
        d = _rate(p, x + h * c, last)
        x = np.clip(x + h / 6 * (a + 2 * b + 2 * c + d), -1e3, 1e3)
        found[:, step] = log.theta[step] - np.moveaxis(x[:2], 0, 1)
    return found


def _rate(p: FloatArray, x: FloatArray, tau: FloatArray) -> FloatArray:
    k1, k2, k3, k4, k5, k6, k7, f1, f2, j2 = p[:10]
    gain = 1 + (p[10] if len(p) > 10 else 0.0)
    theta1, theta2, w1, w2 = x
    s2, c2, c12 = np.sin(theta2), np.cos(theta2), np.cos(theta1 + theta2)
    m11, m12, m22 = k5 + k3 + 2 * k1 * c2, k3 + k1 * c2, k3 + j2
    b1 = (
        tau[0]
        + k1 * s2 * (2 * w1 + w2) * w2
        - k4 * np.cos(theta1)
        - k2 * c12
        - k6 * w1
        - f1 * np.tanh(w1 / WIDTH)
    )
    b2 = tau[1] / gain - k1 * s2 * w1**2 - k2 * c12 - k7 * w2 - f2 * np.tanh(w2 / WIDTH)
    det = m11 * m22 - m12**2
    return np.stack([w1, w2, (m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det])
