"""Arms of the race, simulated side by side: straight and bent, rubbing, position-controlled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import Arm, FloatArray
from algid.log import Log
from pipelines.accuracy_scenes import random_arm, waves
from pipelines.cramer_rao import Truth, information
from pipelines.simulator import Arms, inertias, swung

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
    """A simulated arm: constants (7,), link 1's length in m, a log, another to predict."""

    kind: str
    seed: int
    truth: FloatArray
    l1: float
    log: Log
    ahead: Log
    bound: FloatArray | None
    """Cramér and Rao's least standard deviations (7,) of the constants, where they are known."""


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
            bound = None
            if kind in BOUNDED:
                sigma = ENCODER / np.sqrt(12) if kind == "encoder 12 bit" else SIGMA_THETA
                told = information(both[0], truth, 9.81, sigma, SIGMA_TAU, loaded=False)
                bound = np.sqrt(np.diag(np.linalg.inv(told)))
            found.append(Scene(kind, seed, truth, arm.l1, logs[0], logs[1], bound))
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


def followed(
    arms: Arms,
    drives: FloatArray,
    held: NDArray[np.bool_],
    gains: tuple[FloatArray, FloatArray],
    drawn: Sequence[np.random.Generator],
    substeps: int,
) -> tuple[FloatArray, FloatArray]:
    """States (n, 10, S) and torques (n, 2, S) at each sample, from rest.

    Parameters
    ----------
    drives : (2, 2 substeps n + 1, S), N m
        Torques at half substeps.
    held : (S,)
        Where a digital PD law of `gains` P and D, (2, S) each, follows sines of up to 1.5 Hz
        instead, its torque held between samples.
    drawn : generators of the sines, one a motion
    """
    frequency = np.stack([rng.uniform(0.2, 1.5, (2, 4)) for rng in drawn], axis=1)
    phase = np.stack([rng.uniform(0, 2 * np.pi, (2, 4)) for rng in drawn], axis=1)
    now = np.zeros((2, held.size))

    def sampled(half: int, x: FloatArray) -> None:
        t = np.array([half / (2 * substeps * RATE)])
        wanted, speed, _ = waves(t, frequency, 0.35 / np.sqrt(frequency), phase)[..., 0]
        wanted[0] -= np.pi / 2
        now[:] = gains[0] * (wanted - x[:2]) + gains[1] * (speed - x[2:4])

    def torque(half: int, _: FloatArray) -> FloatArray:
        return np.where(held, now, drives[:, half])

    def rate(half: int, x: FloatArray) -> FloatArray:
        return arms.rate(x, torque(half, x))

    samples = drives.shape[1] // (2 * substeps)
    return swung(rate, torque, arms.hanging(), samples, 1 / RATE, substeps, sampled)


def _moved(keys: Sequence[tuple[str, int, int]]) -> list[Truth]:
    """The true motions of kinds, seeds and runs.

    A position-controlled arm follows sines; the others are driven by sines of torque.
    """
    own = [random_arm(100 + seed)[0] for _, seed, _ in keys]
    K = np.stack([_moments(arm, kind) for arm, (kind, _, _) in zip(own, keys, strict=True)], -1)
    k = np.stack([arm.constants() for arm in own], axis=-1)
    k[[0, 1, 3]] = K.real
    fine = np.arange(2 * SUBSTEPS * round(DURATION * RATE) + 1) / (2 * SUBSTEPS * RATE)
    drives = [
        sines(arm.constants(), 1000 * seed + run, fine)
        for arm, (_, seed, run) in zip(own, keys, strict=True)
    ]
    rubs = np.array([kind == "friction" for kind, _, _ in keys])
    # both runs of an arm rub alike: by its first drive
    size = [drives[place - run] for place, (_, _, run) in enumerate(keys)]
    coulomb = rubs * FRICTION * np.sqrt(np.mean(np.square(size), axis=2)).T
    held = np.array([kind == "position-controlled" for kind, _, _ in keys])
    drawn = [np.random.default_rng(seed + 50 * run) for _, seed, run in keys]
    stiffness = inertias(k) * 20.0**2
    arms = Arms(k, K.imag, coulomb, width=WIDTH)
    gains = stiffness, stiffness / 10.0
    states, torques = followed(arms, np.stack(drives, axis=-1), held, gains, drawn, SUBSTEPS)
    t = np.arange(len(states)) / RATE
    return [
        Truth(t, states[:, :2, s].T.copy(), states[:, 2:4, s].T.copy(), torques[..., s].T.copy())
        for s in range(len(keys))
    ]


def _logged(truth: Truth, kind: str, rng: np.random.Generator) -> Log:
    theta = truth.theta + SIGMA_THETA * rng.standard_normal(truth.theta.shape)
    if kind == "encoder 12 bit":
        theta = np.round(truth.theta / ENCODER) * ENCODER
    tau = truth.tau + SIGMA_TAU * rng.standard_normal(truth.tau.shape)
    return Log.from_arrays(truth.t, theta, tau)
