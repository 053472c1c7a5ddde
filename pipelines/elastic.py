"""Whether intervals hold where joints are elastic: `python -m pipelines.elastic`.

Arms whose motors turn the links by springs without damping (`pipelines.simulator`); angles are
logged at the motors. Each arm is identified with no flag from one log and from four, of a torque in
open loop and of a digital PD controller. "held" are the 95 % intervals of k1 … k5 that hold the
truth, of all results and of those with exit code 0; "far" is the largest distance of one of the
latter in standard deviations, "found" how often elastic joints were chosen, and "k_e held" the
intervals of their stiffness. Of stiff joints none is to be chosen.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.identification.identify import identify
from algid.log import Log
from algid.model import RIGID
from pipelines.accuracy_scenes import logged, random_arm
from pipelines.experiment import Seen, count, experiment, judged, number, share
from pipelines.race_scenes import DURATION, RATE, SIGMA_TAU, SIGMA_THETA, followed, sines
from pipelines.simulator import Arms, inertias

SUBSTEPS = 6
SPEEDS = (30.0, 55.0, 80.0)  # rad/s, of a link against its locked motor
DRIVES = ("open loop", "digital PD")
ROTOR = (0.05, 0.2)  # of the links' inertia
COULOMB = 0.05  # of the drive's RMS
TRACKED = 12.0  # rad/s, of the controller
PRECISE = 0.01
"""Noise of every second stiff arm's angles, of that of the others: a torque's own noise, which a
load read from it would carry into its column, then is most of what is left."""
ARMS, STIFF = 10, 100  # of each stiffness and drive


@cache
def scenes(
    speed: float, drive: str, seeds: range, runs: int
) -> list[tuple[FloatArray, FloatArray, list[Log]]]:
    """Of each seed k1 … k5 (5,) as logs show them, the stiffness (2,), and so many logs.

    `speed` is that of the joints in rad/s, 0 if they are stiff. All are simulated side by side.
    """
    keys = list(product(seeds, range(runs)))
    k = np.stack([random_arm(100 + seed)[0].constants() for seed, _ in keys], axis=-1)
    links, inertia = np.stack([k[4] + k[2], k[2]]), inertias(k)
    shares = [np.random.default_rng([7, seed]).uniform(*ROTOR, 2) for seed, _ in keys]
    rotor = np.transpose(shares) * links
    fine = np.arange(2 * SUBSTEPS * round(DURATION * RATE) + 1) / (2 * SUBSTEPS * RATE)
    waves = [sines(k[:, s], 1000 * seed + run, fine) for s, (seed, run) in enumerate(keys)]
    # runs of an arm rub alike: by its first drive
    size = [np.sqrt(np.mean(wave**2, axis=1)) for wave in waves[::runs]]
    coulomb = COULOMB * np.transpose(size).repeat(runs, axis=1)
    arms = Arms(k, coulomb=coulomb, rotor=rotor, stiffness=speed**2 * links)
    drawn = [np.random.default_rng(1000 * seed + run + 50) for seed, run in keys]
    held = np.full(len(keys), drive == "digital PD")
    gains = inertia * TRACKED**2, 1.4 * inertia * TRACKED
    states, torques = followed(arms, np.stack(waves, axis=-1), held, gains, drawn, SUBSTEPS)
    t, logs = np.arange(len(states)) / RATE, []
    for place, (seed, run) in enumerate(keys):
        rng = np.random.default_rng([seed, run, DRIVES.index(drive), int(speed or 1000)])
        signals = states[:, :2, place].T, torques[..., place].T
        precise = PRECISE if seed % 2 and not speed else 1.0
        logs.append(logged(t, *signals, rng, (precise * SIGMA_THETA, SIGMA_TAU), accepted=()))
    truth = k[:5] + np.outer([0, 0, 0, 0, 1], rotor[0])
    return [
        (truth[:, first], speed**2 * links[:, first], logs[first : first + runs])
        for first in range(0, len(keys), runs)
    ]


def draw(truth: FloatArray, stiffness: FloatArray, logs: list[Log]) -> Seen:
    """What became of an arm's logs."""
    result = identify(logs, report=False)
    seen = judged(result, dict(zip(RIGID, truth, strict=True)))
    if result.complete and not result.verdict.failed:
        seen |= {"exit 0 or 4": [1], "held, exit 0": seen["held"], "z, exit 0": seen["z"]}
    chosen = result.fit.stiffness if result.fit else {}
    seen["found"] = [bool(chosen)]
    for one, true in zip(chosen.values(), stiffness, strict=False):
        if one.half is not None and one.estimate is not None:
            seen["held k_e"].append(abs(one.estimate - true) <= one.half)
    return seen


def rows(given: Namespace) -> Iterable[tuple[str, Iterable[tuple[Any, ...]]]]:
    """By stiffness, drive and number of logs; the draws of a row are simulated side by side."""
    for drive, speed in product(DRIVES, (*SPEEDS, 0.0)):
        arms = range(given.arms or ARMS) if speed else range(1000, 1000 + (given.arms or STIFF))
        for logs in (1, 4) if speed else (1,):
            title = f"{speed:g} rad/s, {drive}, {logs}" if speed else f"stiff, {drive}, 1"
            yield (
                title,
                (
                    (truth, stiffness, made)
                    for truth, stiffness, made in scenes(speed, drive, arms, logs)
                ),
            )


if __name__ == "__main__":
    columns = {
        "draws": count("draw"),
        "found": count("found"),
        "held": share("held"),
        "exit 0": count("exit 0 or 4"),
        "held of exit 0": share("held, exit 0"),
        "far, σ": number("z, exit 0", np.max),
        "k_e held": share("held k_e"),
    }
    experiment("elastic", __doc__, rows, draw, columns)
