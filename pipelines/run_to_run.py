"""Whether intervals hold from run to run: disjoint halves of the runs of a real arm.

    python -m pipelines.run_to_run ../shared/data/dfki --splits 16

Each split gives two estimates that share no run: by `algid identify` without a flag (each half
chooses its own terms and its own estimator), and by the weak estimator with given terms. z is
their difference over its standard deviation; asked of what no flag gives: an RMS between 0.7 and
1.2, and 92 to 99 % of the differences inside what both 95 % intervals allow. Repeatability is the
scatter of k1 … k5 between halves over their size, the mean of the five; asked is that of an
output-error fit on the same splits (`pipelines.output_error`), without and with a gain of joint 2,
which algid leaves open.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES
from algid.estimators import weak
from algid.estimators.weak import Source, WeakSettings
from algid.identification.identify import identify
from algid.identification.source import open_sources
from algid.identification.survey import Survey
from algid.log import Log, Origin
from algid.model import Model
from algid.profile import Profile
from algid.results import Estimate
from algid.signals.segments import Segment
from pipelines import output_error
from pipelines.accuracy_dfki import run

NO_FLAG = "no flag"
OUTPUT_ERROR = "output error"
WITH_GAIN = "output error, gain"
MODELS = (NO_FLAG, "viscous", "coulomb + rotor", OUTPUT_ERROR, WITH_GAIN)
ARMS = ("C1_sysid", "A0_sysid")
Row = dict[str, Any]


@dataclass(frozen=True)
class _Half:
    """By name estimate, standard deviation and half width of the interval; the estimator.

    The terms.
    """

    found: dict[str, tuple[float, float, float]]
    estimator: str
    terms: tuple[str, ...]


@cache
def _runs(folder: Path) -> tuple[Segment, ...]:
    """The longest stretch of each run, angles in algid's convention."""
    files = sorted(folder.glob("*.csv"))
    if folder.name == "C1_sysid":
        return tuple(run(path) for path in files)
    survey = Survey(open_sources(files, "unloaded", Profile(zero="hanging"), 9.81))
    return tuple(max(survey.segments(log), key=len) for log in survey.logs)


def _source(log: Segment) -> Source:
    def once() -> Iterable[Segment]:
        return [log]

    return once


def _estimated(job: tuple[Path, tuple[int, ...], str]) -> _Half:
    folder, places, model = job
    logs = [_runs(folder)[place] for place in places]
    if model in (OUTPUT_ERROR, WITH_GAIN):
        start = weak.fit(
            [_source(log) for log in logs], settings=WeakSettings(Model(("coulomb", "rotor")))
        )
        p = output_error.fit(logs, start.values[:7], gain=model == WITH_GAIN).tolist()
        found = zip(output_error.NAMES, p[: len(output_error.NAMES)], strict=True)
        return _Half({name: (value, np.nan, np.nan) for name, value in found}, model, ())
    return _identified(logs) if model == NO_FLAG else _weak(logs, model)


def _identified(logs: Sequence[Segment]) -> _Half:
    as_logs = [
        Log(
            np.round(np.arange(len(log)) * log.dt * 1e9).astype(np.int64),
            log.theta,
            log.tau,
            Origin(str(n), "csv", {}),
        )
        for n, log in enumerate(logs)
    ]
    result = identify(as_logs, report=False)
    terms = tuple(result.fit.model.terms) if result.fit and result.fit.model else ()
    return _Half(
        {name: one for name, e in result.parameters.items() if (one := _numbers(e))},
        result.estimator,
        terms,
    )


def _numbers(found: Estimate) -> tuple[float, float, float] | None:
    low, high = found.ci95 or (None, None)
    if found.estimate is None or found.std is None or low is None or high is None:
        return None
    return found.estimate, found.std, 0.5 * (high - low)


def _weak(logs: Sequence[Segment], model: str) -> _Half:
    terms = () if model == "viscous" else tuple(model.split(" + "))
    fit = weak.fit([_source(log) for log in logs], settings=WeakSettings(Model(terms)))
    found = zip(fit.names, fit.values.tolist(), fit.std.tolist(), strict=True)
    return _Half(
        {name: (value, std, fit.quantile * std) for name, value, std in found if np.isfinite(std)},
        "weak",
        terms,
    )


def evaluate(folder: Path, splits: int, model: str = NO_FLAG, seed: int = 0) -> list[Row]:
    """Repeatability of k1 … k5, RMS of z and share inside of k1 … k7, over splits drawn by `seed`.

    The coefficients of friction mean what the width makes of them, which each half finds by itself.
    """
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(len(_runs(folder))) for _ in range(splits)]
    halves = [tuple(part.tolist()) for order in orders for part in np.array_split(order, 2)]
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(_estimated, [(folder, half, model) for half in halves]))
    z, inside = [], []
    for one, other in zip(found[::2], found[1::2], strict=True):
        for name in one.found.keys() & other.found.keys() & set(CONSTANT_NAMES):
            (a, std_a, half_a), (b, std_b, half_b) = one.found[name], other.found[name]
            z.append((a - b) / np.hypot(std_a, std_b))
            inside.append(abs(a - b) <= np.hypot(half_a, half_b))
    asked = model == NO_FLAG
    rows: list[Row] = [{"what": "repeatability, %", "value": _repeatability(found), "asked": None}]
    if model in (OUTPUT_ERROR, WITH_GAIN):
        return rows
    return [
        *rows,
        {
            "what": "RMS of z (0.7 to 1.2)",
            "value": float(np.sqrt(np.mean(np.square(z)))),
            "asked": 1.2 if asked else None,
        },
        {
            "what": "inside the 95 % intervals, % (92 to 99)",
            "value": float(100 * np.mean(inside)),
            "asked": 92.0 if asked else None,
        },
        {
            "what": "estimators and terms of the halves",
            "value": dict(
                Counter(chain.from_iterable((half.estimator, *half.terms) for half in found))
            ),
            "asked": None,
        },
    ]


def _repeatability(found: Sequence[_Half]) -> float:
    """Scatter of k1 … k5 between halves over their size, in %: the root of the mean square, the
    mean of the five.
    """
    scatter = []
    for name in ("k1", "k2", "k3", "k4", "k5"):
        pairs = [
            (one.found[name][0], other.found[name][0])
            for one, other in zip(found[::2], found[1::2], strict=True)
            if name in one.found and name in other.found
        ]
        scatter.append(np.sqrt(np.mean([2 * ((a - b) / (a + b)) ** 2 for a, b in pairs])))
    return float(100 * np.mean(scatter))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--splits", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0, help="of the splits that are drawn")
    parser.add_argument("--arm", action="append", choices=ARMS, help="only this arm, or these")
    parser.add_argument(
        "--model", action="append", choices=MODELS, help="only this model, or these"
    )
    given = parser.parse_args()
    for arm in given.arm or ARMS:
        for model in given.model or MODELS:
            for row in evaluate(given.folder / arm, given.splits, model, given.seed):
                value = row["value"]
                shown = value if isinstance(value, dict) else format(value, ".3g")
                print(f"{arm}, {model}: {row['what']}: {shown}", flush=True)


if __name__ == "__main__":
    main()
