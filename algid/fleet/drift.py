"""Drift: slopes of a fleet's parameters over time, on windows of some months.

======  ============================================  =========
symbol  name                                          unit
======  ============================================  =========
t       time since the robot's first log              month
y       estimate, less the robot's mean               its own
w       1 / std², what the estimate's interval says   its own
======  ============================================  =========

A window is `SPAN` months long and ends with each month, so that a year holds twelve tests a
parameter. The slope's error is the one that the intervals give, or the larger one that the scatter
about the line shows; its t test alarms below `ALPHA`. With seven parameters that is 12 × 7 × 0.0009
= 0.076 false alarms a robot-year where estimates scatter independently. Sums of a month's moments
add up to a window's: the cost is O(N).
"""

from __future__ import annotations

import numpy as np
import polars as pl
from scipy.special import stdtr, stdtrit

from algid.base.significance import LEVEL

SPAN = 3
ALPHA = LEVEL
FEWEST = 8  # logs in a window that is tested
_SUMS = ("w", "wt", "wtt", "wy", "wty", "wyy", "n")


def windows(jobs: pl.DataFrame, parameter: str, by: tuple[str, ...] = ("robot",)) -> pl.DataFrame:
    """A row a robot and month: mean and slope of `parameter` on the window that the month ends.

    Parameters
    ----------
    jobs : pl.DataFrame
        As `algid.fleet.history.read_jobs` gives them.
    parameter : str
        A column of `jobs`, beside that of its standard deviation.
    by : tuple of str
        Columns that tell the histories apart, that of the robot among them.

    Returns
    -------
    pl.DataFrame
        those of `by`, parameter, month, end (time of its last log), logs, mean, mean_std, slope,
        slope_std (of the parameter a month; NaN where not tested), p, drift.
    """
    known = jobs.filter(
        pl.col("time").is_not_null()
        & (pl.col(f"{parameter}_std") > 0)
        & pl.col(parameter).is_finite()
    )
    known = known.with_columns(pl.col(parameter).mean().over(*by).alias("centre"))
    weight, t, y = (
        1 / pl.col(f"{parameter}_std") ** 2,
        pl.col("t"),
        pl.col(parameter) - pl.col("centre"),
    )
    months = known.group_by(*by, "month", maintain_order=False).agg(
        pl.col("centre").first(),
        pl.col("time").max().alias("end"),
        weight.sum().alias("w"),
        (weight * t).sum().alias("wt"),
        (weight * t * t).sum().alias("wtt"),
        (weight * y).sum().alias("wy"),
        (weight * t * y).sum().alias("wty"),
        (weight * y * y).sum().alias("wyy"),
        pl.len().cast(pl.Float64).alias("n"),
    )
    months = months.sort(*by, "month")
    summed = months.rolling(index_column="month", period=f"{SPAN}i", group_by=list(by)).agg(
        pl.col("centre").last(), pl.col("end").last(), *(pl.col(name).sum() for name in _SUMS)
    )
    # the weighted line through each window's logs, by its sums
    w, wt, wtt, wy, wty, wyy, n = (summed[name].to_numpy() for name in _SUMS)
    middle = wt / w
    # logs of one instant, or a single one, have a mean and no slope
    sloped = wtt - wt * middle > 1e-9 * w
    spread = np.where(sloped, wtt - wt * middle, np.inf)
    rise = np.where(sloped, wty - wy * middle, 0.0)
    slope = rise / spread
    squares = wyy - wy * wy / w - slope * rise
    freedom = np.maximum(n - 1 - sloped, 1)
    scale = np.sqrt(np.maximum(1.0, squares / freedom))
    slope_std = scale / np.sqrt(spread)
    tested = (n >= FEWEST) & sloped
    p = np.full(n.size, np.nan)
    p[tested] = 2 * stdtr(freedom[tested], -np.abs(slope[tested]) / slope_std[tested])
    return summed.select(*by, pl.lit(parameter).alias("parameter"), "month", "end").with_columns(
        logs=pl.Series(n.astype(np.int64)),
        mean=pl.Series(summed["centre"].to_numpy() + wy / w),
        mean_std=pl.Series(scale / np.sqrt(w)),
        slope=pl.Series(np.where(tested, slope, np.nan)),
        slope_std=pl.Series(np.where(tested, slope_std, np.nan)),
        p=pl.Series(p),
        drift=pl.Series(np.nan_to_num(p, nan=1.0) < ALPHA),
    )


def drifts(windows: pl.DataFrame) -> pl.DataFrame:
    """The latest drifting window of each robot and parameter, the clearest first.

    Columns as `algid.fleet.outliers.outliers`: the value is the slope, the parameter's unit a
    month, with `half` its 95 % interval; expected is the window's mean.
    """
    last = windows.filter("drift").sort("month").group_by("robot", "parameter").last()
    last = last.sort("p", "robot", "parameter")
    quantiles = pl.Series(stdtrit(last["logs"].to_numpy() - 2.0, 0.975), dtype=pl.Float64)
    return last.select(
        "robot",
        "parameter",
        kind=pl.lit("drift"),
        time="end",
        value="slope",
        half=pl.col("slope_std") * quantiles,
        expected="mean",
        sigmas=pl.col("slope") / pl.col("slope_std"),
    )
