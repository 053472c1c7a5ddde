"""Arms with the errors of real joints and sensors, by a simulator that shares no code with algid.

Each row of `python -m pipelines.accuracy_models` is simulated on hidden arms, ten seconds unloaded
and ten loaded, and identified by the likelihood, or robustly where that is refuted, with the terms
that the logs choose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.signal import lfilter

from algid.arm import FloatArray
from algid.signals.segments import Segment
from algid.synth.excitation import wide_multi_sine
from pipelines.accuracy_scenes import random_arm
from pipelines.simulator import Arms, swung

RATE = 1000.0
DURATION = 10.0
SUBSTEPS = 5
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2
MOTOR_SHARE = 0.05  # of an elastic joint's motor inertia in that of its link


@dataclass(frozen=True)
class Errors:
    """What the arm or its sensors have beside eq. (1); shares are of the RMS torque of each joint.

    Parameters
    ----------
    coulomb, stribeck, asymmetry : share of Coulomb friction, of its excess at rest, of half its
        asymmetry
    stribeck_speed : rad/s
    load : friction over the joint's load
    rotor : inertia of joint 2's rotor over k3
    ripple : share of a torque that repeats twelve times a turn
    elastic : Hz of a link against its locked motor, 0 for stiff joints
    play : rad, either way, behind an elastic joint
    base : Hz of a base that gives, 0 for none
    gains : of the two torque sensors
    offset, drift : shares of a torque offset and of its random walk over the log
    lag, delay : s, of the logged torque behind the true one, and ahead of it
    zero : rad, of both angles
    """

    coulomb: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.3
    asymmetry: float = 0.0
    load: float = 0.0
    rotor: float = 0.0
    ripple: float = 0.0
    elastic: float = 0.0
    play: float = 0.0
    base: float = 0.0
    gains: tuple[float, float] = (1.0, 1.0)
    offset: float = 0.0
    drift: float = 0.0
    lag: float = 0.0
    delay: float = 0.0
    zero: tuple[float, float] = (0.0, 0.0)

    @property
    def mechanical(self) -> Errors:
        """Those that change the motion, without those of the sensors."""
        return replace(
            self, gains=(1.0, 1.0), offset=0.0, drift=0.0, lag=0.0, delay=0.0, zero=(0.0, 0.0)
        )


DEGREE = np.pi / 180
ROWS = {
    "none": Errors(),
    "Coulomb friction 3 %": Errors(coulomb=0.03),
    "Coulomb friction 10 %": Errors(coulomb=0.1),
    "Coulomb 10 %, Stribeck + 5 %": Errors(coulomb=0.1, stribeck=0.05),
    "asymmetric Coulomb 12 / 8 %": Errors(coulomb=0.1, asymmetry=0.02),
    "load-dependent friction 5 %": Errors(load=0.05),
    "torque offset 3 %": Errors(offset=0.03),
    "torque offset that drifts": Errors(offset=0.03, drift=0.02),
    "rotor inertia of joint 2": Errors(rotor=0.2),
    "torque gains + 3 / - 3 %": Errors(gains=(1.03, 0.97)),
    "zeros of the angles 1°, - 1°": Errors(zero=(DEGREE, -DEGREE)),
    "torque low-passed at 30 Hz": Errors(lag=1 / (2 * np.pi * 30)),
    "torque 4 ms early": Errors(delay=4e-3),
    "torque ripple 3 %": Errors(ripple=0.03),
    "backlash 0.15° behind a stiff joint": Errors(elastic=60.0, play=0.075 * DEGREE),
    "elastic joints, 15 Hz": Errors(elastic=15.0),
    "a base that gives, 8 Hz": Errors(base=8.0),
    "all of it, mildly": Errors(
        coulomb=0.04,
        stribeck=0.02,
        asymmetry=0.005,
        load=0.02,
        rotor=0.05,
        ripple=0.005,
        offset=0.01,
        delay=1e-3,
    ),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """Motion and logged torque (2, N) without noise, and the truth by name."""

    theta: FloatArray
    tau: FloatArray
    truth: dict[str, float]

    def log(self, rng: np.random.Generator) -> Segment:
        """One draw of the sensors' noise."""
        theta, tau = (rng.standard_normal(self.theta.shape) for _ in range(2))
        return Segment(0.0, 1 / RATE, self.theta + SIGMA_THETA * theta, self.tau + SIGMA_TAU * tau)


def scenes(errors: Errors, seeds: tuple[int, ...]) -> list[tuple[Scene, Scene]]:
    """Of each arm the scene without and with its payload."""
    torque, size, theta = _moved(errors.mechanical, seeds)
    found = [
        _sensed(errors, seeds[place // 2], bool(place % 2), torque[..., place], size[:, place], one)
        for place, one in enumerate(theta)
    ]
    return list(zip(found[::2], found[1::2], strict=True))


@cache
def _moved(errors: Errors, seeds: tuple[int, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Torques (2, M, S) at half steps, their sizes (2, S), and motors' angles (S, 2, N).

    Arms without and with payload take turns. The friction's width is each arm's own, from 0.03 to
    0.2 rad/s.
    """
    samples = round(DURATION * RATE) + 1
    times = np.arange(2 * SUBSTEPS * samples + 1) / (2 * SUBSTEPS * RATE)
    pairs = [(seed, loaded) for seed in seeds for loaded in range(2)]
    made = [random_arm(seed) for seed, _ in pairs]
    waves = [
        wide_multi_sine(arm, 1000 * seed + loaded)
        for (arm, _), (seed, loaded) in zip(made, pairs, strict=True)
    ]
    drive = np.stack([wave(times) for wave in waves], axis=-1)
    # The unloaded arm's, so that the loaded one has the same joints.
    size = np.sqrt(np.mean(drive[:, : 1 - 2 * SUBSTEPS, ::2] ** 2, axis=1)).repeat(2, axis=1)
    width = [
        np.exp(np.random.default_rng(seed).uniform(np.log(0.03), np.log(0.2))) for seed, _ in pairs
    ]
    bare = np.stack([arm.constants() for arm, _ in made], axis=-1)
    k = np.stack([arm.constants(payload) for arm, payload in made], axis=-1)
    k[:, ::2] = bare[:, ::2]
    inertia, mass = (
        np.stack([bare[4] + bare[2], bare[2]]),
        4 * np.array([arm.m1 + arm.m2 for arm, _ in made]),
    )
    stiffness = (2 * np.pi * errors.elastic) ** 2 * inertia
    rotor = np.stack([0 * bare[2], errors.rotor * bare[2]])
    arms = Arms(
        k,
        coulomb=errors.coulomb * size,
        stribeck=errors.stribeck * size,
        asymmetry=errors.asymmetry * size,
        ripple=errors.ripple * size,
        width=np.array(width),
        speed=errors.stribeck_speed,
        load=errors.load,
        rotor=MOTOR_SHARE * inertia if errors.elastic else rotor,
        stiffness=stiffness,
        damping=0.04 * np.sqrt(stiffness * inertia),
        play=errors.play,
        mass=mass if errors.base else np.inf,
        spring=mass * (2 * np.pi * errors.base) ** 2,
        damper=0.1 * mass * 2 * np.pi * errors.base,
    )

    def rate(half: int, x: FloatArray) -> FloatArray:
        return arms.rate(x, drive[:, half])

    states, _ = swung(
        rate, lambda half, _: drive[:, half], arms.hanging(), samples, 1 / RATE, SUBSTEPS
    )
    return drive, size, np.moveaxis(states[:, :2], (0, 2), (2, 0))


def _sensed(
    errors: Errors, seed: int, loaded: bool, torque: FloatArray, size: FloatArray, theta: FloatArray
) -> Scene:
    """What the sensors log of a motion."""
    dense = torque * np.array([[errors.gains[0]], [errors.gains[1]]])
    step = 1 / (2 * SUBSTEPS * RATE)
    if errors.lag:
        decay = np.exp(-step / errors.lag)
        mean = (1 - decay) * errors.lag / step
        dense, _ = lfilter(
            [1 - mean, mean - decay], [1, -decay], dense, axis=1, zi=mean * dense[:, :1]
        )
    count = theta.shape[1]
    ahead = round(errors.delay / step) + 2 * SUBSTEPS * np.arange(count)
    tau = dense[:, np.minimum(ahead, 2 * SUBSTEPS * (count - 1))]
    rng = np.random.default_rng([seed, loaded])
    walk = np.cumsum(rng.standard_normal(tau.shape), axis=1) / np.sqrt(count)
    tau = tau + size[:, None] * (errors.offset * np.array([[1.0], [-1.0]]) + errors.drift * walk)
    truth = _truth(seed, errors)
    for name, share in (("f", errors.coulomb), ("s", errors.stribeck)):
        truth |= {f"{name}{joint + 1}": errors.gains[0] * share * size[joint] for joint in range(2)}
    return Scene(theta - np.array(errors.zero)[:, None], tau, truth)


def _truth(seed: int, errors: Errors) -> dict[str, float]:
    """k1 … k7 and m_p in the units of the first joint's torque sensor.

    Where the angles' zeros are off, of k1, k2 and k4 the cosine's part over the logged angles,
    which is what a model with phases has by these names.
    """
    arm, payload = random_arm(seed)
    k = arm.constants()
    first, second = errors.zero
    k[[0, 1, 3]] *= np.cos([second, first + second, first])
    if errors.elastic:
        k[4] += MOTOR_SHARE * (k[4] + k[2])
    names = [*(f"k{number}" for number in range(1, 8)), "m_p"]
    return dict(zip(names, (errors.gains[0] * np.append(k, payload)).tolist(), strict=True))
