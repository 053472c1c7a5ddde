"""A fleet's history from ``jobs.parquet``: drifting robots, outlying logs, untested ones."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from algid.base.errors import ResultError
from algid.base.files import whole_file
from algid.base.limits import LIMITS
from algid.base.progress import Progress
from algid.base.words import counted
from algid.fleet.findings import FEWEST, SPAN, followed
from algid.notices import Notice
from algid.physics.terms import ALWAYS, OPTIONAL

MONTH_DAYS = 30.4375


def _usual() -> Iterator[str]:
    """The parameters of the terms that every robot has, and of those that are usual."""
    for term in (*ALWAYS, *OPTIONAL):
        if term in ALWAYS or term.usual:
            yield from term.names


PARAMETERS = tuple(_usual())
"""Those that most robots have: others would be tested on few logs."""
FEWEST_PEERS = 3  # logs of a robot, among which one can be known from the others


def read_jobs(path: Path) -> pl.DataFrame:
    """The finished jobs of ``jobs.parquet``; a number that is none, or beyond all bounds, is null.

    ``t`` is in months, ``month`` whole, both null without a time.

    Raises
    ------
    ResultError
        If the table is missing or not one of algid batch.
    """
    expected = "expected jobs.parquet of algid batch"
    if not path.is_file():
        problem = "it is no regular file" if path.exists() else "there is no such file"
        raise ResultError(f"{path}: {problem}; {expected}")
    try:
        names = list(pl.read_parquet_schema(path))
        missing = [name for name in ("job", "robot", "status", "time") if name not in names]
        if missing:
            raise ResultError(f"{path}: no column {', '.join(missing)}; {expected}")
        followed = [name for name in PARAMETERS if name in names and f"{name}_std" in names]
        payload = ["label_payload", "m_p", "m_p_std"]
        numbers = payload + followed + [f"{name}_std" for name in followed]
        wanted = ["job", "robot", "status", "time", *numbers]
        jobs = pl.read_parquet(path, columns=[name for name in wanted if name in names])
        jobs = jobs.with_columns(
            pl.lit(None, pl.Float64).alias(name) for name in payload if name not in names
        )
        # a manifest's labels may be words: then they are no numbers
        size = pl.col(numbers).cast(pl.Float64, strict=False).abs()
        least = 1 / LIMITS.largest_value
        sound = (size <= LIMITS.largest_value) & ((size == 0) | (size >= least))
        jobs = jobs.with_columns(
            pl.col("job", "robot", "status").cast(pl.String),
            pl.col("time").cast(pl.Datetime("us", "UTC")),
            pl.when(sound).then(pl.col(numbers).cast(pl.Float64, strict=False)).name.keep(),
        )
    # a panic of polars is no Exception
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).split("\n", maxsplit=1)[0]
        raise ResultError(f"{path}: cannot read it ({reason}); {expected}") from error
    age = pl.col("time") - pl.col("time").min().over("robot")
    jobs = jobs.with_columns(t=age.dt.total_seconds() / (86400 * MONTH_DAYS))
    finished = jobs.filter(pl.col("status").is_in(["ok", "incomplete"]))
    return finished.with_columns(month=pl.col("t").floor().cast(pl.Int32))


@dataclass(frozen=True, eq=False)
class History:
    """A fleet's history.

    Parameters
    ----------
    windows, findings : as `algid.fleet.findings.followed` gives them
    roster : a row a robot: robot, logs, undated, first and last (times), latest (job), and
        tested (for drift of anything)
    jobs : every log, the latest of each robot first, as `read_jobs` gives them
    nameless : logs that name no robot, and are left out
    """

    windows: pl.DataFrame
    findings: pl.DataFrame
    roster: pl.DataFrame
    jobs: pl.DataFrame
    nameless: int = 0

    @property
    def robots(self) -> int:
        """How many there are."""
        return self.roster.height

    @property
    def logs(self) -> int:
        """How many there are, of all robots."""
        return int(self.roster["logs"].sum())

    @property
    def untested(self) -> list[Notice]:
        """What was not looked for, and why."""
        undated = int(self.roster["undated"].sum())
        steady = self.roster.filter(~pl.col("tested")).height
        alone = self.roster.filter(pl.col("logs") < FEWEST_PEERS).height
        reasons: list[dict[str, Any]] = [
            {"case": "nameless", "count": self.nameless},
            {"case": "undated", "count": undated},
            {"case": "steady", "count": steady, "least": FEWEST, "months": SPAN},
            {"case": "alone", "count": alone, "least": FEWEST_PEERS},
        ]
        return [Notice("NOT_TESTED", numbers=one) for one in reasons if one["count"]]

    def as_dict(self) -> dict[str, Any]:
        """What was found, in JSON's own types."""
        rows = {}
        for name, frame in (("robots", self.roster), ("findings", self.findings)):
            rows[name] = json.loads(frame.fill_nan(None).write_json())
        return {**rows, "untested": [one.text for one in self.untested]}


def history_of(path: Path, progress: Progress | None = None) -> History:
    """The history in ``jobs.parquet`` at `path`.

    `progress` hears how many robots have been followed.

    Raises
    ------
    ResultError
        If it cannot be read, or no finished job has both a robot and parameters.
    """
    finished = read_jobs(path)
    names = [name for name in PARAMETERS if name in finished.columns]
    jobs = finished.filter(pl.col("robot").is_not_null())
    if not finished.height or not names:
        raise ResultError(
            f"{path}: no job has given parameters; see its column reason, and run algid batch again"
        )
    if not jobs.height:
        raise ResultError(
            f"{path}: none of {counted(finished.height, 'finished job')} has a robot; give each "
            "robot's logs a folder "
            "of their own, or name robots in a manifest, and run algid batch again"
        )
    windows, findings = followed(jobs, names, progress)
    tested = windows.filter(pl.col("p").is_not_nan())["robot"].unique().implode()
    roster = (
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
    listed = jobs.sort("robot", "time", descending=[False, True], nulls_last=True)
    return History(windows, findings, roster, listed, finished.height - jobs.height)


def write_history(history: History, out: Path, batch: Path) -> list[Path]:
    """Write ``fleet.parquet``, ``findings.parquet``, ``fleet.html`` with links into `batch`.

    Raises
    ------
    OutputError
        If `out` cannot be written.
    """
    from algid.fleet.page import fleet_document
    from algid.report.render import page

    for name, frame in (("fleet.parquet", history.windows), ("findings.parquet", history.findings)):
        with whole_file(out / name) as temporary:
            frame.write_parquet(temporary)
    with whole_file(out / "fleet.html") as temporary:
        temporary.write_text(page(fleet_document(history, batch, out)), encoding="utf-8")
    return [out / name for name in ("fleet.parquet", "findings.parquet", "fleet.html")]
