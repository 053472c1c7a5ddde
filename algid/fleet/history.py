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

Single logs that stand out: outliers of a robot's history, and payloads that are not what their labels say.

`algid fleet`: from ``jobs.parquet`` to ``fleet.parquet``, ``findings.parquet`` and ``fleet.html``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.errors import ResultError
from algid.files import whole_file
from algid.progress import Told

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


if TYPE_CHECKING:
    import polars as pl

OUTLYING = 6.0  # robust standard deviations
MISLABELLED = 5.0  # standard deviations: one false alarm in 1.7 million logs
_MAD = 1.4826  # from the median of absolute deviations to a standard deviation


def outliers(jobs: pl.DataFrame) -> pl.DataFrame:
    """Estimates far from their robot's median, in the larger of their own and the history's scatter.

    Columns: kind, robot, job, time, parameter, value, expected, sigmas.
    """
    import polars as pl

    found = [_far(jobs, name) for name in parameters_in(jobs)]
    return pl.concat(found) if found else _nothing(jobs)


def _far(jobs: pl.DataFrame, name: str) -> pl.DataFrame:
    import polars as pl

    scaled = jobs.filter((pl.col(f"{name}_std") > 0) & pl.col(name).is_finite()).with_columns(
        pl.col(name).median().over("robot").alias("expected")
    )
    scaled = scaled.with_columns(((pl.col(name) - pl.col("expected")) / pl.col(f"{name}_std")).alias("sigmas"))
    scatter = (_MAD * pl.col("sigmas").abs().median().over("robot")).clip(lower_bound=1.0)
    far = scaled.with_columns(pl.col("sigmas") / scatter).filter(pl.col("sigmas").abs() > OUTLYING)
    return _as_findings(far, "outlier", name)


def mislabelled(jobs: pl.DataFrame) -> pl.DataFrame:
    """Payloads that differ from ``label_payload`` (kg) by more than their intervals explain; columns as `outliers`."""
    import polars as pl

    if not {"label_payload", "m_p", "m_p_std"} <= set(jobs.columns) or jobs["label_payload"].dtype != pl.Float64:
        return _nothing(jobs)
    told = jobs.filter((pl.col("m_p_std") > 0) & pl.col("label_payload").is_not_null()).with_columns(
        pl.col("label_payload").alias("expected"),
        ((pl.col("m_p") - pl.col("label_payload")) / pl.col("m_p_std")).alias("sigmas"),
    )
    centred = (pl.col("sigmas") - pl.col("sigmas").median().over("robot")).abs()
    scatter = (_MAD * centred.median().over("robot")).clip(lower_bound=1.0)
    wrong = told.with_columns(pl.col("sigmas") / scatter).filter(pl.col("sigmas").abs() > MISLABELLED)
    return _as_findings(wrong, "payload", "m_p")


def _as_findings(rows: pl.DataFrame, kind: str, name: str) -> pl.DataFrame:
    import polars as pl

    return rows.select(
        pl.lit(kind).alias("kind"),
        "robot",
        "job",
        "time",
        pl.lit(name).alias("parameter"),
        pl.col(name).alias("value"),
        "expected",
        "sigmas",
    )


def _nothing(jobs: pl.DataFrame) -> pl.DataFrame:
    import polars as pl

    empty = jobs.head(0).with_columns(expected=pl.lit(np.nan), sigmas=pl.lit(np.nan), nothing=pl.lit(np.nan))
    return _as_findings(empty, "payload", "nothing").with_columns(parameter=pl.lit("m_p"))


if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, eq=False)
class History:
    """A fleet's history: windows (`algid.fleet.history`), findings (`algid.fleet.history`), and what they rest on."""

    windows: pl.DataFrame
    findings: pl.DataFrame
    robots: int
    logs: int

    @property
    def drifts(self) -> pl.DataFrame:
        """The latest drifting window of each robot and parameter, the clearest first."""
        import polars as pl

        found = self.windows.filter("drift").sort("month").group_by("robot", "parameter").last()
        return found.sort(pl.col("p"), "robot", "parameter")


def history_of(path: Path, told: Told | None = None) -> History:
    """The history in ``jobs.parquet`` at `path`; `told` hears how many parameters have been followed.

    Raises
    ------
    ResultError
        If it cannot be read, or no finished job has both a robot and a time.
    """
    import polars as pl

    jobs = read_jobs(path)
    names = parameters_in(jobs)
    if not jobs.height or not names:
        raise ResultError(f"{path}: no finished job has a robot, a time and parameters; name them in a manifest")
    followed = []
    for place, name in enumerate(names):
        if told is not None:
            told("following", place, len(names))
        followed.append(windows(jobs, name))
    history = pl.concat(followed)
    findings = pl.concat([mislabelled(jobs), outliers(jobs)]).sort(
        "kind", "robot", "time", "parameter", descending=False
    )
    return History(history, findings, jobs["robot"].n_unique(), jobs.height)


def write_history(history: History, out: Path) -> list[Path]:
    """Write ``fleet.parquet``, ``findings.parquet`` and ``fleet.html`` into `out`. Raises `OutputError`."""
    from algid.fleet.page import fleet_html

    written = []
    for name, frame in (("fleet.parquet", history.windows), ("findings.parquet", history.findings)):
        with whole_file(out / name) as temporary:
            frame.write_parquet(temporary)
        written.append(out / name)
    with whole_file(out / "fleet.html") as temporary:
        temporary.write_text(fleet_html(history), encoding="utf-8")
    return [*written, out / "fleet.html"]
