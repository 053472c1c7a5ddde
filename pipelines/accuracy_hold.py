"""Whether logs tell a held torque from one that moves evenly, and what it does to intervals.

Each row is simulated with a torque that is held from sample to sample and with one that is not,
and identified without a flag. Asked: intervals of k1 … k7 that hold the truth in 92 % or more,
errors within 1.5 times the bound of a known hold, and at most 1 % of the even torques taken for
held ones.

Slow motions are under a PD controller, the others in open loop. Of what a
controller holds for a millisecond and a log has every tenth time, nothing is held.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.synth.excitation import SampledTorque, wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.accuracy_scenes import random_arm, waves
from pipelines.cramer_rao import Truth, information
from pipelines.experiment import Seen, count, experiment, grid, judged, number, rms, share
from pipelines.simulator import Controller, Plan, controlled, inertias

FIRST_ARM = 300  # seeds of arms that nothing was tuned on
SIGMA_THETA, SIGMA_TAU = 1e-3, 1e-2
PRBS_HOLD = 0.05  # s
STIFFNESS = 2 * np.pi * 4.0  # rad/s, the controller's bandwidth


@dataclass(frozen=True)
class Row:
    """A motion: its rate in Hz, its seconds, its drive, and of how many samples one is logged."""

    name: str
    rate: float
    duration: float
    drive: str
    every: int = 1


ROWS = {
    "wide": Row("wide, 1 kHz", 1000.0, 10.0, "wide"),
    "short": Row("wide, 1 s", 1000.0, 1.0, "wide"),
    "prbs": Row("PRBS, 50 ms", 1000.0, 10.0, "prbs"),
    "slow": Row("slow, PD", 1000.0, 10.0, "slow"),
    "slow100": Row("slow, PD of 1 kHz, logged at 100 Hz", 1000.0, 10.0, "slow", 10),
    "slow50": Row("slow, PD of 1 kHz, logged at 50 Hz", 1000.0, 10.0, "slow", 20),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """An arm and its true motion."""

    arm: Arm
    truth: Truth

    @cached_property
    def bound(self) -> FloatArray:
        """The least deviations (7,) of the constants, infinite where the motion tells none."""
        return _bound(self.truth, self.arm)

    def log(self, rng: np.random.Generator) -> Log:
        """One draw of the sensors' noise."""
        theta, tau = (rng.standard_normal(self.truth.theta.shape) for _ in range(2))
        truth = self.truth
        return Log.from_arrays(
            truth.t, truth.theta + SIGMA_THETA * theta, truth.tau + SIGMA_TAU * tau
        )


@cache
def scene(key: str, held: bool, seed: int) -> Scene:
    """The motion of the arm of that seed."""
    row = ROWS[key]
    arm, _ = random_arm(seed)
    t = np.arange(round(row.duration * row.rate) + 1) / row.rate
    moved = _pd if row.drive == "slow" else _open
    whole, every = moved(row, arm, t, held, seed), row.every
    signals = (signal[:, ::every] for signal in (whole.theta, whole.omega, whole.tau))
    return Scene(arm, Truth(t[::every], *signals))


def _bound(truth: Truth, arm: Arm) -> FloatArray:
    k = arm.constants()
    S = information(truth, k, arm.g, SIGMA_THETA, SIGMA_TAU, loaded=False)
    size = np.sqrt(np.diag(S))
    values, vectors = np.linalg.eigh(S / np.outer(size, size))
    told = values > 1e-9 * values.max()
    variance = (vectors[:, told] ** 2 / values[told]).sum(axis=1) / size**2
    lost = (vectors[:, ~told] ** 2).sum(axis=1) > 1e-6
    return np.where(lost, np.inf, np.sqrt(variance))


def _open(row: Row, arm: Arm, t: FloatArray, held: bool, seed: int) -> Truth:
    k = arm.constants()
    wide = wide_multi_sine(arm, 1000 * seed)
    tau = wide(t)
    if row.drive == "prbs":
        rng = np.random.default_rng([seed, 7])
        levels = rng.choice([-0.8, 0.8], (2, round(row.duration / PRBS_HOLD) + 1))
        place = (t / PRBS_HOLD + 1e-9).astype(int)
        tau = levels[:, place] * np.array([[k[3] + k[1]], [k[1]]])
    even = SampledTorque(t, tau, "foh") if row.drive == "prbs" else wide
    motion = simulate(k, SampledTorque(t, tau, "zoh") if held else even, t)
    return Truth(t, motion.theta, motion.omega, tau)


def _pd(row: Row, arm: Arm, t: FloatArray, held: bool, seed: int) -> Truth:
    """A PD controller follows sines of 0.1 to 0.5 Hz."""
    rng = np.random.default_rng([seed, 3])
    fine = np.arange(2 * t.size - 1) / (2 * row.rate)
    frequencies = np.array([0.1, 0.2, 0.3, 0.5])
    phase = rng.uniform(0, 2 * np.pi, (2, frequencies.size))
    size = 0.5 / np.sqrt(np.arange(1, frequencies.size + 1))
    theta, omega, _ = waves(fine, frequencies, size, phase)
    theta[0] -= np.pi / 2
    k = arm.constants()
    inertia = inertias(k)
    law = Controller(inertia * STIFFNESS**2, 2 * 0.7 * inertia * STIFFNESS, digital=held)
    plan = Plan(theta, omega, np.zeros_like(theta))
    angles, torques, _ = controlled(k, plan, law, np.zeros(2), row.rate, rng)
    return Truth(t, angles, np.gradient(angles, t, axis=1), torques)


def draw(key: str, held: bool, seed: int, number: int) -> Seen:
    """Identify one log without a flag."""
    here = scene(key, held, seed)
    result = identify(here.log(np.random.default_rng([seed, number, held])), report=False)
    seen = judged(result, dict(zip(CONSTANT_NAMES, here.arm.constants(), strict=True)))
    for name, least, true in zip(CONSTANT_NAMES, here.bound, here.arm.constants(), strict=True):
        if np.isfinite(least):
            seen["over bound"] += [error * true / least for error in seen[f"error {name}"]]
    hold = result.fit.torque_hold if result.fit is not None else None
    assert hold is not None
    seen |= {"taken": [hold.used == "zoh"], "untold": [not hold.told]}
    seen["false"] = [bool(result.parameters.keys() - {*CONSTANT_NAMES, "delay"})]
    return seen


if __name__ == "__main__":
    rows = {
        f"{row.name}, {'held' if held else 'even'}": (key, held)
        for key, row in ROWS.items()
        for held in (True, False)
    }
    columns = {
        "taken as held": count("taken"),
        "not told or refuted": count("untold"),
        "of": count("draw"),
        "held": share("held"),
        "over bound": number("over bound", rms),
        "false terms": count("false"),
    }
    arms = range(FIRST_ARM, FIRST_ARM + 4)
    experiment("hold", __doc__, grid(rows, arms), draw, columns, draws=8)
