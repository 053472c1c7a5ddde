"""Slopes of parameters over time, by weighted regression on windows of each robot's history.

======  ============================================  =========
symbol  name                                          unit
======  ============================================  =========
t       time since the robot's first log              month
y       estimate, less the robot's mean               its own
w       1 / std², what the estimate's interval says   its own
======  ============================================  =========

A window is `SPAN` months long and ends with each month, so that a year holds twelve tests a parameter. The
slope's error is the one that the intervals give, or the larger one that the scatter about the line shows; its t
test alarms below `ALPHA`. With seven parameters that is 12 × 7 × 0.001 = 0.084 false alarms a robot-year where
estimates scatter independently. Sums of a month's moments add up to a window's: the cost is O(N).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.errors import ResultError

if TYPE_CHECKING:
    import polars as pl

MONTH_DAYS = 30.4375
SPAN = 3
ALPHA = 1e-3
FEWEST = 8  # logs in a window that is tested
PARAMETERS = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "f1", "f2", "o1", "o2", "j2")
_SUMS = ("w", "wt", "wtt", "wy", "wty", "wyy", "n")


def read_jobs(path: Path) -> pl.DataFrame:
    """The finished jobs of ``jobs.parquet`` that have a robot and a time; ``t`` is in months, ``month`` whole.

    Raises
    ------
    ResultError
        If the table is missing or not one of algid batch.
    """
    import polars as pl

    try:
        names = list(pl.read_parquet_schema(path))
        wanted = [n for n in names if n in ("job", "robot", "time", "status", "label_payload", "m_p", "m_p_std")]
        wanted += [n for p in PARAMETERS if p in names and f"{p}_std" in names for n in (p, f"{p}_std")]
        jobs = pl.read_parquet(path, columns=wanted)
    except (OSError, pl.exceptions.PolarsError) as error:
        told = str(error).split("\n", maxsplit=1)[0]
        raise ResultError(f"{path}: cannot read it ({told}); expected jobs.parquet of algid batch") from error
    missing = {"job", "robot", "time", "status"} - set(names)
    if missing:
        raise ResultError(f"{path}: no column {', '.join(sorted(missing))}; expected jobs.parquet of algid batch")
    kept = jobs.filter(
        pl.col("robot").is_not_null() & pl.col("time").is_not_null() & pl.col("status").is_in(["ok", "incomplete"])
    )
    months = (pl.col("time") - pl.col("time").min().over("robot")).dt.total_seconds() / (86400 * MONTH_DAYS)
    return kept.with_columns(months.alias("t")).with_columns(pl.col("t").floor().cast(pl.Int32).alias("month"))


def parameters_in(jobs: pl.DataFrame) -> list[str]:
    """Parameters that the table has columns for."""
    return [name for name in PARAMETERS if name in jobs.columns]


def windows(jobs: pl.DataFrame, parameter: str) -> pl.DataFrame:
    """A row a robot and month: mean and slope of `parameter` on the window that ends with that month.

    Columns: robot, parameter, month, end (time of its last log), logs, mean, mean_std, slope, slope_std (of the
    parameter a month), p, drift.
    """
    import polars as pl

    known = jobs.filter((pl.col(f"{parameter}_std") > 0) & pl.col(parameter).is_finite())
    known = known.with_columns(pl.col(parameter).mean().over("robot").alias("centre"))
    w, t, y = 1 / pl.col(f"{parameter}_std") ** 2, pl.col("t"), pl.col(parameter) - pl.col("centre")
    months = known.group_by("robot", "month", maintain_order=False).agg(
        pl.col("centre").first(),
        pl.col("time").max().alias("end"),
        w.sum().alias("w"),
        (w * t).sum().alias("wt"),
        (w * t * t).sum().alias("wtt"),
        (w * y).sum().alias("wy"),
        (w * t * y).sum().alias("wty"),
        (w * y * y).sum().alias("wyy"),
        pl.len().cast(pl.Float64).alias("n"),
    )
    months = months.sort("robot", "month")
    summed = months.rolling(index_column="month", period=f"{SPAN}i", group_by="robot").agg(
        pl.col("centre").last(), pl.col("end").last(), *(pl.col(name).sum() for name in _SUMS)
    )
    return _regressed(summed, parameter)


def _regressed(summed: pl.DataFrame, parameter: str) -> pl.DataFrame:
    import polars as pl
    from scipy.stats import t as student

    w, wt, wtt, wy, wty, wyy, n = (summed[name].to_numpy() for name in _SUMS)
    with np.errstate(divide="ignore", invalid="ignore"):  # windows with a single log have no slope
        middle = wt / w
        spread = wtt - wt * middle
        slope = (wty - wy * middle) / spread
        squares = wyy - wy * wy / w - slope * slope * spread
        scale = np.sqrt(np.maximum(1.0, squares / np.maximum(n - 2, 1)))
        slope_std = scale / np.sqrt(spread)
        p = 2 * student.sf(np.abs(slope) / slope_std, np.maximum(n - 2, 1))
    tested = (n >= FEWEST) & (spread > 1e-9 * w)
    p = np.where(tested, p, np.nan)
    return summed.select("robot", pl.lit(parameter).alias("parameter"), "month", "end").with_columns(
        logs=pl.Series(n.astype(np.int64)),
        mean=pl.Series(summed["centre"].to_numpy() + wy / w),
        mean_std=pl.Series(scale / np.sqrt(w)),
        slope=pl.Series(np.where(tested, slope, np.nan)),
        slope_std=pl.Series(np.where(tested, slope_std, np.nan)),
        p=pl.Series(p),
        drift=pl.Series(np.nan_to_num(p, nan=1.0) < ALPHA),
    )
