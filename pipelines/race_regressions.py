"""Two contenders that are regressions: least squares behind filters that are chosen, and
instrumental variables.

The filters are chosen as a practitioner would: the motion's and the equations' cut-offs that
predict best what was left out, a half of the logs or of the one log. Coulomb friction, offsets and
joint 2's rotor are columns of both. The instruments are IDIM-IV's (Janot, Vandanjon & Gautier
2014): the same columns of a motion that the model makes, with the present parameters, of the
measured torque and a controller that tracks the measured motion.

======  ====================================================  ==========
symbol  name                                                  shape
======  ====================================================  ==========
p       k1 … k7, f1, f2, j2, o1, o2                           (12,)
A, Z    columns of both joints: measured and simulated        (R, 12)
b       torques                                               (R,)
======  ====================================================  ==========
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.signal import butter, sosfiltfilt

from algid.arm import FloatArray, regressor
from algid.signals.segments import Segment

NAMES = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "f1", "f2", "j2", "o1", "o2")
WIDTH = 0.05  # rad/s, of Coulomb friction
MOTION = (5.0, 10.0, 20.0, 40.0)  # Hz: cut-offs of the motion to choose from
EQUATIONS = (2.0, 5.0, 10.0, 20.0)  # Hz: of the equations
_JUDGED = 5.0  # Hz: residuals are compared below
_DROPPED = 0.3  # s at each end, where a filter rings
_TRACKED = 12.0  # rad/s: the controller's bandwidth
_ROUNDS = 6

Motion = tuple[FloatArray, FloatArray, FloatArray]
Cutoffs = tuple[float, float]


def smoothed(log: Segment, cutoff: float) -> Motion:
    """Angles, velocities and accelerations (2, N) behind a zero-phase filter."""
    theta = _below(cutoff, log.dt, log.theta)
    omega = np.gradient(theta, log.dt, axis=1)
    return theta, omega, np.gradient(omega, log.dt, axis=1)


def _below(cutoff: float, dt: float, signals: FloatArray) -> FloatArray:
    highest = 0.45 / dt
    return np.asarray(
        sosfiltfilt(butter(4, min(cutoff, highest), fs=1 / dt, output="sos"), signals, axis=-1)
    )


def columns(motion: Motion) -> FloatArray:
    """The regressor (2, 12, N) along a motion."""
    theta, omega, alpha = motion
    zero, one = np.zeros_like(theta[0]), np.ones_like(theta[0])
    rubbing = np.tanh(omega / WIDTH)
    more = np.array([[rubbing[0], zero, zero, one, zero], [zero, rubbing[1], alpha[1], zero, one]])
    return np.concatenate([regressor(theta, omega, alpha), more], axis=1)


def _rows(signals: FloatArray, dt: float, cutoff: float) -> FloatArray:
    """Signals (2, …, N) behind the equations' filter, ends dropped, thinned: (R, …) of both
    joints.
    """
    edge, every = round(_DROPPED / dt), max(1, round(1 / (4 * cutoff * dt)))
    kept = _below(cutoff, dt, signals)[..., edge:-edge:every]
    return np.concatenate([np.moveaxis(joint, -1, 0) for joint in kept])


def _equations(logs: Sequence[Segment], cutoffs: Cutoffs) -> tuple[FloatArray, FloatArray]:
    pieces = [
        (
            _rows(columns(smoothed(log, cutoffs[0])), log.dt, cutoffs[1]),
            _rows(log.tau, log.dt, cutoffs[1]),
        )
        for log in logs
    ]
    A, b = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return A, b


def _fitted(logs: Sequence[Segment], cutoffs: Cutoffs) -> FloatArray:
    return np.asarray(np.linalg.lstsq(*_equations(logs, cutoffs), rcond=None)[0])


def chosen_cutoffs(logs: Sequence[Segment]) -> Cutoffs:
    """The cut-offs whose fit to one half of the logs, or of the one log, predicts the other half
    best.
    """
    halves: list[Sequence[Segment]] = [logs[::2], logs[1::2]]
    if len(logs) == 1:
        middle = len(logs[0]) // 2
        halves = [[logs[0].part(0, middle)], [logs[0].part(middle, len(logs[0]))]]

    def missed(cutoffs: Cutoffs) -> float:
        total = 0.0
        for own, other in (halves, halves[::-1]):
            A, b = _equations(other, (MOTION[2], _JUDGED))
            total += float(np.sum((b - A @ _fitted(own, cutoffs)) ** 2))
        return total

    return min(product(MOTION, EQUATIONS), key=missed)


def least_squares(logs: Sequence[Segment]) -> tuple[FloatArray, FloatArray, Cutoffs]:
    """Parameters (12,), their covariance for white residuals, and the cut-offs chosen."""
    cutoffs = chosen_cutoffs(logs)
    A, b = _equations(logs, cutoffs)
    p = np.linalg.lstsq(A, b, rcond=None)[0]
    variance = np.sum((b - A @ p) ** 2) / (b.size - p.size)
    return p, variance * np.linalg.pinv(A.T @ A), cutoffs


def instruments(logs: Sequence[Segment]) -> tuple[FloatArray, FloatArray]:
    """Parameters (12,) by instruments, and their covariance for white residuals."""
    p, covariance, cutoffs = least_squares(logs)
    A, b = _equations(logs, cutoffs)
    for _ in range(_ROUNDS):
        simulated = [_tracked(log, p, cutoffs[0]) for log in logs]
        Z = np.concatenate(
            [
                _rows(columns(motion), log.dt, cutoffs[1])
                for motion, log in zip(simulated, logs, strict=True)
            ]
        )
        if not np.all(np.isfinite(Z)):
            return p, covariance
        gain = np.linalg.pinv(Z.T @ A)
        better = gain @ (Z.T @ b)
        variance = np.sum((b - A @ better) ** 2) / (b.size - p.size)
        covariance = variance * gain @ (Z.T @ Z) @ gain.T
        moved = np.abs(better - p) / np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        p = better
        if moved.max() < 0.05:
            break
    return p, covariance


def _tracked(log: Segment, p: FloatArray, cutoff: float) -> Motion:
    """What the arm of `p` does under the measured torque and a controller that tracks the measured
    motion.
    """
    wanted, speeds, _ = smoothed(log, cutoff)
    k1, k2, k3, k4, k5, b1, b2, f1, f2, j2, o1, o2 = p.tolist()
    stiffness = np.array([k5 + k3 + 2 * k1, k3 + j2]) * _TRACKED**2
    damping = 1.4 * stiffness / _TRACKED
    theta, omega, alpha = (np.empty_like(wanted) for _ in range(3))
    q, w = wanted[:, 0].copy(), speeds[:, 0].copy()
    for n in range(len(log)):
        drive = log.tau[:, n] + stiffness * (wanted[:, n] - q) + damping * (speeds[:, n] - w)
        s2, c2 = np.sin(q[1]), np.cos(q[1])
        c1, c12 = np.cos(q[0]), np.cos(q[0] + q[1])
        t1, t2 = np.tanh(w / WIDTH)
        r1 = drive[0] - (
            -k1 * s2 * (2 * w[0] + w[1]) * w[1] + k4 * c1 + k2 * c12 + b1 * w[0] + f1 * t1 + o1
        )
        r2 = drive[1] - (k1 * s2 * w[0] ** 2 + k2 * c12 + b2 * w[1] + f2 * t2 + o2)
        m11, m12, m22 = k5 + k3 + 2 * k1 * c2, k3 + k1 * c2, k3 + j2
        a = np.array([m22 * r1 - m12 * r2, m11 * r2 - m12 * r1]) / (m11 * m22 - m12**2)
        theta[:, n], omega[:, n], alpha[:, n] = q, w, a
        w = w + log.dt * a
        q = q + log.dt * w  # semi-implicit: stable for the controller
    return theta, omega, alpha
