"""What a recorder makes of a motion: noise, encoder steps, uneven and missing samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.log import Log, Origin, Truth
from algid.synth.simulator import SimulatedMotion


@dataclass(frozen=True)
class Sensors:
    """How the arm is measured.

    Parameters
    ----------
    position_noise : float, rad, standard deviation of white noise on each angle
    torque_noise : float, N m, likewise on each torque
    encoder_bits : int or None, angles rounded to 2π / 2^bits
    jitter : float, s, standard deviation of the sampling instants about the uniform ones
    drop : float in [0, 1), share of samples lost at random
    seed : int
    start_ns : int, the first stamp
    """

    position_noise: float = 0.0
    torque_noise: float = 0.0
    encoder_bits: int | None = None
    jitter: float = 0.0
    drop: float = 0.0
    seed: int = 0
    start_ns: int = 0

    @property
    def exact(self) -> bool:
        """Whether the angles are recorded as they are."""
        return self.position_noise == 0 and self.encoder_bits is None


def sample_times(rate: float, duration: float, sensors: Sensors) -> FloatArray:
    """Instants of samples (N,) in s, on whole nanoseconds, with jitter, less dropped ones."""
    count = round(rate * duration) + 1
    rng = np.random.default_rng([sensors.seed, 1])
    t = np.arange(count) / rate
    if sensors.jitter > 0:
        limit = 0.45 / rate  # instants keep their order
        t[1:] += np.clip(rng.normal(0, sensors.jitter, count - 1), -limit, limit)
    if sensors.drop > 0:
        kept = rng.random(count) >= sensors.drop
        kept[[0, -1]] = True
        t = t[kept]
    return np.round(t * 1e9) * 1e-9


def record(motion: SimulatedMotion, sensors: Sensors, truth: Truth | None, name: str) -> Log:
    """The log of a motion as the sensors see it.

    Velocities are in it only where the angles are exact: an arm with encoders measures none.
    """
    rng = np.random.default_rng([sensors.seed, 2])
    theta = motion.theta + sensors.position_noise * rng.standard_normal(motion.theta.shape)
    if sensors.encoder_bits is not None:
        step = 2 * np.pi / 2**sensors.encoder_bits
        theta = step * np.round(theta / step)
    tau = motion.tau + sensors.torque_noise * rng.standard_normal(motion.tau.shape)
    return Log(
        stamp_ns=sensors.start_ns + np.round(motion.t * 1e9).astype(np.int64),
        theta=theta,
        tau=tau,
        omega=motion.omega if sensors.exact else None,
        origin=Origin(path=name, format="synthetic", mapping={}, truth=truth),
    )
