"""Time `algid fleet` on a table of a million rows, and count drifts found and false alarms on
simulated fleets.

Usage: python -m pipelines.bench_fleet FOLDER
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl

START = datetime(2026, 1, 1, tzinfo=UTC)
NAMES = tuple(f"k{n}" for n in range(1, 8))


def table(robots: int, days: int, growth: float = 0.0, seed: int = 0) -> pl.DataFrame:
    """A log a day of each robot, estimates within 0.5 %; k6 grows by `growth` a month."""
    rng = np.random.default_rng(seed)
    day, robot = np.tile(np.arange(days), robots), np.repeat(np.arange(robots), days)
    times = np.array(
        [START.replace(tzinfo=None) + timedelta(days=d) for d in range(days)],
        dtype="datetime64[us]",
    )
    frame = pl.DataFrame(
        {
            "job": pl.Series(np.arange(robot.size)).cast(pl.String),
            "robot": pl.Series(robot).cast(pl.String),
            "time": pl.Series(times[day]).dt.replace_time_zone("UTC"),
            "status": pl.Series(["ok"]).new_from_index(0, robot.size),
        }
    )
    for name in (*NAMES, "m_p"):
        trend = growth * day / 30.4375 if name == "k6" else 0.0
        noise = pl.Series(1 + trend + 0.005 * rng.standard_normal(robot.size))
        frame = frame.with_columns(noise.alias(name), pl.lit(0.005).alias(f"{name}_std"))
    return frame.with_columns(pl.lit(1.0).alias("label_payload"))


def main(folder: Path) -> None:
    """Print a Markdown table of figures asked for and measured."""
    from algid.fleet.history import history_of

    folder.mkdir(parents=True, exist_ok=True)
    table(2740, 365).write_parquet(folder / "jobs.parquet")
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "algid", "fleet", str(folder)], check=True, stdout=subprocess.DEVNULL
    )
    seconds = time.perf_counter() - start
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    quiet = history_of(folder / "jobs.parquet").windows["drift"].sum()
    table(1000, 91, growth=0.01, seed=1).write_parquet(folder / "jobs.parquet")
    grown = history_of(folder / "jobs.parquet").drifts.filter(pl.col("parameter") == "k6").height
    print("| what | asked | measured |\n|---|---|---|")
    print(f"| algid fleet, 1,000,100 rows | ≤ 10 s, ≤ 1 GB | {seconds:.1f} s, {memory:.2f} GB |")
    print(f"| false alarms a robot-year, 2,740 robot-years | ≤ 1 | {quiet / 2740:.3f} |")
    print(f"| growth of k6, 1 % a month, found within 3 months | all | {grown} of 1000 |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
