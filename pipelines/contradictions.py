"""Whether two torques that contradict each other are named: `make contradictions`.

Each draw is five runs of one build of a real arm, with joint 2's torque multiplied by a factor. One
half of the draws is from the ten runs of C.1, one from the nine of A.0. "Named" are those with
JOINTS_CONTRADICT, which leaves k1 … k5 without an error bar (exit 3), "gain" those with
TORQUE_GAIN.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from algid.identification.identify import identify
from pipelines.experiment import Seen, count, experiment, grid, judged
from pipelines.run_to_run import BUILDS, DATA, runs

FACTORS = (1.0, 1.1, 1.2, 1.3, 1.41, 1.7, 2.0, 0.71)
RUNS = 5


def draw(factor: float, folder: Path, number: int) -> Seen:
    """What is said of some runs, joint 2's torque times `factor`."""
    rng = np.random.default_rng(0)
    for place in range(number + 1):
        every = runs(folder, tuple(BUILDS)[place % len(BUILDS)])
        places = sorted(rng.choice(len(every), RUNS, replace=False).tolist())
    scale = np.array([[1.0], [factor]])
    logs = [replace(every[place], tau=every[place].tau * scale) for place in places]
    seen = judged(identify(logs, report=False), {})
    seen["complete"] = [bool(seen["JOINTS_CONTRADICT"]) and seen["exit 0"][0]]
    return seen


if __name__ == "__main__":
    columns = {
        "draws": count("draw"),
        "named": count("JOINTS_CONTRADICT"),
        "gain": count("TORQUE_GAIN"),
        "named, and yet exit 0": count("complete"),
    }
    rows = {f"torque 2 × {factor:g}": (factor,) for factor in FACTORS}
    experiment("contradictions", __doc__, grid(rows, [DATA]), draw, columns, draws=30)
