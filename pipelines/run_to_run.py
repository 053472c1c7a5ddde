"""Whether intervals hold from run to run: all splits of a real arm's runs into halves.

The ten runs of C.1 and the nine of A.0 can be split into halves in 126 ways each. Both halves of a
split are estimated by themselves, with no flag: each chooses its own terms. z is the difference
of two estimates of k1 … k7 over its standard deviation; "inside" are differences within what both
95 % intervals allow. Repeatability is the scatter of k1 … k5 between halves over their size, the
mean of the five; "held out" the RMSE of the torque of the other half's runs, motion below 20 Hz and
residual below 5 Hz.

Splits share runs, so that their figures are not independent. What stands behind ± is the
jackknife's standard error: every figure is taken anew without one run, over all splits of the
others. With `--splits` all contenders of `pipelines.race_peers` take part with so many random
splits, and ± is the scatter from one split to another.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from algid.arm import FloatArray
from algid.log import Log
from pipelines.race_peers import PEERS, SIMULATED_ALONE, Answer, even
from pipelines.race_regressions import NAMES, columns, smoothed

DATA = Path("../shared/data")
BUILDS = {"C.1": "C1_sysid", "A.0": "A0_sysid"}
L1 = 0.2  # m, of both builds
FIGURES = (
    "inside, %",
    "RMS of z",
    "repeatability, %",
    "held out, joint 1, N m",
    "held out, joint 2, N m",
)

Half = tuple[int, ...]
Split = tuple[Half, Half]


@dataclass(frozen=True, eq=False)
class Fit:
    """A contender's answer on a half, None where it fell; the mean square of what it misses of each
    other run's torque (2,), and the processor time in s.
    """

    answer: Answer | None
    missed: Mapping[int, FloatArray]
    seconds: float


@cache
def runs(folder: Path, build: str) -> tuple[Log, ...]:
    """The runs of a build, θ1 from the horizontal: these logs measure it from hanging."""
    import algid

    logs = map(algid.read_log, sorted((folder / "dfki" / BUILDS[build]).glob("*.csv")))
    return tuple(replace(log, theta=log.theta - [[np.pi / 2], [0.0]]) for log in logs)


def splits(places: Sequence[int]) -> Iterator[Split]:
    """Every split of runs into halves; of an odd number the second has one more."""
    for one in combinations(places, len(places) // 2):
        other = tuple(place for place in places if place not in one)
        if len(one) < len(other) or one < other:
            yield one, other


def held_out(answer: Answer, log: Log) -> FloatArray:
    """Mean square (2,) of what an answer misses of a log's torque below 5 Hz."""
    segment = even(log)
    motion = smoothed(segment, 20.0)
    known = dict(zip(NAMES, np.nan_to_num(answer.values), strict=False)) | answer.terms
    p = np.array([known.get(name, 0.0) for name in NAMES])
    missed = segment.tau - np.einsum("ijn,j->in", columns(motion, answer.width), p)
    below = butter(3, 5.0, fs=1 / segment.dt, output="sos")
    edge = round(0.3 / segment.dt)
    return np.asarray(np.mean(sosfiltfilt(below, missed, axis=1)[:, edge:-edge] ** 2, axis=1))


def fitted(job: tuple[Path, str, str, Half]) -> Fit:
    """One contender on some runs of a build."""
    folder, build, peer, half = job
    every = runs(folder, build)
    begin = time.process_time()
    try:
        answer = PEERS[peer][0]([every[place] for place in half], L1)
    except Exception:  # a contender that falls is a result
        return Fit(None, {}, time.process_time() - begin)
    seconds = time.process_time() - begin
    others = [place for place in range(len(every)) if place not in half]
    return Fit(answer, {place: held_out(answer, every[place]) for place in others}, seconds)


def figures(taken: Sequence[Split], found: Mapping[Half, Fit]) -> FloatArray:
    """`FIGURES` (5,) over splits; NaN where a contender has no such figure."""
    differences, squares, missed = [], [], []
    for one, other in taken:
        a, b = found[one].answer, found[other].answer
        if a is None or b is None:
            continue
        apart = a.values - b.values
        squares.append(2 * (apart / (a.values + b.values))[:5] ** 2)
        missed += [found[one].missed[run] for run in other]
        missed += [found[other].missed[run] for run in one]
        if a.interval is None or b.interval is None or a.std is None or b.std is None:
            continue
        allowed = 0.5 * np.hypot(np.ptp(a.interval, axis=1), np.ptp(b.interval, axis=1))
        differences.append(np.stack([np.abs(apart) / allowed, apart / np.hypot(a.std, b.std)]))
    inside = z = np.nan
    if differences:
        share, ratio = np.concatenate(differences, axis=1)
        inside = 100 * np.mean(share[np.isfinite(share)] <= 1)
        z = np.sqrt(np.nanmean(ratio**2))
    if not squares:
        return np.full(len(FIGURES), np.nan)
    scatter = 100 * np.mean(np.sqrt(np.nanmean(squares, axis=0)))
    return np.array([inside, z, scatter, *np.sqrt(np.mean(missed, axis=0))])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--splits", type=int, help="so many at random, of every contender")
    given = parser.parse_args()
    print("| build | contender | splits | " + " | ".join(FIGURES) + " | processor s | fell |")
    print("|" + (5 + len(FIGURES)) * "---|", flush=True)
    peers = [peer for peer in PEERS if peer not in SIMULATED_ALONE] if given.splits else ["algid"]
    # polars, which reads the runs here, waits for ever in a process that is forked
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for build, peer in product(BUILDS, peers):
            every = range(len(runs(given.data, build)))
            whole = list(splits(every))
            if given.splits:
                order = np.random.default_rng(0).permutation(len(whole))
                whole = [whole[place] for place in order[: given.splits]]
                parts = [[split] for split in whole]
            else:
                parts = [list(splits([run for run in every if run != left])) for left in every]
            halves = sorted({half for part in (whole, *parts) for split in part for half in split})
            jobs = [(given.data, build, peer, half) for half in halves]
            found = dict(zip(halves, pool.map(fitted, jobs, chunksize=4), strict=True))
            again = np.stack([figures(part, found) for part in parts])
            # of splits that share no run their scatter, else the jackknife's standard error
            spread = np.std(again, axis=0, ddof=min(1, len(parts) - 1))
            if not given.splits:
                spread = (len(parts) - 1) / np.sqrt(len(parts)) * spread
            cells = [
                f"{value:.3g} ± {error:.2g}" if np.isfinite(value) else "–"
                for value, error in zip(figures(whole, found), spread, strict=True)
            ]
            seconds = np.mean([one.seconds for one in found.values()])
            cells += [f"{seconds:.2g}", str(sum(one.answer is None for one in found.values()))]
            print(f"| {build} | {peer} | {len(whole)} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
