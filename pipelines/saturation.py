"""Torques that are cut off: are they found, and what intervals hold then: `make saturation`.

Each arm moves under a wide torque, every second log with Coulomb friction. The limit is a share of
the torque's largest value, of both joints:

- sensor: the arm gets the whole torque, the log holds what lies within the limit.
- true: the arm gets what the log holds, which stands at the limit. Nothing may be left out.

Asked: intervals of k1 … k7 that hold the truth in 90 % or more, no log that is Good, and of true
limits none that loses a sample.
"""

from __future__ import annotations

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.accuracy_scenes import case_of
from pipelines.experiment import Seen, count, experiment, grid, judged, number, share

RATE, DURATION = 1000.0, 10.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
COULOMB, WIDTH = 0.05, 0.02  # of the largest torque; rad/s
CAUSES, LEVELS = ("sensor", "true"), (0.6, 0.7, 0.8)
ARMS = ("case1", "arm22", "arm24")


def log_of(name: str, cause: str, level: float, seed: int) -> tuple[FloatArray, Log]:
    """Constants (7,) of an arm, and its log with a limit at the share `level` of its torque."""
    arm = case_of(name).arm
    k = arm.constants()
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    whole = wide_multi_sine(arm, sum(name.encode()) + 100 * seed)
    asked = whole(t)
    limit = level * np.abs(asked).max(axis=1, keepdims=True)

    def within(instants: FloatArray) -> FloatArray:
        torque = whole(instants)
        bound = limit.reshape(2, *[1] * (torque.ndim - 1))
        return np.clip(torque, -bound, bound)

    motion = simulate(k, whole if cause == "sensor" else within, t)
    rng = np.random.default_rng([seed, 11])
    # A motor that overcomes friction by itself: the limit is of the torque with it.
    friction = COULOMB * np.abs(asked).max(axis=1, keepdims=True) * np.tanh(motion.omega / WIDTH)
    tau = motion.tau + friction * (seed % 2)
    theta = motion.theta + SIGMA_THETA * rng.standard_normal(tau.shape)
    noisy = tau + SIGMA_TAU * rng.standard_normal(tau.shape)
    logged = np.clip(noisy, -limit, limit) if cause == "sensor" else tau
    return k, Log.from_arrays(t, theta, logged)


def draw(cause: str, level: float, name: str, seed: int) -> Seen:
    """Identify one log without a flag."""
    k, log = log_of(name, cause, level, seed)
    result = identify(log, report=False)
    seen = judged(result, dict(zip(CONSTANT_NAMES, k, strict=True)))
    told = [one for one in result.notices if one.code == "CLIPPED_TORQUE"]
    seen["share"] = [max((one.numbers["percent"] for one in told), default=0.0)]
    return seen


if __name__ == "__main__":
    rows = {f"{cause}, {level:g}": (cause, level) for cause in CAUSES for level in LEVELS}
    columns = {
        "logs": count("draw"),
        "told": count("CLIPPED_TORQUE"),
        "left out, %": number("share", np.mean),
        "held": share("held"),
        "worst, σ": number("z", np.max),
        "Good": count("good"),
        "failed": count("failed"),
    }
    experiment("saturation", __doc__, grid(rows, ARMS), draw, columns, draws=4)
