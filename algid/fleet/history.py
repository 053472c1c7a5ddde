"""A fleet's history from ``jobs.parquet``: slopes of parameters over time, and single logs that stand out.

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

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.errors import ResultError
from algid.files import whole_file
from algid.progress import Told
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

MONTH_DAYS = 30.4375
SPAN = 3
ALPHA = 1e-3
FEWEST = 8  # logs in a window that is tested
PARAMETERS = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "f1", "f2", "o1", "o2", "j2")
FEWEST_PEERS = 3  # logs of a robot, among which one can be told from the others
OUTLYING = 6.0  # robust standard deviations
MISLABELLED = 5.0  # standard deviations: one false alarm in 1.7 million logs
_MAD = 1.4826  # from the median of absolute deviations to a standard deviation
_SUMS = ("w", "wt", "wtt", "wy", "wty", "wyy", "n")


def read_jobs(path: Path) -> pl.DataFrame:
    """The finished jobs of ``jobs.parquet``; ``t`` is in months, ``month`` whole, both null without a time.

    Raises
    ------
    ResultError
        If the table is missing or not one of algid batch.
    """
    import polars as pl

    if not path.is_file():
        found = "it is no regular file" if path.exists() else "there is no such file"
        raise ResultError(f"{path}: {found}; expected jobs.parquet of algid batch")
    try:
        names = list(pl.read_parquet_schema(path))
        wanted = [n for n in names if n in ("job", "robot", "time", "status", "label_payload", "m_p", "m_p_std")]
        wanted += [n for p in PARAMETERS if p in names and f"{p}_std" in names for n in (p, f"{p}_std")]
        jobs = pl.read_parquet(path, columns=wanted)
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).split("\n", maxsplit=1)[0]
        raise ResultError(f"{path}: cannot read it ({reason}); expected jobs.parquet of algid batch") from error
    missing = {"job", "robot", "time", "status"} - set(names)
    if missing:
        raise ResultError(f"{path}: no column {', '.join(sorted(missing))}; expected jobs.parquet of algid batch")
    months = (pl.col("time") - pl.col("time").min().over("robot")).dt.total_seconds() / (86400 * MONTH_DAYS)
    finished = jobs.filter(pl.col("status").is_in(["ok", "incomplete"]))
    return finished.with_columns(months.alias("t")).with_columns(pl.col("t").floor().cast(pl.Int32).alias("month"))


def parameters_in(jobs: pl.DataFrame) -> list[str]:
    """Parameters that the table has columns for."""
    return [name for name in PARAMETERS if name in jobs.columns]


def windows(jobs: pl.DataFrame, parameter: str) -> pl.DataFrame:
    """A row a robot and month: mean and slope of `parameter` on the window that ends with that month.

    Columns: robot, parameter, month, end (time of its last log), logs, mean, mean_std, slope, slope_std (of the
    parameter a month), p, drift.
    """
    import polars as pl

    known = jobs.filter(pl.col("time").is_not_null() & (pl.col(f"{parameter}_std") > 0) & pl.col(parameter).is_finite())
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
    from scipy.special import stdtr

    w, wt, wtt, wy, wty, wyy, n = (summed[name].to_numpy() for name in _SUMS)
    middle = wt / w
    sloped = wtt - wt * middle > 1e-9 * w  # logs of one instant, or a single one, have a mean and no slope
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
    return summed.select("robot", pl.lit(parameter).alias("parameter"), "month", "end").with_columns(
        logs=pl.Series(n.astype(np.int64)),
        mean=pl.Series(summed["centre"].to_numpy() + wy / w),
        mean_std=pl.Series(scale / np.sqrt(w)),
        slope=pl.Series(np.where(tested, slope, np.nan)),
        slope_std=pl.Series(np.where(tested, slope_std, np.nan)),
        p=pl.Series(p),
        drift=pl.Series(np.nan_to_num(p, nan=1.0) < ALPHA),
    )


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
    """Payloads that differ from ``label_payload`` (kg) by more than their intervals explain; columns as `outliers`.

    Where a robot's payloads scatter about each other by more than their intervals say, that scatter counts. Medians
    are the lower ones, so that of two logs the one that agrees with its label shows how well they can.
    """
    import polars as pl

    if not {"label_payload", "m_p", "m_p_std"} <= set(jobs.columns) or jobs["label_payload"].dtype != pl.Float64:
        return _nothing(jobs)
    labelled = jobs.filter((pl.col("m_p_std") > 0) & pl.col("label_payload").is_not_null()).with_columns(
        pl.col("label_payload").alias("expected"),
        ((pl.col("m_p") - pl.col("label_payload")) / pl.col("m_p_std")).alias("sigmas"),
    )
    centred = (pl.col("sigmas") - _lower_median(pl.col("sigmas")).over("robot")).abs()
    scatter = (_MAD * _lower_median(centred).over("robot")).clip(lower_bound=1.0)
    wrong = labelled.with_columns(pl.col("sigmas") / scatter).filter(pl.col("sigmas").abs() > MISLABELLED)
    return _as_findings(wrong, "payload", "m_p")


def _lower_median(values: pl.Expr) -> pl.Expr:
    return values.quantile(0.5, interpolation="lower")


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


@dataclass(frozen=True, eq=False)
class History:
    """A fleet's history.

    Parameters
    ----------
    windows : as `windows` gives them, of all parameters
    findings : as `outliers` and `mislabelled` give them
    roster : a row a robot: robot, logs, undated, first and last (times), latest (job), tested (for drift of anything)
    jobs : robot and job of every log, the latest first
    nameless : logs that name no robot, and are left out
    """

    windows: pl.DataFrame
    findings: pl.DataFrame
    roster: pl.DataFrame
    nameless: int = 0
    jobs: pl.DataFrame | None = None

    @property
    def robots(self) -> int:
        """How many there are."""
        return self.roster.height

    @property
    def logs(self) -> int:
        """How many there are, of all robots."""
        return int(self.roster["logs"].sum())

    @property
    def drifts(self) -> pl.DataFrame:
        """The latest drifting window of each robot and parameter, the clearest first."""
        import polars as pl

        found = self.windows.filter("drift").sort("month").group_by("robot", "parameter").last()
        return found.sort(pl.col("p"), "robot", "parameter")

    @property
    def untested(self) -> list[str]:
        """What was not looked for, and why: a sentence each."""
        import polars as pl

        undated = int(self.roster["undated"].sum())
        steady = self.roster.filter(~pl.col("tested")).height
        alone = self.roster.filter(pl.col("logs") < FEWEST_PEERS).height
        why = {
            f"{counted(self.nameless, 'log')} left out for want of a robot: give each robot's logs their own folder, "
            "or name robots in a manifest.": self.nameless,
            f"No drift was looked for in {counted(undated, 'log')} without a date: stamps count from 1970, or a "
            "manifest tells the time.": undated,
            f"Drift was not tested for {counted(steady, 'robot')}: fewer than {FEWEST} dated logs within {SPAN} "
            "months.": steady,
            f"Outliers were not tested for {counted(alone, 'robot')}: fewer than {FEWEST_PEERS} logs.": alone,
        }
        return [sentence for sentence, count in why.items() if count]

    def as_dict(self) -> dict[str, Any]:
        """What was found, in JSON's own types."""
        frames = {"robots": self.roster, "drifts": self.drifts, "findings": self.findings}
        rows = {name: json.loads(frame.fill_nan(None).write_json()) for name, frame in frames.items()}
        return {**rows, "untested": self.untested}


def history_of(path: Path, progress: Told | None = None) -> History:
    """The history in ``jobs.parquet`` at `path`; `progress` hears how many parameters have been followed.

    Raises
    ------
    ResultError
        If it cannot be read, or no finished job has both a robot and parameters.
    """
    import polars as pl

    finished = read_jobs(path)
    names = parameters_in(finished)
    jobs = finished.filter(pl.col("robot").is_not_null())
    if not finished.height or not names:
        raise ResultError(f"{path}: no job has given parameters; see its column reason, and run algid batch again")
    if not jobs.height:
        raise ResultError(
            f"{path}: none of {counted(finished.height, 'finished job')} has a robot; give each robot's logs a folder "
            "of their own, or name robots in a manifest, and run algid batch again"
        )
    followed = []
    for place, name in enumerate(names):
        if progress is not None:
            progress("following", place, len(names))
        followed.append(windows(jobs, name))
    history = pl.concat(followed)
    findings = pl.concat([mislabelled(jobs), outliers(jobs)]).sort("kind", "robot", "time", "parameter")
    listed = jobs.sort("robot", "time", descending=[False, True], nulls_last=True).select("robot", "job")
    return History(history, findings, _roster(jobs, history), finished.height - jobs.height, listed)


def _roster(jobs: pl.DataFrame, history: pl.DataFrame) -> pl.DataFrame:
    import polars as pl

    tested = history.filter(pl.col("p").is_not_nan())["robot"].unique().implode()
    return (
        jobs.group_by("robot")
        .agg(
            pl.len().alias("logs"),
            pl.col("time").null_count().alias("undated"),
            pl.col("time").min().alias("first"),
            pl.col("time").max().alias("last"),
            pl.col("job").sort_by("time", nulls_last=False).last().alias("latest"),
        )
        .with_columns(tested=pl.col("robot").is_in(tested))
        .sort("robot")
    )


def write_history(history: History, out: Path, batch: Path) -> list[Path]:
    """Write ``fleet.parquet``, ``findings.parquet`` and ``fleet.html``, which links to the reports in `batch`.

    Raises
    ------
    OutputError
        If `out` cannot be written.
    """
    from algid.fleet.page import fleet_html, reports_of

    for name, frame in (("fleet.parquet", history.windows), ("findings.parquet", history.findings)):
        with whole_file(out / name) as temporary:
            frame.write_parquet(temporary)
    with whole_file(out / "fleet.html") as temporary:
        temporary.write_text(fleet_html(history, reports_of(history, batch, out)), encoding="utf-8")
    return [out / name for name in ("fleet.parquet", "findings.parquet", "fleet.html")]
