"""Arms, motions and noise of experiments, and least squares behind filters on the same logs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from algid.arm import Arm, FloatArray, inverse_dynamics
from algid.log import Log, Origin, Reading
from algid.signals.segments import Segment
from algid.synth.cases import Case, load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.cramer_rao import Truth

RATE = 1000.0
DURATION = 10.0
ENCODER_STEP = 2 * np.pi / 4096
CUTOFFS = (3.0, 5.0, 8.0, 12.0, 18.0, 27.0, 40.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """An arm with its payload, and its true motion without and with it."""

    arm: Arm
    payload: float
    bare: Truth
    burdened: Truth

    @property
    def truth(self) -> FloatArray:
        """k1 … k7, m_p, l1, l2: (10,)."""
        return np.concatenate([self.arm.constants(), [self.payload, self.arm.l1, self.arm.l2]])


def random_arm(seed: int) -> tuple[Arm, float]:
    """An arm of plausible make and a payload of a quarter to one of its second link's mass."""
    rng = np.random.default_rng(seed)
    m1, m2 = rng.uniform(0.4, 3.0), rng.uniform(0.2, 1.5)
    l1, l2 = rng.uniform(0.15, 0.5, 2)
    lc1, lc2 = l1 * rng.uniform(0.35, 0.65), l2 * rng.uniform(0.35, 0.65)
    inertia1, inertia2 = (
        m1 * l1**2 / 12 * rng.uniform(0.7, 1.5),
        m2 * l2**2 / 12 * rng.uniform(0.7, 1.5),
    )
    b1, b2 = rng.uniform(0.05, 0.3, 2)
    return Arm(m1, m2, lc1, lc2, l1, l2, inertia1, inertia2, b1, b2), float(
        m2 * rng.uniform(0.25, 1.0)
    )


def case_of(name: str) -> Case:
    """The paper's case `case1` or `case2`, or the random arm `arm<seed>`."""
    if name.startswith("case"):
        return load_case(name)
    arm, payload = random_arm(int(name.removeprefix("arm")))
    return Case(name, arm, payload, None, {})


def waves(
    t: FloatArray | float, frequency: FloatArray, size: FloatArray, phase: FloatArray
) -> FloatArray:
    """Angles, velocities and accelerations (3, …, N) at times (N,) of sums of sines (…, n)."""
    w, size = 2 * np.pi * frequency[..., None], size[..., None]
    at = w * t + phase[..., None]
    sines = size * np.sin(at), size * w * np.cos(at), -size * w**2 * np.sin(at)
    return np.asarray(np.stack(np.broadcast_arrays(*sines)).sum(axis=-2))


def logged(
    t: FloatArray,
    theta: FloatArray,
    tau: FloatArray,
    rng: np.random.Generator,
    sigmas: tuple[float, float | FloatArray],
    **reading: Any,
) -> Log:
    """One draw of the log of angles in rad and torques in N m by sensors with white noise.

    A joint may turn as often as it will.
    """
    theta = theta + sigmas[0] * rng.standard_normal(theta.shape)
    tau = tau + sigmas[1] * rng.standard_normal(tau.shape)
    read = Reading(**{"accepted": ("DEGREES",), **reading})
    return Log(
        np.round(t * 1e9).astype(np.int64), theta, tau, Origin("arm.csv", "csv", {}, reading=read)
    )


def scene(name: str) -> Scene:
    """The scene `case1`, `case2`, or `arm<seed>`.

    Arms of odd seed get a torque that turns joint 1 round.
    """
    case, seed = case_of(name), sum(name.encode())
    arm, t = case.arm, np.arange(round(DURATION * RATE) + 1) / RATE
    k = arm.constants()
    odd = name.startswith("arm") and int(name.removeprefix("arm")) % 2
    bias = np.array([[odd * float(k[3] + k[1] + 2 * k[5])], [0.0]])

    def moved(constants: FloatArray, number: int) -> Truth:
        wide = wide_multi_sine(arm, number)
        motion = simulate(constants, lambda times: wide(times) + bias, t)
        return Truth(t, motion.theta, motion.omega, motion.tau)

    loaded = arm.constants(case.payload)
    return Scene(arm, case.payload, moved(k, seed), moved(loaded, seed + 1))


def noisy(
    truth: Truth, sigma_theta: float, sigma_tau: float, encoder: bool, rng: np.random.Generator
) -> Segment:
    """One draw of a log: Gaussian noise on the angles, or an encoder of twelve bits at a random
    phase.
    """
    theta = truth.theta + sigma_theta * rng.standard_normal(truth.theta.shape)
    if encoder:
        phase = rng.uniform(0, ENCODER_STEP, (2, 1))
        theta = np.round((truth.theta + phase) / ENCODER_STEP) * ENCODER_STEP - phase
    return Segment(
        0.0, 1 / RATE, theta, truth.tau + sigma_tau * rng.standard_normal(truth.tau.shape)
    )


def filtered_least_squares(bare: Segment, burdened: Segment, gravity: float) -> FloatArray:
    """Inverse-dynamics least squares behind zero-phase filters of each cutoff: k1 … k7 and m_p (C,
    8).
    """
    rows = []
    for cutoff in CUTOFFS:
        k, loaded = _inverse_dynamics(bare, cutoff), _inverse_dynamics(burdened, cutoff)
        rows.append(np.append(k, _payload_mass(k, loaded, gravity)))
    return np.array(rows)


def _inverse_dynamics(log: Segment, cutoff: float) -> FloatArray:
    from scipy.signal import butter, sosfiltfilt

    sections = butter(4, cutoff, fs=1 / log.dt, output="sos")
    theta, tau = sosfiltfilt(sections, np.stack([log.theta, log.tau]), axis=-1)
    omega = np.gradient(theta, log.dt, axis=1)
    alpha = np.gradient(omega, log.dt, axis=1)
    Y = np.stack([inverse_dynamics(k, theta, omega, alpha) for k in np.eye(7)], axis=1)
    # Filtered alike, as Gautier's practice is: the regressor's products pass the same filter as
    # the torque.
    Y = sosfiltfilt(sections, Y, axis=-1)
    tau = sosfiltfilt(sections, tau, axis=-1)
    inner = slice(300, -300)
    A = np.concatenate([Y[joint][:, inner].T for joint in range(2)])
    b = np.concatenate([tau[joint][inner] for joint in range(2)])
    k: FloatArray = np.linalg.lstsq(A, b, rcond=None)[0]
    return k


def _payload_mass(k: FloatArray, loaded: FloatArray, gravity: float) -> float:
    """The paper's route from the constants to m_p."""
    z1, z4 = loaded[4] - k[4], loaded[3] - k[3]
    return float(z4**2 / (z1 * gravity**2))
