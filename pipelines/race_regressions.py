"""The contenders that are regressions: least squares behind filters that are chosen, and
instrumental variables.

The filters are chosen as a practitioner would: the motion's and the equations' cut-offs that
predict best what was left out, a half of the logs or of the one log. Of the terms beside k1 … k7
(Coulomb friction, offsets, joint 2's rotor, centres of mass off their links) those stay that
Schwarz's criterion keeps. The instruments are IDIM-IV's (Janot, Vandanjon & Gautier 2014): the same
columns of a motion that the model makes, with the present parameters, of the measured torque and a
controller that tracks the measured motion.

======  ====================================================  ==========
symbol  name                                                  shape
======  ====================================================  ==========
p       k1 … k7 and the chosen ones of the other `NAMES`      (P,)
A, Z    columns of both joints: measured and simulated        (R, P)
b       torques                                               (R,)
======  ====================================================  ==========
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations, product

import numpy as np
from scipy.signal import butter, sosfiltfilt

from algid.arm import CONSTANT_NAMES, FloatArray, inverse_dynamics
from algid.signals.segments import Segment

NAMES = (*CONSTANT_NAMES, "f1", "f2", "o1", "o2", "j2", "k1s", "k2s", "k4s")
TERMS = {"coulomb": (7, 8), "offset": (9, 10), "rotor": (11,), "bent": (12, 13, 14)}
"""By term its columns."""
WIDTH = 0.05  # rad/s, of Coulomb friction
MOTION = (5.0, 10.0, 20.0, 40.0)  # Hz: cut-offs of the motion to choose from
EQUATIONS = (2.0, 5.0, 10.0, 20.0)  # Hz: of the equations
_JUDGED = 5.0  # Hz: residuals are compared below
_DROPPED = 0.3  # s at each end, where a filter rings
_TRACKED = 12.0  # rad/s: the controller's bandwidth
_ROUNDS = 6

Motion = tuple[FloatArray, FloatArray, FloatArray]
Equations = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class Choice:
    """Cut-offs in Hz of the motion and of the equations, and the terms beside k1 … k7."""

    motion: float
    equations: float
    terms: tuple[str, ...]

    @property
    def columns(self) -> list[int]:
        """Places in `NAMES`."""
        return [*range(7), *chain.from_iterable(TERMS[term] for term in self.terms)]


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


def regressor(theta: FloatArray, omega: FloatArray, alpha: FloatArray) -> FloatArray:
    """Y (2, 7, N) with τ = Y k, a column for each constant of Table 1."""
    return np.stack([inverse_dynamics(k, theta, omega, alpha) for k in np.eye(7)], axis=1)


def columns(motion: Motion, width: float = WIDTH) -> FloatArray:
    """The regressor (2, 15, N) of `NAMES` along a motion."""
    theta, omega, alpha = motion
    zero, one = np.zeros_like(theta[0]), np.ones_like(theta[0])
    rubbing = np.tanh(omega / width)
    more = np.array([[rubbing[0], zero, one, zero, zero], [zero, rubbing[1], zero, one, alpha[1]]])
    # the sine part of a moment: its column a quarter turn on, d Re(K exp(iφ)) / d Im K
    first, second = (
        regressor(theta + np.array(turn)[:, None], omega, alpha)
        for turn in ((np.pi / 2, 0.0), (0.0, np.pi / 2))
    )
    bent = np.stack([second[:, 0], first[:, 1], first[:, 3]], axis=1)
    return np.concatenate([regressor(theta, omega, alpha), more, bent], axis=1)


def rows(signals: FloatArray, dt: float, cutoff: float) -> FloatArray:
    """Signals (2, …, N) behind the equations' filter, ends dropped, sampled at three times its
    cut-off, where they are all but independent: (R, …) of both joints.
    """
    edge, every = round(_DROPPED / dt), max(1, round(1 / (3 * cutoff * dt)))
    kept = _below(cutoff, dt, signals)[..., edge:-edge:every]
    return np.concatenate([np.moveaxis(joint, -1, 0) for joint in kept])


def _equations(logs: Sequence[Segment], motion: float, equations: float) -> Equations:
    pieces = [
        (rows(columns(smoothed(log, motion)), log.dt, equations), rows(log.tau, log.dt, equations))
        for log in logs
    ]
    A, b = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return A, b


def chosen(logs: Sequence[Segment], every_term: bool = False) -> Choice:
    """The cut-offs whose fit to one half of the logs, or of the one log, predicts the other half
    best, and the terms that are kept behind them, or every one of them.
    """
    halves: list[Sequence[Segment]] = [logs[::2], logs[1::2]]
    if len(logs) == 1:
        middle = len(logs[0]) // 2
        halves = [[logs[0].part(0, middle)], [logs[0].part(middle, len(logs[0]))]]
    judged = [_equations(half, MOTION[2], _JUDGED) for half in halves]

    def choice(logs: Sequence[Segment], cutoffs: tuple[float, float]) -> tuple[Choice, FloatArray]:
        A, b = _equations(logs, *cutoffs)
        terms = tuple(TERMS) if every_term else _kept(A, b)
        found = Choice(*cutoffs, terms)
        return found, np.linalg.lstsq(A[:, found.columns], b, rcond=None)[0]

    def missed(cutoffs: tuple[float, float]) -> float:
        total = 0.0
        for half, (A, b) in zip(halves, judged[::-1], strict=True):
            found, p = choice(half, cutoffs)
            total += float(np.sum((b - A[:, found.columns] @ p) ** 2))
        return total

    return choice(logs, min(product(MOTION, EQUATIONS), key=missed))[0]


def _kept(A: FloatArray, b: FloatArray) -> tuple[str, ...]:
    """The terms with the least value of Schwarz's criterion."""
    gram, moment, square = A.T @ A, A.T @ b, float(b @ b)

    def criterion(terms: tuple[str, ...]) -> float:
        here = Choice(0.0, 0.0, terms).columns
        p = np.linalg.lstsq(gram[np.ix_(here, here)], moment[here], rcond=None)[0]
        return float(b.size * np.log(square - moment[here] @ p) + len(here) * np.log(b.size))

    sets = chain.from_iterable(combinations(TERMS, count) for count in range(len(TERMS) + 1))
    return min(sets, key=criterion)


def solved(A: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least squares (P,), and its covariance for white residuals."""
    p = np.linalg.lstsq(A, b, rcond=None)[0]
    variance = np.sum((b - A @ p) ** 2) / (b.size - p.size)
    return p, variance * np.linalg.pinv(A.T @ A)


def least_squares(logs: Sequence[Segment], choice: Choice) -> tuple[FloatArray, FloatArray]:
    """Parameters (P,) and their covariance."""
    A, b = _equations(logs, choice.motion, choice.equations)
    return solved(A[:, choice.columns], b)


def instruments(logs: Sequence[Segment], choice: Choice) -> tuple[FloatArray, FloatArray]:
    """Parameters (P,) by instruments, and their covariance for white residuals."""
    A, b = _equations(logs, choice.motion, choice.equations)
    A = A[:, choice.columns]
    p, covariance = solved(A, b)
    for _ in range(_ROUNDS):
        Z = np.concatenate(
            [
                rows(columns(_tracked(log, p, choice)), log.dt, choice.equations)[:, choice.columns]
                for log in logs
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


def _tracked(log: Segment, p: FloatArray, choice: Choice) -> Motion:
    """What the arm of `p` does under the measured torque and a controller that tracks the measured
    motion.
    """
    wanted, speeds, _ = smoothed(log, choice.motion)
    every = np.zeros(len(NAMES))
    every[choice.columns] = p
    k1, _, k3, _, k5 = every[:5].tolist()
    stiffness = np.array([k5 + k3 + 2 * k1, k3 + every[11]]) * _TRACKED**2
    damping = 1.4 * stiffness / _TRACKED
    theta, omega, alpha = (np.empty_like(wanted) for _ in range(3))
    q, w = wanted[:, 0].copy(), speeds[:, 0].copy()
    for n in range(len(log)):
        drive = log.tau[:, n] + stiffness * (wanted[:, n] - q) + damping * (speeds[:, n] - w)
        a = acceleration(every, q, w, drive)
        theta[:, n], omega[:, n], alpha[:, n] = q, w, a
        w = w + log.dt * a
        q = q + log.dt * w  # semi-implicit: stable for the controller
    return theta, omega, alpha


def acceleration(p: FloatArray, q: FloatArray, w: FloatArray, tau: FloatArray) -> FloatArray:
    """Accelerations (2, …) of the arm with parameters `NAMES` (15, …) at angles, velocities and
    torques (2, …).
    """
    k1, k2, k3, k4, k5, k6, k7, f1, f2, o1, o2, j2, k1s, k2s, k4s = p
    s1, s2, s12 = np.sin(q[0]), np.sin(q[1]), np.sin(q[0] + q[1])
    c1, c2, c12 = np.cos(q[0]), np.cos(q[1]), np.cos(q[0] + q[1])
    t1, t2 = np.tanh(w / WIDTH)
    coupling, spin, both = k1 * c2 - k1s * s2, k1 * s2 + k1s * c2, k2 * c12 - k2s * s12
    weight = k4 * c1 - k4s * s1 + both
    b1 = tau[0] + spin * (2 * w[0] + w[1]) * w[1] - weight - k6 * w[0] - f1 * t1 - o1
    b2 = tau[1] - spin * w[0] ** 2 - both - k7 * w[1] - f2 * t2 - o2
    m11, m12, m22 = k5 + k3 + 2 * coupling, k3 + coupling, k3 + j2
    return np.stack([m22 * b1 - m12 * b2, m11 * b2 - m12 * b1]) / (m11 * m22 - m12**2)
