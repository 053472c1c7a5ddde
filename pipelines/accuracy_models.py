"""Errors that real arms have, and what `--model auto` makes of them: the model errors of `make
accuracy`.

    python -m pipelines.accuracy_models --arms 4 --draws 4

Each row of `real_arms.ROWS` is simulated on hidden arms, ten seconds unloaded and ten loaded, and
identified once with no flag and once with all the old flags. Coverage counts the 95 % intervals of
k1 … k7 and m_p that hold the truth.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES
from algid.estimators import refined, robust
from algid.estimators.problem import Problem, WeakSettings
from algid.estimators.terms import Selection, select
from algid.model import Model
from pipelines import real_arms

MODES = ("no flag", "all old flags")
ASKED = 88.0  # % of the intervals
FIRST_ARM = 11
Row = dict[str, Any]

_scenes: dict[tuple[str, int, bool], real_arms.Scene] = {}


def install(made: dict[tuple[str, int, bool], real_arms.Scene]) -> None:
    """Hand the motions to a process, so that each is integrated once."""
    _scenes.update(made)


def draw(job: tuple[str, int, int, str]) -> Row:
    """One pair of logs of a row, identified in one mode: errors in σ and in percent, and which
    intervals hold.
    """
    row, arm, seed, mode = job
    rng = np.random.default_rng([seed, arm, sum(row.encode())])
    unloaded, loaded = (_scenes[row, arm, kind].log(rng) for kind in (False, True))
    logs = [lambda: [unloaded]], [lambda: [loaded]]
    weak = WeakSettings(bandwidth=60.0)
    flags = Selection(Model(("coulomb", "offset", "rotor")), delay=True)
    chosen = select(Problem(*logs, weak)) if mode == MODES[0] else flags
    weak = replace(weak, model=chosen.model, estimate_delay=chosen.delay)
    fit = refined.fit(Problem(*logs, weak))
    if fit.refuted and mode == MODES[0]:
        fit = robust.fit(
            Problem(*logs, replace(weak, model=chosen.shapes or chosen.model, estimate_delay=False))
        )
    truth = _scenes[row, arm, False].truth
    names = [*CONSTANT_NAMES, "m_p"]
    places = [fit.names.index(name) for name in names]
    wanted = np.array([truth[name] for name in names])
    z = (fit.values[places] - wanted) / fit.std[places]
    return {
        "row": row,
        "mode": mode,
        "estimator": fit.estimator,
        "terms": [*chosen.model.terms, *(["delay"] if chosen.delay else [])],
        "inside": (np.abs(z) <= fit.quantile).tolist(),
        "z": np.abs(z).tolist(),
        "percent": (100 * np.abs(fit.values[places] / wanted - 1)).tolist(),
    }


def summarised(found: Iterable[Row]) -> list[Row]:
    """A line a row and mode: estimators, coverage, errors, and how often each term was chosen."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for one in found:
        groups.setdefault((one["row"], one["mode"]), []).append(one)
    lines = []
    for (row, mode), drawn in groups.items():
        percent = np.array([one["percent"] for one in drawn])
        lines.append(
            {
                "row": row,
                "mode": mode,
                "estimators": dict(Counter(one["estimator"] for one in drawn)),
                "coverage": 100 * float(np.mean([one["inside"] for one in drawn])),
                "z95": float(np.percentile([one["z"] for one in drawn], 95)),
                "k_percent": float(np.median(percent[:, :-1])),
                "m_p_percent": float(np.median(percent[:, -1])),
                "terms": dict(Counter(term for one in drawn for term in one["terms"])),
            }
        )
    return lines


def markdown(lines: Sequence[Row]) -> str:
    """The table, no flag beside all flags."""
    text = [
        f"## Model errors: coverage asked {ASKED:g} %, errors at most those of all old flags",
        "",
        (
            "| error of arm or sensors | mode | estimators | coverage % | 95th pct of abs z | k: "
            "median % | m_p | terms |"
        ),
        "|" + "---|" * 8,
    ]
    for line in lines:
        estimators, terms = (
            ", ".join(f"{name} {count}" for name, count in line[key].items())
            for key in ("estimators", "terms")
        )
        text.append(
            f"| {line['row']} | {line['mode']} | {estimators} | {line['coverage']:.0f} | "
            f"{line['z95']:.1f} "
            f"| {line['k_percent']:.3g} | {line['m_p_percent']:.3g} | {terms} |"
        )
    return "\n".join(text) + "\n"


def evaluate(rows: Sequence[str], arms: int, draws: int) -> list[Row]:
    """The lines of `rows`."""
    seeds = list(range(FIRST_ARM, FIRST_ARM + arms))
    made = real_arms.scenes(list(rows), seeds)
    jobs = [
        (row, arm, seed, mode)
        for row in rows
        for mode in MODES
        for arm in seeds
        for seed in range(draws)
    ]
    with ProcessPoolExecutor(2, initializer=install, initargs=(made,)) as pool:
        return summarised(pool.map(draw, jobs, chunksize=2))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/accuracy"))
    parser.add_argument("--arms", type=int, default=4)
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument(
        "--row", action="append", choices=list(real_arms.ROWS), help="only this row, or these"
    )
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    lines = evaluate(given.row or list(real_arms.ROWS), given.arms, given.draws)
    (given.output / "models.json").write_text(json.dumps(lines, indent=1))
    (given.output / "models.md").write_text(text := markdown(lines))
    print(text)


if __name__ == "__main__":
    main()
