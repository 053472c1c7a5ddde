"""Arms of the race, simulated by a road of their own: the general planar arm under the Runge-Kutta
method.

======  ================================================  =======================
symbol  name                                              shape
======  ================================================  =======================
K       moments K1, K2, K4 as phasors                     (3,) complex
x       angles and velocities of both joints              (4,)
======  ================================================  =======================

With centres of mass at angles δ off their links, K1 = m2 l1 lc2 exp(i δ2), K2 = g m2 lc2 exp(i δ2)
and K4 = m1 g lc1 exp(i δ1) + m2 g l1; the constants k1, k2, k4 are their real parts, what lies
along the links.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from algid.arm import Arm, FloatArray
from algid.signals.segments import Segment
from algid.synth.excitation import MultiSine
from pipelines.accuracy_scenes import random_arm
from pipelines.cramer_rao import Truth, information

RATE, DURATION = 500.0, 10.0
SUBSTEPS = 4
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
ENCODER = 2 * np.pi / 4096
KINDS = ("straight", "off-line", "friction", "position-controlled", "encoder 12 bit")
OFF_LINE = np.deg2rad([8.0, -12.0])
FRICTION, WIDTH = 0.08, 0.08  # Coulomb's share of the drive's RMS; rad/s

Drive = Callable[[float, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Scene:
    """A simulated arm: constants, link 1's length in m, a log, another to predict, the bound (7,)
    where it is known.
    """

    kind: str
    seed: int
    truth: FloatArray
    l1: float
    log: Segment
    ahead: Segment
    bound: FloatArray | None


@dataclass(frozen=True, eq=False)
class _Plant:
    arm: Arm
    K: tuple[complex, complex, complex]
    k: FloatArray
    coulomb: FloatArray

    @classmethod
    def of(cls, arm: Arm, off: FloatArray, coulomb: FloatArray) -> _Plant:
        lean1, lean2 = np.exp(1j * off)
        K1 = arm.m2 * arm.l1 * arm.lc2 * lean2
        K2 = arm.g * arm.m2 * arm.lc2 * lean2
        K4 = arm.m1 * arm.g * arm.lc1 * lean1 + arm.m2 * arm.g * arm.l1
        k = arm.constants().copy()
        k[[0, 1, 3]] = K1.real, K2.real, K4.real
        return cls(arm, (K1, K2, K4), k, coulomb)

    def rate(self, x: FloatArray, tau: FloatArray) -> FloatArray:
        """ẋ (4,) under the torque (2,)."""
        K1, K2, K4 = self.K
        k3, k5, b = self.k[2], self.k[4], self.k[5:7]
        q1, q2, w1, w2 = x
        turned = K1 * np.exp(1j * q2)
        mass = np.array([[k5 + k3 + 2 * turned.real, k3 + turned.real], [k3 + turned.real, k3]])
        # d Re(K1 e^{iθ2}) / dθ2 = −Im(K1 e^{iθ2}): what is centripetal
        spin = np.array([-turned.imag * (2 * w1 + w2) * w2, turned.imag * w1**2])
        both = (K2 * np.exp(1j * (q1 + q2))).real
        weight = np.array([(K4 * np.exp(1j * q1)).real + both, both])
        omega = x[2:]
        rubbing = b * omega + self.coulomb * np.tanh(omega / WIDTH)
        return np.concatenate([omega, np.linalg.solve(mass, tau - spin - weight - rubbing)])


def scene(kind: str, seed: int) -> Scene:
    """The arm of a kind and seed, its log and the log that is to be predicted."""
    arm, _ = random_arm(100 + seed)
    drives = [_sines(arm, 1000 * seed + place) for place in range(2)]
    t = np.arange(round(DURATION * RATE)) / RATE
    size = np.sqrt(np.mean(drives[0](t) ** 2, axis=1))
    plant = _Plant.of(
        arm,
        OFF_LINE if kind == "off-line" else np.zeros(2),
        FRICTION * size if kind == "friction" else np.zeros(2),
    )
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    truths, logs = [], []
    for place, drive in enumerate(drives):
        if kind == "position-controlled":
            truth = _moved(plant, _controlled(plant, seed + 50 * place), held=True)
        else:
            truth = _moved(plant, _open_loop(drive))
        truths.append(truth)
        logs.append(_logged(truth, kind, rng))
    bound = None
    if kind in ("straight", "encoder 12 bit"):
        sigma = ENCODER / np.sqrt(12) if kind == "encoder 12 bit" else SIGMA_THETA
        found = information(truths[0], plant.k, arm.g, sigma, SIGMA_TAU, loaded=False)
        bound = np.sqrt(np.diag(np.linalg.inv(found)))
    return Scene(kind, seed, plant.k, arm.l1, logs[0], logs[1], bound)


def _sines(arm: Arm, seed: int) -> MultiSine:
    """Six harmonics a joint of 0.2 to 3 Hz, which swing the arm about without spinning it round."""
    k1, k2, k3, k4, k5, k6, k7 = arm.constants()
    need = (k4 + k2 + 3 * k6 + 15 * (k5 + k3 + 2 * k1), k2 + 3 * k7 + 15 * k3)
    rng = np.random.default_rng(seed)
    frequencies = tuple(tuple(rng.uniform(0.2, 3.0, 6).tolist()) for _ in range(2))
    phases = tuple(tuple(rng.uniform(0, 2 * np.pi, 6).tolist()) for _ in range(2))
    return MultiSine(tuple((0.2 * float(force),) * 6 for force in need), frequencies, phases)


def _controlled(plant: _Plant, seed: int) -> Drive:
    """A digital PD law with gravity's compensation that follows sines of up to 1.5 Hz."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.2, 1.5, (2, 4)), rng.uniform(0, 2 * np.pi, (2, 4))
    amplitude = 0.35 / np.sqrt(frequency)
    stiffness = np.array([plant.k[4] + plant.k[2] + 2 * plant.k[0], plant.k[2]]) * 20.0**2

    def torque(now: float, x: FloatArray) -> FloatArray:
        angle = 2 * np.pi * frequency * now + phase
        wanted = np.array([-np.pi / 2, 0.0]) + (amplitude * np.sin(angle)).sum(axis=1)
        speed = (amplitude * 2 * np.pi * frequency * np.cos(angle)).sum(axis=1)
        return np.asarray(stiffness * (wanted - x[:2]) + stiffness / 10.0 * (speed - x[2:]))

    return torque


def _open_loop(torque: MultiSine) -> Drive:
    """The drive of a torque (2, N) over times (N,)."""
    return lambda now, _: torque(np.array([now]))[:, 0]


def _moved(plant: _Plant, drive: Drive, held: bool = False) -> Truth:
    """The true motion; a `held` torque is that of the sample before until the next."""
    n, h = round(DURATION * RATE), 1 / RATE / SUBSTEPS
    x = np.array([-np.pi / 2, 0.0, 0.0, 0.0])
    states, torques = np.empty((4, n)), np.empty((2, n))
    for sample in range(n):
        now = sample / RATE
        states[:, sample], torques[:, sample] = x, drive(now, x)
        for part in range(SUBSTEPS):
            at = now + part * h
            first, middle, last = (
                torques[:, sample] if held else drive(at + share * h, x)
                for share in (0.0, 0.5, 1.0)
            )
            a = plant.rate(x, first)
            b = plant.rate(x + 0.5 * h * a, middle)
            c = plant.rate(x + 0.5 * h * b, middle)
            x = x + h / 6 * (a + 2 * b + 2 * c + plant.rate(x + h * c, last))
    return Truth(np.arange(n) / RATE, states[:2], states[2:], torques)


def _logged(truth: Truth, kind: str, rng: np.random.Generator) -> Segment:
    theta = truth.theta + SIGMA_THETA * rng.standard_normal(truth.theta.shape)
    if kind == "encoder 12 bit":
        theta = np.round(truth.theta / ENCODER) * ENCODER
    tau = truth.tau + SIGMA_TAU * rng.standard_normal(truth.tau.shape)
    return Segment(0.0, 1 / RATE, theta, tau)
