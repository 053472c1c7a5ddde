"""Whether two torques that contradict each other are named: `make contradictions`.

    python -m pipelines.contradictions ../shared/data

Each set is some runs of one build of a real arm, with joint 2's torque multiplied by a factor. One
half of the sets is drawn from the ten runs of C.1, one from the nine of A.0. "Named" are those with
JOINTS_CONTRADICT, which leaves k1 … k5 without an error bar (exit 3); "gain" those with
TORQUE_GAIN instead; "silent" those of which a smaller factor was remarked on and this one is not.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from pipelines.run_to_run import BUILDS, runs

FACTORS = (1.0, 1.1, 1.2, 1.3, 1.41, 1.7, 2.0, 0.71)
REMARKS = ("JOINTS_CONTRADICT", "TORQUE_GAIN")


def remarks(folder: Path, build: str, places: Sequence[int], factor: float) -> set[str]:
    """Codes of `REMARKS` of the runs at `places`, joint 2's torque times `factor`."""
    from algid.identification.identify import identify

    every = runs(folder, build)
    scale = np.array([[1.0], [factor]])
    logs = [replace(every[place], tau=every[place].tau * scale) for place in places]
    result = identify(logs, report=False)
    seen = {one.code for one in result.notices}
    if "JOINTS_CONTRADICT" in seen and result.complete:
        raise AssertionError(f"{build} {places}: a contradiction of joints, and yet complete")
    return seen.intersection(REMARKS)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", type=int, default=30)
    parser.add_argument("--runs", type=int, default=5, help="of each set")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    sets = []
    for number in range(given.sets):
        build = tuple(BUILDS)[number % len(BUILDS)]
        count = len(runs(given.folder, build))
        sets.append((build, sorted(rng.choice(count, given.runs, replace=False).tolist())))
    print("| torque 2 times | named | gain | silent |\n|---|---|---|---|", flush=True)
    before = [False] * len(sets)
    with ProcessPoolExecutor(2) as pool:
        for factor in FACTORS:
            job = partial(remarks, given.folder, factor=factor)
            found = list(pool.map(job, *zip(*sets, strict=True)))
            named = sum("JOINTS_CONTRADICT" in one for one in found)
            gain = sum("TORQUE_GAIN" in one for one in found)
            silent = sum(old and not one for old, one in zip(before, found, strict=True))
            if factor > 1:
                before = [old or bool(one) for old, one in zip(before, found, strict=True)]
            print(
                f"| {factor:g} | {named} | {gain} | {silent if factor > 1 else '–'} |", flush=True
            )


if __name__ == "__main__":
    main()
