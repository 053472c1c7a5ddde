"""Sets of runs of real arms against the fit of all others: whether any is Failed, or sure and
wrong.

    python -m pipelines.real_sets ../shared/data --most 30

Singles, pairs and triples of each arm's runs are identified with no flag but the zero, and compared
with the estimate of all runs outside of the set. Asked: none Failed, since the conventions are
right; and in at most 2 % of the cases an estimate of k1 … k5 that exits with 0 and is further than
3 σ (of the difference) from the others'. Of pairs and triples `--most` are drawn at random.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np

from algid.exits import exit_of
from algid.identification.identify import identify
from algid.profile import Profile
from algid.results import Result

ARMS = {
    "dfki/A0_sysid": Profile(zero="hanging"),
    "dfki/C1_sysid": Profile(zero="hanging"),
    "kinova_gen3": None,
}
NAMES = ("k1", "k2", "k3", "k4", "k5")
FAR = 3.0


@dataclass(frozen=True)
class Case:
    """A set of runs: its verdict's grade and headline, exit code, and the largest distance of k1 …
    k5 in σ.
    """

    runs: tuple[int, ...]
    grade: str
    headline: str
    exit_code: int
    distance: float


@cache
def _found(folder: Path, arm: str, runs: tuple[int, ...]) -> Result:
    files = sorted((folder / arm).glob("*.csv"))
    return identify([files[run] for run in runs], profile=ARMS[arm], report=False)


def sets(count: int, size: int, most: int) -> list[tuple[int, ...]]:
    """Sets of `size` of `count` runs, at most `most` of them, drawn at random."""
    every = list(combinations(range(count), size))
    if len(every) <= most:
        return every
    drawn = np.random.default_rng(size).choice(len(every), most, replace=False)
    return [every[place] for place in sorted(drawn.tolist())]


def cases(folder: Path, arm: str, size: int, most: int) -> Iterator[Case]:
    """Each set of `size` runs beside all other runs."""
    count = len(list((folder / arm).glob("*.csv")))
    for runs in sets(count, size, most):
        result = _found(folder, arm, runs)
        others = tuple(run for run in range(count) if run not in runs)
        distance = _distance(result, _found(folder, arm, others)) if others else 0.0
        verdict = result.verdict
        ended = exit_of(failed=verdict.failed or not result.complete, lost=result.data_lost)
        yield Case(runs, verdict.grade, verdict.headline, int(ended), distance)


def _distance(result: Result, others: Result) -> float:
    """The largest distance in standard deviations of the difference, of estimates that may be
    used.
    """
    far: list[float] = [0.0]
    for name in NAMES:
        one, other = result.parameters.get(name), others.parameters.get(name)
        if one is None or other is None or not (one.usable and other.usable):
            continue
        if one.estimate is None or other.estimate is None:
            continue
        far.append(abs(one.estimate - other.estimate) / np.hypot(one.std or 0.0, other.std or 0.0))
    return float(max(far))


def lines(found: Sequence[Case]) -> Iterator[str]:
    """What the cases tell, a line each."""
    wrong = [case for case in found if case.exit_code == 0 and case.distance > FAR]
    yield f"grades {dict(Counter(case.grade for case in found))}"
    yield f"exits {dict(Counter(case.exit_code for case in found))}"
    yield f"exit 0 and beyond {FAR:g} σ: {100 * len(wrong) / len(found):.3g} % (at most 2)"
    for case in found:
        if case.grade == "failed" or case in wrong:
            yield f"  runs {case.runs}: {case.headline}; {case.distance:.2g} σ"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--most", type=int, default=30)
    parser.add_argument("--arm", action="append", choices=tuple(ARMS))
    given = parser.parse_args()
    for arm in given.arm or ARMS:
        for size in (1, 2, 3):
            found = list(cases(given.folder, arm, size, given.most))
            for line in lines(found) if found else ():
                print(f"{arm}, sets of {size}: {line}", flush=True)


if __name__ == "__main__":
    main()
