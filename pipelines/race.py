"""The open race: the same logs for every contender, errors, intervals and time in one table.

    python -m pipelines.race -o build/race

Simulated: five kinds of arms (`pipelines.race_scenes`), three seeds of each, one log of 10 s at
500 Hz, another to predict. Real, where `--data` is: the runs of two builds of a torque-controlled
arm, by halves and leave one out.

===================  =============================================================================
column               meaning
===================  =============================================================================
error over bound     RMS of k1 … k7's errors over their Cramér-Rao bound; straight arms, encoders
error, %             median over parameters and arms of the error's magnitude
intervals that hold  share of 95 % intervals that hold the truth, or of halves that agree
repeatability, %     mean over k1 … k5 of the scatter between halves
held out             RMSE of the torque of an unused log, motion below 20 Hz, residual below 5 Hz
processor            seconds a fit, without imports
choices              number of choices that a user makes beforehand
===================  =============================================================================
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import FloatArray, regressor
from algid.signals.segments import Segment
from pipelines.race_examples import example_table, reproduced
from pipelines.race_page import page
from pipelines.race_peers import PEERS, Answer
from pipelines.race_scenes import KINDS, Scene, scene

SEEDS = (1, 2, 3)
SPLITS = 3
REAL = {"C.1": "C1_sysid", "A.0": "A0_sysid"}
L1 = 0.2  # m, of both builds
STANDING = 0.15  # rad/s: both joints slower than this
PACKAGES = ("algid", "mujoco", "pin", "pysindy", "numpy", "scipy")


@dataclass(frozen=True)
class Row:
    """One fit: errors, intervals and prediction of it; None where a contender has none."""

    peer: str
    logs: str
    error_percent: list[float]
    over_bound: list[float] | None
    inside: list[bool] | None
    held_out: list[float]
    held_out_moving: list[float]
    seconds: float
    failed: str = ""


def predicted(answer: Answer, log: Segment) -> tuple[FloatArray, FloatArray]:
    """Residual (2, n) of a log's torque below 5 Hz, and where a joint moves (n,)."""
    from scipy.signal import butter, sosfiltfilt

    motion = butter(3, 20.0, fs=1 / log.dt, output="sos")
    theta = sosfiltfilt(motion, log.theta, axis=1)
    omega = np.gradient(theta, log.dt, axis=1)
    alpha = np.gradient(omega, log.dt, axis=1)
    torque = np.einsum("ijn,j->in", regressor(theta, omega, alpha), np.nan_to_num(answer.values))
    own = answer.terms
    for joint in range(2):
        name = str(joint + 1)
        torque[joint] += own.get(f"f{name}", 0.0) * np.tanh(omega[joint] / answer.width)
        torque[joint] += own.get(f"o{name}", 0.0)
    torque[1] += own.get("j2", 0.0) * alpha[1]
    residual = sosfiltfilt(butter(3, 5.0, fs=1 / log.dt, output="sos"), log.tau - torque, axis=1)
    edge = round(0.3 / log.dt)
    moving = (np.abs(omega) > STANDING).any(axis=0)
    return residual[:, edge:-edge], moving[edge:-edge]


def held_out(answer: Answer, log: Segment) -> tuple[list[float], list[float]]:
    """RMSE of both joints over a log, and over its moving samples."""
    residual, moving = predicted(answer, log)
    rms = np.sqrt(np.mean(residual**2, axis=1))
    return rms.tolist(), np.sqrt(np.mean(residual[:, moving] ** 2, axis=1)).tolist()


@cache
def _scene(kind: str, seed: int) -> Scene:
    return scene(kind, seed)


def _answered(peer: str, logs: Sequence[Segment], l1: float) -> tuple[Answer, float]:
    begin = time.process_time()
    answer = PEERS[peer][0](logs, l1)
    return answer, time.process_time() - begin


def simulated_row(job: tuple[str, int, str]) -> Row:
    """One contender on one simulated arm."""
    kind, seed, peer = job
    here = _scene(kind, seed)
    try:
        answer, seconds = _answered(peer, [here.log], here.l1)
    except Exception as error:  # a contender that falls is a result
        return Row(
            peer, kind, [], None, None, [], [], 0.0, f"{type(error).__name__}: {error}"[:200]
        )
    miss = answer.values - here.truth
    inside = None
    if answer.interval is not None:
        low, high = answer.interval.T
        given = np.isfinite(low) & np.isfinite(high)
        inside = ((low <= here.truth) & (here.truth <= high))[given].tolist()
    bound = None if here.bound is None else (np.abs(miss) / here.bound).tolist()
    every, moving = held_out(answer, here.ahead)
    return Row(
        peer,
        kind,
        (100 * np.abs(miss / here.truth)).tolist(),
        bound,
        inside,
        every,
        moving,
        seconds,
    )


@cache
def _runs(folder: Path, build: str) -> tuple[Segment, ...]:
    import algid

    found = []
    for path in sorted((folder / "dfki" / REAL[build]).glob("*.csv")):
        log = algid.read_log(path)
        t = log.stamp_ns * 1e-9
        even = np.arange(t[0], t[-1], 0.002)
        theta, tau = (
            np.stack([np.interp(even, t, row) for row in rows]) for rows in (log.theta, log.tau)
        )
        theta[0] -= np.pi / 2  # these logs measure θ1 from hanging
        found.append(Segment(0.0, 0.002, theta, tau))
    return tuple(found)


def real_half(job: tuple[Path, str, tuple[int, ...], str]) -> tuple[Answer | str, float]:
    """One contender on some runs of a build; where it falls, why."""
    folder, build, places, peer = job
    try:
        return _answered(peer, [_runs(folder, build)[place] for place in places], L1)
    except Exception as error:  # a contender that falls is a result
        return f"{type(error).__name__}: {error}"[:200], 0.0


def real_rows(
    folder: Path, wanted: Sequence[str], pool: ProcessPoolExecutor
) -> list[dict[str, Any]]:
    """Halves that agree, repeatability, and what one half predicts of the other half's runs."""
    rows = []
    for build in REAL:
        runs = _runs(folder, build)
        rng = np.random.default_rng(0)
        orders = [rng.permutation(len(runs)) for _ in range(SPLITS)]
        halves = [tuple(half.tolist()) for order in orders for half in np.array_split(order, 2)]
        for peer in wanted:
            found = list(pool.map(real_half, [(folder, build, half, peer) for half in halves]))
            rows.append({"peer": peer, "build": build, **_halves(found, halves, runs)})
    return rows


def _halves(
    found: list[tuple[Answer | str, float]],
    halves: list[tuple[int, ...]],
    runs: tuple[Segment, ...],
) -> dict[str, Any]:
    agree: list[bool] = []
    scatter, every, moving = [], [], []
    for place in range(0, len(found), 2):
        (one, _), (other, _) = found[place : place + 2]
        if isinstance(one, str) or isinstance(other, str):
            continue
        mean = 0.5 * (one.values + other.values)
        scatter.append(np.abs(one.values - other.values)[:5] / np.sqrt(2) / np.abs(mean)[:5])
        if one.interval is not None and other.interval is not None:
            wide = np.hypot(
                *(0.5 * np.ptp(interval, axis=1) for interval in (one.interval, other.interval))
            )
            apart = np.abs(one.values - other.values)
            agree += (apart <= wide)[np.isfinite(wide)].tolist()
        for answer, ahead in ((one, halves[place + 1]), (other, halves[place])):
            for run in ahead:
                whole, part = held_out(answer, runs[run])
                every.append(whole)
                moving.append(part)
    return {
        "agree": float(np.mean(agree)) if agree else None,
        "repeatability": float(100 * np.mean(scatter)) if scatter else None,
        "held_out": np.sqrt(np.mean(np.square(every), axis=0)).tolist() if every else None,
        "held_out_moving": np.sqrt(np.nanmean(np.square(moving), axis=0)).tolist()
        if moving
        else None,
        "seconds": float(np.mean([seconds for _, seconds in found])),
        "failed": next((answer for answer, _ in found if isinstance(answer, str)), ""),
    }


def simulated_table(rows: Sequence[Row]) -> str:
    """Markdown: a line a contender, pooled over the arms."""
    heading = (
        f"| contender | error over bound (RMS) | error %, {' / '.join(KINDS)} (median) | "
        "intervals that hold, % "
    )
    lines = [f"{heading}| held out, N m | moving alone | processor s | choices |", "|" + 8 * "---|"]
    for peer, (_, choices) in PEERS.items():
        own = [row for row in rows if row.peer == peer]
        good = [row for row in own if not row.failed]
        bounds = np.array([value for row in good if row.over_bound for value in row.over_bound])
        inside = [value for row in good if row.inside is not None for value in row.inside]
        errors = [
            [value for row in good if row.logs == kind for value in row.error_percent]
            for kind in KINDS
        ]
        lines.append(
            f"| {peer} | {_number(np.sqrt(np.nanmean(bounds**2)) if bounds.size else None)} | "
            + " / ".join(_number(np.nanmedian(one) if one else None) for one in errors)
            + f" | {_number(100 * np.mean(inside) if inside else None)}"
            + f"{f' of {len(inside)}' if inside else ''} | "
            + f"{_number(np.nanmedian([row.held_out for row in good]) if good else None)} | "
            + f"{_number(np.nanmedian([row.held_out_moving for row in good]) if good else None)} | "
            + f"{_number(np.mean([row.seconds for row in good]) if good else None)} | {choices} |"
        )
        lines += [
            f"| | failed on {row.logs}: {row.failed} | | | | | | |" for row in own if row.failed
        ]
    return "\n".join(lines)


def real_table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a line a contender and build."""
    heading = (
        "| build | contender | halves that agree, % | repeatability, % | held out, N m, "
        "joint 1 / 2 "
    )
    lines = [f"{heading}| moving alone | processor s |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        pairs = [
            " / ".join(map(_number, row[name] or [None, None]))
            for name in ("held_out", "held_out_moving")
        ]
        agree = None if row["agree"] is None else 100 * row["agree"]
        lines.append(
            f"| {row['build']} | {row['peer']} | {_number(agree)} | "
            f"{_number(row['repeatability'])} "
            f"| {pairs[0]} | {pairs[1]} | {_number(row['seconds'])} |"
        )
        if row.get("failed"):
            lines.append(f"| | failed: {row['failed']} | | | | | |")
    return "\n".join(lines)


def _number(value: Any) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.3g}"


def main() -> None:
    """Run the race and write `race.md` and `race.json`."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("-o", "--output", type=Path, default=Path("build/race"))
    parser.add_argument(
        "--only", help="contenders to run, with commas; the others' rows stay as they are in OUTPUT"
    )
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    store = given.output / "race.json"
    before = json.loads(store.read_text(encoding="utf-8")) if given.only else {}
    wanted = given.only.split(",") if given.only else list(PEERS)
    examples = reproduced(list(PEERS))
    jobs = [(kind, seed, peer) for kind in KINDS for seed in SEEDS for peer in wanted]
    with ProcessPoolExecutor(2) as pool:
        rows = list(pool.map(simulated_row, jobs, chunksize=len(wanted)))
        real = real_rows(given.data, wanted, pool) if (given.data / "dfki").is_dir() else []
    rows += [Row(**row) for row in before.get("simulated", []) if row["peer"] not in wanted]
    real += [row for row in before.get("real", []) if row["peer"] not in wanted]
    real.sort(key=lambda row: (list(REAL).index(row["build"]), list(PEERS).index(row["peer"])))
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    text = f"## Examples reproduced\n\n{example_table(examples)}\n\n"
    text += f"## Simulated arms\n\n{simulated_table(rows)}\n\n"
    if real:
        text += f"## Real arms\n\n{real_table(real)}\n\n"
    text += f"Seeds {SEEDS}; {versions}.\n"
    (given.output / "race.md").write_text(text, encoding="utf-8")
    simulated = [asdict(row) for row in rows]
    content = {
        "examples": examples, "simulated": simulated, "real": real, "versions": versions,
    }  # fmt: skip
    store.write_text(json.dumps(content, indent=1), encoding="utf-8")
    (given.output / "race.html").write_text(page(simulated, real, text), encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
