"""Write tables of fleets to look at: few and many robots, a drift, an arm that was replaced, one
robot in 15 folders.

Usage: python -m pipelines.fleet_scenes FOLDER, then algid fleet FOLDER/NAME for each of its folders
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.synth.cases import load_case

START = datetime(2026, 1, 5, 9, tzinfo=UTC)
SPREAD = 0.01  # between robots of one kind, as a share
STD = 0.003  # of an estimate, as a share


def table(robots: int, days: FloatArray, seed: int = 0) -> pl.DataFrame:
    """A log of each robot on each of `days`: its estimates of k1 to k7 and friction, with their
    deviations.
    """
    rng = np.random.default_rng(seed)
    constants = dict(zip(CONSTANT_NAMES, load_case("case1").arm.constants().tolist(), strict=True))
    constants |= {"f1": 0.25, "f2": 0.15}
    robot = np.repeat(np.arange(robots), days.size)
    day = np.tile(days, robots)
    columns: dict[str, object] = {
        "job": [f"r{n + 1:02}/log-{place % days.size + 1:03}" for place, n in enumerate(robot)],
        "robot": [f"r{n + 1:02}" for n in robot],
        "time": [START + timedelta(days=float(d)) for d in day],
        "status": ["ok"] * robot.size,
        "verdict": ["good"] * robot.size,
    }
    for name, value in constants.items():
        own = value * (1 + SPREAD * rng.standard_normal(robots))[robot]
        std = abs(value) * STD
        columns[name] = own + std * rng.standard_normal(robot.size)
        columns[f"{name}_std"] = np.full(robot.size, std)
    return pl.DataFrame(columns)


def changed(frame: pl.DataFrame, robot: str, factor: pl.Expr, *names: str) -> pl.DataFrame:
    """The table with parameters of a robot times `factor`."""
    own = pl.col("robot") == robot
    return frame.with_columns(
        pl.when(own).then(pl.col(name) * factor).otherwise(pl.col(name)).alias(name)
        for name in names
    )


def scenes() -> dict[str, pl.DataFrame]:
    """The fleets by name."""
    months = (pl.col("time") - pl.lit(START)).dt.total_seconds() / (86400 * 30.4375)
    few = table(3, np.linspace(0, 27, 10))
    many = table(40, np.arange(0, 730, 7.0), seed=1)
    drifting = changed(many, "r07", 1 + 0.004 * months, "k6", "f1")
    replaced = changed(
        drifting,
        "r12",
        pl.when(months < 13).then(1.0).otherwise(1.06),
        *("k1", "k2", "k3", "k4", "k5"),
    )
    one = table(1, np.arange(15.0), seed=2).with_columns(
        robot=pl.concat_str(pl.lit("2026-01-"), (pl.int_range(15) + 5).cast(pl.String).str.zfill(2))
    )
    outlying = changed(
        few, "r02", pl.when(pl.col("job") == "r02/log-006").then(1.1).otherwise(1.0), "k7"
    )
    return {
        "few": few,
        "outlying": outlying,
        "steady": many,
        "drifting": drifting,
        "replaced": replaced,
        "folders": one,
    }


def main(folder: Path) -> None:
    """Write each scene's jobs.parquet."""
    for name, frame in scenes().items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        frame.write_parquet(folder / name / "jobs.parquet")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
