"""Arms of the race, simulated side by side by a road of their own: the general planar arm under
the Runge-Kutta method.

======  ================================================  ==============
symbol  name                                              shape
======  ================================================  ==============
S       arms that are integrated side by side             scalar
K       moments K1, K2, K4 as phasors                     (3, S) complex
x       angles and velocities of both joints              (4, S)
======  ================================================  ==============

With centres of mass at angles δ off their links, K1 = m2 l1 lc2 exp(i δ2), K2 = g m2 lc2 exp(i δ2)
and K4 = m1 g lc1 exp(i δ1) + m2 g l1; the constants k1, k2, k4 are their real parts, what lies
along the links.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import Arm, FloatArray
from algid.log import Log
from pipelines.accuracy_scenes import random_arm
from pipelines.cramer_rao import Truth, information

RATE, DURATION = 500.0, 10.0
SUBSTEPS = 4
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
ENCODER = 2 * np.pi / 4096
KINDS = ("straight", "off-line", "friction", "position-controlled", "encoder 12 bit")
BOUNDED = ("straight", "encoder 12 bit")  # whose Cramér-Rao bound is known
OFF_LINE = np.deg2rad([8.0, -12.0])
FRICTION, WIDTH = 0.08, 0.08  # Coulomb's share of the drive's RMS; rad/s


@dataclass(frozen=True, eq=False)
class Scene:
    """A simulated arm: constants (7,), link 1's length in m, a log, another to predict, the true
    motion of the log.
    """

    kind: str
    seed: int
    truth: FloatArray
    l1: float
    log: Log
    ahead: Log
    motion: Truth

    def bound(self) -> FloatArray:
        """Cramér and Rao's least standard deviations (7,) of the constants."""
        sigma = ENCODER / np.sqrt(12) if self.kind == "encoder 12 bit" else SIGMA_THETA
        found = information(self.motion, self.truth, 9.81, sigma, SIGMA_TAU, loaded=False)
        return np.sqrt(np.diag(np.linalg.inv(found)))


def scenes(seeds: Sequence[int]) -> list[Scene]:
    """The arms of all kinds for each seed, with two logs each."""
    keys = [(kind, seed, run) for seed in seeds for kind in KINDS for run in range(2)]
    motions = dict(zip(keys, _moved(keys), strict=True))
    found = []
    for seed in seeds:
        arm, _ = random_arm(100 + seed)
        for kind in KINDS:
            both = [motions[kind, seed, run] for run in range(2)]
            rng = np.random.default_rng([seed, KINDS.index(kind)])
            logs = [_logged(motion, kind, rng) for motion in both]
            truth = arm.constants().copy()
            truth[[0, 1, 3]] = _moments(arm, kind).real
            found.append(Scene(kind, seed, truth, arm.l1, logs[0], logs[1], both[0]))
    return found


def _moments(arm: Arm, kind: str) -> FloatArray:
    """K1, K2, K4 of an arm (3,) complex."""
    lean1, lean2 = np.exp(1j * (OFF_LINE if kind == "off-line" else np.zeros(2)))
    first, second = arm.m1 * arm.lc1 * lean1, arm.m2 * arm.lc2 * lean2
    return np.array([arm.l1 * second, arm.g * second, arm.g * (first + arm.m2 * arm.l1)])


def sines(k: FloatArray, seed: int, t: FloatArray) -> FloatArray:
    """Six harmonics a joint of 0.2 to 3 Hz, which swing the arm about without spinning it round:
    torques (2, N) at times (N,), for an arm of constants k (7,).
    """
    k1, k2, k3, k4, k5, k6, k7 = k
    need = (k4 + k2 + 3 * k6 + 15 * (k5 + k3 + 2 * k1), k2 + 3 * k7 + 15 * k3)
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.2, 3.0, (2, 6)), rng.uniform(0, 2 * np.pi, (2, 6))
    angle = 2 * np.pi * frequency[..., None] * t + phase[..., None]
    return np.asarray(0.2 * np.array(need)[:, None] * np.sin(angle).sum(axis=1))


Rate = Callable[[FloatArray, FloatArray], FloatArray]
"""Rates of states (d, S) at torques (2, S)."""


def swung(
    rate: Rate,
    x: FloatArray,
    tau: FloatArray,
    held: NDArray[np.bool_],
    gains: tuple[FloatArray, FloatArray],
    drawn: Sequence[np.random.Generator],
    substeps: int,
) -> tuple[FloatArray, FloatArray]:
    """States (n, d, S) and torques (n, 2, S) at each sample, by Runge and Kutta's fourth order.

    Parameters
    ----------
    rate : callable
    x : (d, S)
        Where the motions start: angles, and their velocities, of what a controller sees are the
        first four.
    tau : (2, 2 substeps n + 1, S), N m
        Torques at half substeps. Where a controller acts its own are written into them.
    held : (S,)
        Where a digital PD law follows sines of up to 1.5 Hz, its torque held between samples.
    gains : P and D of that law, (2, S) each
    drawn : generators of the sines, one a motion
    substeps : int
        Steps from one sample to the next.
    """
    frequency = np.stack([rng.uniform(0.2, 1.5, (2, 4)) for rng in drawn], axis=-1)
    phase = np.stack([rng.uniform(0, 2 * np.pi, (2, 4)) for rng in drawn], axis=-1)
    amplitude = 0.35 / np.sqrt(frequency)
    n, h = tau.shape[1] // (2 * substeps), 1 / RATE / substeps
    states, torques = np.empty((n, *x.shape)), np.empty((n, 2, x.shape[1]))
    for sample in range(n):
        angle = 2 * np.pi * frequency * (sample / RATE) + phase
        wanted = (amplitude * np.sin(angle)).sum(axis=1)
        wanted[0] -= np.pi / 2
        speed = (amplitude * 2 * np.pi * frequency * np.cos(angle)).sum(axis=1)
        controlled = gains[0] * (wanted - x[:2]) + gains[1] * (speed - x[2:4])
        first = 2 * substeps * sample
        tau[:, first : first + 2 * substeps + 1, held] = controlled[:, None, held]
        states[sample], torques[sample] = x, tau[:, first]
        for part in range(first, first + 2 * substeps, 2):
            a = rate(x, tau[:, part])
            b = rate(x + 0.5 * h * a, tau[:, part + 1])
            c = rate(x + 0.5 * h * b, tau[:, part + 1])
            x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c, tau[:, part + 2]))
    return states, torques


def _moved(keys: Sequence[tuple[str, int, int]]) -> list[Truth]:
    """The true motions of kinds, seeds and runs.

    A position-controlled arm follows sines; the others are driven by sines of torque.
    """
    arms = [random_arm(100 + seed)[0] for _, seed, _ in keys]
    K = np.stack([_moments(arm, kind) for arm, (kind, _, _) in zip(arms, keys, strict=True)], -1)
    k = np.stack([arm.constants() for arm in arms], axis=-1)
    fine = np.arange(2 * SUBSTEPS * round(DURATION * RATE) + 1) / (2 * SUBSTEPS * RATE)
    drives = [
        sines(arm.constants(), 1000 * seed + run, fine)
        for arm, (_, seed, run) in zip(arms, keys, strict=True)
    ]
    rubs = np.array([kind == "friction" for kind, _, _ in keys])
    # both runs of an arm rub alike: by its first drive
    size = [drives[place - run] for place, (_, _, run) in enumerate(keys)]
    coulomb = rubs * FRICTION * np.sqrt(np.mean(np.square(size), axis=2)).T
    held = np.array([kind == "position-controlled" for kind, _, _ in keys])
    tau = np.stack(drives, axis=-1)  # (2, fine, S)
    drawn = [np.random.default_rng(seed + 50 * run) for _, seed, run in keys]
    stiffness = np.stack([k[4] + k[2] + 2 * k[0], k[2]]) * 20.0**2

    def rate(x: FloatArray, torque: FloatArray) -> FloatArray:
        w1, w2 = x[2:]
        turned = K[0] * np.exp(1j * x[1])
        m11, m12, m22 = k[4] + k[2] + 2 * turned.real, k[2] + turned.real, k[2]
        both = (K[1] * np.exp(1j * (x[0] + x[1]))).real
        rubbing = k[5:7] * x[2:] + coulomb * np.tanh(x[2:] / WIDTH)
        # d Re(K1 e^{iθ2}) / dθ2 = −Im(K1 e^{iθ2}): what is centripetal
        weight = (K[2] * np.exp(1j * x[0])).real
        b1 = torque[0] + turned.imag * (2 * w1 + w2) * w2 - weight - both - rubbing[0]
        b2 = torque[1] - turned.imag * w1**2 - both - rubbing[1]
        det = m11 * m22 - m12**2
        return np.stack([w1, w2, (m22 * b1 - m12 * b2) / det, (m11 * b2 - m12 * b1) / det])

    x = np.zeros((4, len(keys)))
    x[0] = -np.pi / 2
    gains = stiffness, stiffness / 10.0
    states, torques = swung(rate, x, tau, held, gains, drawn, SUBSTEPS)
    t = np.arange(len(states)) / RATE
    return [
        Truth(t, states[:, :2, s].T.copy(), states[:, 2:, s].T.copy(), torques[..., s].T.copy())
        for s in range(len(keys))
    ]


def _logged(truth: Truth, kind: str, rng: np.random.Generator) -> Log:
    theta = truth.theta + SIGMA_THETA * rng.standard_normal(truth.theta.shape)
    if kind == "encoder 12 bit":
        theta = np.round(truth.theta / ENCODER) * ENCODER
    tau = truth.tau + SIGMA_TAU * rng.standard_normal(truth.tau.shape)
    return Log.from_arrays(truth.t, theta, tau)
