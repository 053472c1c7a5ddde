"""How many sound logs are withheld or accused: `make false-alarms`.

Each log is of another simulated arm and of one of `KINDS`, in turn; half of each have Coulomb
friction. Noise of angles is drawn from 1e-4 to 1e-2 rad, even in its logarithm, that of torques is
1 % of their RMS. Nothing is wrong with a log: the reasons of its verdict may say what is `TRUE` of
it, and any other accuses it falsely. A log is withheld where it is refused, its result failed or
an estimate has no interval that may be used. A row gives how many are withheld or accused, all
reasons by code, and how many intervals of k1 … k7 hold the truth. `--first` goes on where an
earlier run ended.

========  ==============================================================================
kind      log
========  ==============================================================================
plain     5 s at 1 kHz under a wide torque
jitter    the same at 500 Hz, off even instants by 8 to 15 % of a period (standard deviation),
          samples and stamps, or of every second log the stamps alone
gaps      the same at 500 Hz, 3 to 8 gaps of 20 to 300 ms
slow      60 s at 100 Hz, four sines a joint of 0.03 to 0.3 Hz that a controller follows
balanced  plain, the second link's centre of mass within 1 % of l2 of its joint
light     plain, a second link of 1 to 5 % of the first one's mass
========  ==============================================================================
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray, inverse_dynamics
from algid.base.errors import LogError
from algid.identification.identify import identify
from algid.log import Log, Origin
from algid.synth.excitation import wide_multi_sine
from algid.synth.sensors import Sensors, sample_times
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines.accuracy_scenes import random_arm, waves
from pipelines.experiment import Seen, count, experiment, grid, judged, share, words

FIRST_ARM = 1000  # seeds of arms that nothing was tuned on
KINDS = ("plain", "jitter", "gaps", "slow", "balanced", "light")
NOISE = (1e-4, 1e-2)  # rad
TORQUE_NOISE = 0.01  # of each torque's RMS
COULOMB, WIDTH = 0.05, 0.02  # of each torque's largest; rad/s
TRUE = (
    "UNEVEN_STAMPS",
    "GAPS",
    "SLOW_SAMPLING",
    "WIDE_INTERVAL",
    "NOT_SIGNIFICANT",
    "NOT_IDENTIFIABLE",
    "OPEN_DIRECTION",
    "REFUTED",
)
"""Reasons that are true of these logs: of their stamps, and of what noise leaves open.

That the likelihood does not converge is one: the robust estimate stands, and nothing is accused.
"""


def arm_of(kind: str, rng: np.random.Generator) -> Arm:
    """An arm of plausible make, whose second link is balanced or light where the `kind` says so."""
    arm, _ = random_arm(int(rng.integers(2**31)))
    if kind == "balanced":
        return replace(arm, lc2=arm.l2 * rng.uniform(-0.01, 0.01))
    if kind == "light":
        share = rng.uniform(0.01, 0.05) * arm.m1 / arm.m2
        return replace(arm, m2=share * arm.m2, I2=share * arm.I2, b2=share * arm.b2)
    return arm


def motion_of(kind: str, arm: Arm, rng: np.random.Generator, *, even: bool) -> SimulatedMotion:
    """The arm's motion at the instants of its samples, which do not jitter if they are `even`."""
    k = arm.constants()
    if kind == "slow":
        return _followed(k, np.arange(6001) / 100.0, rng)
    seed, jitter = int(rng.integers(2**31)), 0.0
    if kind == "jitter" and not even:
        jitter = rng.uniform(0.08, 0.15) / 500.0
    rate = 500.0 if kind in ("jitter", "gaps") else 1000.0
    t = sample_times(rate, 5.0, Sensors(jitter=jitter, seed=seed))
    if kind == "gaps":
        for start in rng.uniform(0.2, 4.8, rng.integers(3, 9)):
            end = start + 0.02 * 15.0 ** rng.uniform()
            t = t[(t < start) | (t > end)]
    return simulate(k, wide_multi_sine(arm, seed), t)


def _followed(k: FloatArray, t: FloatArray, rng: np.random.Generator) -> SimulatedMotion:
    """Sines about the horizontal and the stretched arm, and the torque that they take."""
    f = rng.uniform(0.03, 0.3, (2, 4))
    phase, size = rng.uniform(0, 2 * np.pi, (2, 4)), rng.uniform(0.2, 0.6, (2, 4))
    theta, omega, alpha = waves(t, f, size, phase)
    return SimulatedMotion(t, theta, omega, inverse_dynamics(k, theta, omega, alpha))


def log_of(number: int) -> tuple[Log, FloatArray]:
    """Sound log `number`, and the constants k1 … k7 (7,) of its arm."""
    kind = KINDS[number % len(KINDS)]
    rng = np.random.default_rng([FIRST_ARM, number])
    arm = arm_of(kind, rng)
    by_stamps = kind == "jitter" and bool(number // (2 * len(KINDS)) % 2)
    motion = motion_of(kind, arm, rng, even=by_stamps)
    tau = motion.tau
    noise = float(np.exp(rng.uniform(*np.log(NOISE))))
    if number // len(KINDS) % 2:
        tau = tau + COULOMB * np.abs(tau).max(axis=1, keepdims=True) * np.tanh(motion.omega / WIDTH)
    rms = np.sqrt(np.mean(tau**2, axis=1, keepdims=True))
    theta = motion.theta + noise * rng.standard_normal(tau.shape)
    tau = tau + TORQUE_NOISE * rms * rng.standard_normal(tau.shape)
    title = f"{number}: {kind}, noise {noise:.1e} rad{', Coulomb' * (number // len(KINDS) % 2)}"
    origin = Origin(title, "csv", {})
    t = motion.t
    if by_stamps:
        t = sample_times(500.0, 5.0, Sensors(jitter=rng.uniform(0.08, 0.15) / 500.0, seed=number))
    stamps = np.round(t * 1e9).astype(np.int64)
    return Log(stamps, theta, tau, origin), arm.constants()


def draw(kind: str, _arm: int, number: int) -> Seen:
    """What algid made of a sound log; "withheld" is one that is not used or falsely accused."""
    log, k = log_of(len(KINDS) * number + KINDS.index(kind))
    try:
        result = identify(log, report=False)
    except LogError as refusal:
        return {"draw": [1], "refused": [1], "withheld": [f"{log.origin.path}: {refusal}"]}
    seen = judged(result, dict(zip(CONSTANT_NAMES, k, strict=True)))
    told = {one.code for one in result.verdict.reasons}
    false = sorted(told.difference(TRUE))
    seen |= {"codes": sorted(told), "false": false}
    if false or result.verdict.failed:
        seen["withheld"] = [f"{log.origin.path}: {', '.join(sorted(told))}"]
    return seen


if __name__ == "__main__":
    columns = {
        "logs": count("draw"),
        "Good": count("good"),
        "withheld or accused": lambda seen: str(len(seen["withheld"])),
        "refused": count("refused"),
        "failed": count("failed"),
        "intervals hold": share("held"),
        "false codes": words("false"),
        "all codes": words("codes"),
        "which": words("withheld"),
    }
    kinds = {kind: (kind,) for kind in KINDS}
    experiment("false-alarms", __doc__, grid(kinds, range(1)), draw, columns, draws=50)
