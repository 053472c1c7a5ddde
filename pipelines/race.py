"""The open race: the same logs for every contender, errors, intervals and time in one table.

    python -m pipelines.race -o build/race

Simulated: five kinds of arms (`pipelines.race_scenes`), one log of 10 s at 500 Hz each, another to
predict. Real, where `--data` is: runs of two builds of a torque-controlled arm, split into halves
at random (`pipelines.run_to_run`, which takes all splits).

===================  =============================================================================
column               meaning
===================  =============================================================================
error over bound     of k1 … k7 over their Cramér-Rao bound, RMS and median; straight arms, encoders
intervals that hold  share of 95 % intervals of k1 … k7 that hold the truth
error, %             median over parameters and arms of the error's magnitude
held out             RMSE of the torque of an unused log, motion below 20 Hz, residual below 5 Hz
processor            seconds a fit, without imports
choices              number of choices that a user makes beforehand
===================  =============================================================================

± is the standard error over arms, by the bootstrap; of real runs the standard deviation from one
split to another.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.race_examples import example_table, reproduced
from pipelines.race_peers import PEERS, SIMULATED_ALONE
from pipelines.race_scenes import BOUNDED, KINDS, Scene, scenes
from pipelines.run_to_run import BUILDS, DATA, FIGURES, figures, fitted, held_out, runs, splits

PACKAGES = ("algid", "mujoco", "pin", "pysindy", "numpy", "scipy")
_RESAMPLED = 400

Row = dict[str, Any]


def bound_of(scene: Scene) -> Any:
    """The bound (7,) of a scene, None where it is not known."""
    return scene.bound() if scene.kind in BOUNDED else None


def simulated_row(job: tuple[Scene, Any, str]) -> Row:
    """One contender on one simulated arm: errors, intervals and prediction, None where it has
    none.
    """
    scene, bound, peer = job
    row: Row = {"peer": peer, "kind": scene.kind, "seed": scene.seed, "failed": ""}
    begin = time.process_time()
    try:
        answer = PEERS[peer][0]([scene.log], scene.l1)
    except Exception as error:  # a contender that falls is a result
        return row | {"failed": f"{type(error).__name__}: {error}"[:200]}
    row["seconds"] = time.process_time() - begin
    miss = np.abs(answer.values - scene.truth)
    row["error"] = (100 * miss / np.abs(scene.truth)).tolist()
    if bound is not None:
        row["over bound"] = (miss / bound).tolist()
    if answer.interval is not None:
        low, high = answer.interval.T
        given = np.isfinite(low) & np.isfinite(high)
        row["inside"] = ((low <= scene.truth) & (scene.truth <= high))[given].tolist()
    row["held out"] = float(np.sqrt(np.mean(held_out(answer, scene.ahead))))
    return row


def real_row(pool: ProcessPoolExecutor, folder: Path, build: str, peer: str, count: int) -> Row:
    """Figures of so many random splits of a build's runs, and their scatter from split to split."""
    every = list(splits(range(len(runs(folder, build)))))
    order = np.random.default_rng(0).permutation(len(every))
    taken = [every[place] for place in order[:count]]
    halves = [half for split in taken for half in split]
    fits = list(pool.map(fitted, [(folder, build, peer, half) for half in halves]))
    found = dict(zip(halves, fits, strict=True))
    single = np.array([figures([split], found) for split in taken])
    return {
        "peer": peer,
        "build": build,
        "splits": len(taken),
        "fell": sum(fit.answer is None for fit in fits),
        "figures": figures(taken, found).tolist(),
        "scatter": (np.std(single, axis=0, ddof=1) if len(taken) > 1 else single[0]).tolist(),
        "seconds": float(np.mean([fit.seconds for fit in fits])),
    }


def _with_error(
    logs: Sequence[Sequence[float]], statistic: Callable[[Any], Any], factor: float = 1.0
) -> str:
    """A statistic of the numbers of all logs, ± its standard error over logs; a dash without."""
    kept = [np.asarray(log)[np.isfinite(log)] for log in logs]
    if not sum(map(len, kept)):
        return "–"
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(kept), size=(_RESAMPLED, len(kept)))
    again = [statistic(np.concatenate([kept[place] for place in row])) for row in drawn]
    value = factor * statistic(np.concatenate(kept))
    return f"{value:.3g} ± {factor * np.nanstd(again):.2g}"


def _rms(values: Any) -> Any:
    return np.sqrt(np.mean(np.square(values)))


def simulated_tables(rows: Sequence[Row]) -> str:
    """Markdown: a line a contender, over all arms and by kinds."""
    head = ("contender", "error over bound, RMS", "median", "intervals that hold, %")
    pooled: list[tuple[str, ...]] = [(*head, "held out, N m", "processor s", "choices", "failed")]
    kinds: list[tuple[str, ...]] = [("contender", *(f"error %, {kind}" for kind in KINDS))]
    holds: list[tuple[str, ...]] = [("contender", *(f"hold, %, {kind}" for kind in KINDS))]
    for peer, (_, choices) in PEERS.items():
        own = [row for row in rows if row["peer"] == peer]
        good = [row for row in own if not row["failed"]]
        if not good:
            continue

        def of(name: str, kind: str = "", good: Sequence[Row] = good) -> list[Any]:
            return [row[name] for row in good if name in row and kind in ("", row["kind"])]

        seconds = f"{np.mean(of('seconds')):.2g}"
        pooled.append(
            (
                peer,
                _with_error(of("over bound"), _rms),
                _with_error(of("over bound"), np.median),
                _with_error(of("inside"), np.mean, 100),
                _with_error([[one] for one in of("held out")], np.median),
                seconds,
                str(choices),
                f"{len(own) - len(good)} of {len(own)}",
            )
        )
        kinds.append((peer, *(_with_error(of("error", kind), np.median) for kind in KINDS)))
        holds.append((peer, *(_with_error(of("inside", kind), np.mean, 100) for kind in KINDS)))
    return "\n\n".join(_markdown(table) for table in (pooled, kinds, holds))


def real_table(rows: Sequence[Row]) -> str:
    """Markdown: a line a contender and build."""
    lines: list[tuple[str, ...]] = [
        ("build", "contender", "splits", *FIGURES, "processor s", "fell")
    ]
    for row in rows:
        cells = [
            f"{value:.3g} ± {scatter:.2g}" if np.isfinite(value) else "–"
            for value, scatter in zip(row["figures"], row["scatter"], strict=True)
        ]
        more = f"{row['seconds']:.2g}", str(row["fell"])
        lines.append((row["build"], row["peer"], str(row["splits"]), *cells, *more))
    return _markdown(lines)


def _markdown(lines: Sequence[Sequence[str]]) -> str:
    rows = [f"| {' | '.join(line)} |" for line in lines]
    return "\n".join([rows[0], "|" + len(lines[0]) * "---|", *rows[1:]])


def main() -> None:
    """Run the race and write `race.md` and `race.json`."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/race"))
    parser.add_argument("--seeds", type=int, default=30, help="arms of each kind")
    parser.add_argument("--splits", type=int, default=15, help="of each build's real runs")
    parser.add_argument(
        "--only", help="contenders to run, with ';'; the others' rows stay as they are in OUTPUT"
    )
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    store = given.output / "race.json"
    wanted = given.only.split(";") if given.only else list(PEERS)
    before = json.loads(store.read_text(encoding="utf-8")) if given.only and store.exists() else {}
    arms = scenes(range(1, given.seeds + 1))
    examples = before.get("examples", {}) | reproduced(wanted)
    with ProcessPoolExecutor(2) as pool:
        bounds = list(pool.map(bound_of, arms, chunksize=4))
        jobs = [(*arm, peer) for arm in zip(arms, bounds, strict=True) for peer in wanted]
        simulated = list(pool.map(simulated_row, jobs, chunksize=4))
        real = [
            real_row(pool, given.data, build, peer, given.splits)
            for build in BUILDS
            for peer in wanted
            if (given.data / "dfki").is_dir() and peer not in SIMULATED_ALONE
        ]
    simulated += [row for row in before.get("simulated", []) if row["peer"] not in wanted]
    real += [row for row in before.get("real", []) if row["peer"] not in wanted]
    real.sort(key=lambda row: (list(BUILDS).index(row["build"]), list(PEERS).index(row["peer"])))
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    text = f"## Examples reproduced\n\n{example_table(examples)}\n\n"
    text += f"## Simulated arms, {given.seeds} of each kind\n\n{simulated_tables(simulated)}\n\n"
    if real:
        text += f"## Real arms\n\n{real_table(real)}\n\n"
    text += f"{versions}.\n"
    (given.output / "race.md").write_text(text, encoding="utf-8")
    content = {"examples": examples, "simulated": simulated, "real": real}
    store.write_text(json.dumps(content, indent=1), encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
