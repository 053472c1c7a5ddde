"""Torques that a sensor cuts off: whether they are found, and what intervals hold then.

    python -m pipelines.saturation [--arms case1,arm22] [--seeds 3] [--levels 0.6,0.8]

Each arm moves under a wide torque, every second log with Coulomb friction. The limit is a share of
the torque's largest value, of both joints:

- sensor: the arm gets the whole torque, the log holds what lies within the limit.
- true: the arm gets what the log holds, which stands at the limit. Nothing may be left out.

With ``--sound`` it counts the logs without a limit of which samples would be left out: those of
`pipelines.real_arms` (joints and sensors with 18 kinds of errors) and of `pipelines.accuracy_hold`
(random binary torques, slow and held ones, with and without an encoder of twelve bits).

Asked: intervals of k1 … k7 that hold the truth in 90 % or more, no log that is Good, and of true
limits none that loses a sample.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.estimators.saturation import saturation_of
from algid.identification.identify import identify
from algid.log import Log
from algid.signals.segments import Segment, segments
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import simulate
from pipelines import accuracy_hold, real_arms
from pipelines.accuracy_scenes import ENCODER_STEP, case_of

RATE, DURATION = 1000.0, 10.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
COULOMB, WIDTH = 0.05, 0.02  # of the largest torque; rad/s
CAUSES = ("sensor", "true")


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


@dataclass(frozen=True, eq=False)
class Seen:
    """Intervals that hold the truth, distances in σ, how many joints are told of, and the grade."""

    inside: list[bool]
    distance: list[float]
    told: int
    share: float
    grade: str


def seen(name: str, cause: str, level: float, seed: int) -> Seen:
    """Identify one log without a flag."""
    k, log = log_of(name, cause, level, seed)
    result = identify(log, report=False)
    inside, distance = [], []
    for one, true in zip(CONSTANT_NAMES, k, strict=True):
        found = result.parameters[one]
        if found.estimate is None or found.std is None or found.ci95 is None:
            continue
        inside.append(bool(found.ci95[0] <= true <= found.ci95[1]))
        distance.append(round(float(abs(found.estimate - true) / found.std), 2))
    told = [one for one in result.notices if one.code == "CLIPPED_TORQUE"]
    share = max((one.numbers["percent"] for one in told), default=0.0)
    return Seen(inside, distance, len(told), share, result.verdict.grade)


def line(cause: str, level: float, arms: Sequence[str], seeds: int, verbose: bool) -> str:
    """A row of the table."""
    found: list[Seen] = []
    for name in arms:
        for seed in range(seeds):
            found.append(seen(name, cause, level, seed))
            if verbose:
                print("  ", name, seed, found[-1], flush=True)
    inside = 100 * np.mean([each for one in found for each in one.inside])
    worst = max(each for one in found for each in one.distance)
    told = sum(one.told > 0 for one in found)
    left_out = np.mean([one.share for one in found])
    good = sum(one.grade == "good" for one in found)
    failed = sum(one.grade == "failed" for one in found)
    return (
        f"| {cause} | {level:g} | {len(found)} | {told} | {left_out:.1f} | {inside:.1f} "
        f"| {worst:.1f} | {good} | {failed} |"
    )


def sound(arms: int) -> str:
    """How many logs without a limit have one by mistake."""
    logs: list[list[Segment]] = []
    for key in accuracy_hold.ROWS:
        for held in (True, False):
            whole = accuracy_hold.scene(key, held, accuracy_hold.FIRST_ARM)
            logs.append(list(segments([whole.log(np.random.default_rng(1))])))
            t, tau, step = whole.truth.t, whole.truth.tau, ENCODER_STEP
            coarse = Log.from_arrays(t, np.round(whole.truth.theta / step) * step, tau)
            logs.append(list(segments([coarse])))
    made = real_arms.scenes(list(real_arms.ROWS), list(range(11, 11 + arms)))
    logs += [[one.log(np.random.default_rng(1))] for one in made.values()]
    wrong = sum(bool(saturation_of(one).limits) for one in logs)
    return f"Logs without a limit of which samples would be left out: {wrong} of {len(logs)}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arms", default="case1,arm22,arm24")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--levels", default="0.6,0.8")
    parser.add_argument("--causes", default=",".join(CAUSES))
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--sound", action="store_true")
    wanted = parser.parse_args(arguments)
    if wanted.sound:
        print(sound(len(wanted.arms.split(","))))
        return
    print(
        "| cut off by | at | logs | told | left out, % | coverage, % | worst, σ | Good | Failed |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for cause in wanted.causes.split(","):
        for level in map(float, wanted.levels.split(",")):
            arms = wanted.arms.split(",")
            print(line(cause, level, arms, wanted.seeds, wanted.verbose), flush=True)


if __name__ == "__main__":
    main()
