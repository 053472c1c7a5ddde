"""Whether intervals hold from run to run: disjoint halves of the runs of a real arm.

    python -m pipelines.run_to_run ../shared/data/dfki --splits 50

Each split gives two estimates that share no run. z is their difference over its standard deviation; asked: its RMS
between 0.7 and 1.3, and 90 to 99 % of the differences inside what both 95 % intervals allow.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from algid.estimators import weak
from algid.estimators.weak import Source, WeakSettings
from algid.model import Model
from algid.signals.segments import Segment
from pipelines.accuracy_dfki import run


def _source(log: Segment) -> Source:
    def once() -> Iterable[Segment]:
        return [log]

    return once


def evaluate(folder: Path, splits: int, terms: tuple[str, ...] = ("coulomb", "rotor")) -> list[dict[str, Any]]:
    """RMS of z and share inside, of k1 … k7 and of the terms' coefficients together."""
    sources = [_source(run(path)) for path in sorted((folder / "C1_sysid").glob("*.csv"))]
    rng = np.random.default_rng(0)
    z, inside = [], []
    for _ in range(splits):
        order = rng.permutation(len(sources))
        halves = [[sources[place] for place in part] for part in np.array_split(order, 2)]
        one, other = (weak.fit(half, settings=WeakSettings(Model(terms))) for half in halves)
        both = np.isfinite(one.std) & np.isfinite(other.std)
        difference = (one.values - other.values)[both]
        z.append(difference / np.hypot(one.std, other.std)[both])
        inside.append(np.abs(difference) <= np.hypot(one.quantile * one.std, other.quantile * other.std)[both])
    return [
        {
            "what": "halves of the runs: RMS of z (0.7 to 1.3)",
            "value": float(np.sqrt(np.mean(np.square(np.concatenate(z))))),
            "asked": 1.3,
        },
        {
            "what": "inside the 95 % intervals, % (90 to 99)",
            "value": float(100 * np.mean(np.concatenate(inside))),
            "asked": 90.0,
        },
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--splits", type=int, default=50)
    given = parser.parse_args()
    for terms in ((), ("coulomb", "rotor")):
        for row in evaluate(given.folder, given.splits, terms):
            print(f"{' + '.join(terms) or 'viscous'}: {row['what']}: {row['value']:.3g}")


if __name__ == "__main__":
    main()
