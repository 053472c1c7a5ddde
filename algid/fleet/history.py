"""A fleet's history from ``jobs.parquet``: drifting robots, outlying logs, untested ones."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from algid.base.errors import ResultError
from algid.base.limits import LIMITS
from algid.base.progress import Progress
from algid.base.text import counted
from algid.fleet.findings import FEWEST, SPAN, followed
from algid.model import FIRST_TERMS, Model
from algid.notices import Notice

MONTH_DAYS = 30.4375
PARAMETERS = Model(FIRST_TERMS).names
"""Those that most robots have: others would be tested on few logs."""
NUMBERS = [
    "label_payload",
    *(f"{name}{end}" for name in (*PARAMETERS, "m_p") for end in ("", "_std")),
]


def read_jobs(path: Path) -> pl.DataFrame:
    """The jobs of ``jobs.parquet``; what is no number, not there or beyond bounds is null.

    So is what a prior alone gives: no log has measured it.
    ``t`` is in months, ``month`` whole, both null without a time.

    Raises
    ------
    ResultError
        If the table is missing or not one of algid batch.
    """
    expected = "expected jobs.parquet of algid batch"
    try:
        jobs = pl.scan_parquet(path, glob=False)  # of which only what follows is read
        columns = jobs.collect_schema().names()
        missing = [name for name in ("job", "robot", "status", "time") if name not in columns]
        if missing:
            raise ResultError(f"{path}: no column {', '.join(missing)}; {expected}")
        changed = {name: pl.lit(None) for name in NUMBERS if name not in columns}
        for name in PARAMETERS:
            if {name, told := f"{name}_status"} <= {*columns}:
                measured = pl.col(told).cast(pl.String).ne_missing("FROM_PRIOR")
                changed[name] = pl.when(measured).then(pl.col(name))
        # a manifest's labels may be words: then they are no numbers
        number, most = pl.col(NUMBERS).cast(pl.Float64, strict=False), LIMITS.largest_value
        age = pl.col("time") - pl.col("time").min().over("robot")
        t = age.dt.total_seconds() / (86400 * MONTH_DAYS)
        jobs = jobs.with_columns(**changed).select(
            pl.col("job", "robot", "status").cast(pl.String),
            "time",
            pl.when(number.abs().is_between(1 / most, most) | (number == 0)).then(number),
            t=t,
            month=t.floor().cast(pl.Int32),
        )
        return jobs.collect()
    # a panic of polars is no Exception
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).split("\n", maxsplit=1)[0]
        raise ResultError(f"{path}: cannot read it ({reason}); {expected}") from error


@dataclass(frozen=True, eq=False)
class History:
    """A fleet's history.

    Parameters
    ----------
    windows, findings : as `algid.fleet.findings.followed` gives them
    roster : a row a robot: robot, logs, undated, first and last (times), latest (job), and
        tested (for drift of anything)
    jobs : every log, the latest of each robot first, as `read_jobs` gives them
    nameless, failed : logs that name no robot, and jobs without a result, which are left out
    """

    windows: pl.DataFrame
    findings: pl.DataFrame
    roster: pl.DataFrame
    jobs: pl.DataFrame
    nameless: int
    failed: int

    @property
    def untested(self) -> list[Notice]:
        """What was not looked for, and why."""
        notices, roster = list[Notice](), self.roster
        for case, count in (
            ("failed", self.failed),
            ("nameless", self.nameless),
            ("undated", roster["undated"].sum()),
            ("steady", (~roster["tested"]).sum()),
        ):
            if count:
                numbers = {"case": case, "count": count, "least": FEWEST, "months": SPAN}
                notices.append(Notice("NOT_TESTED", numbers=numbers))
        return notices

    def as_json(self) -> str:
        """What was found, as the text of a JSON file."""
        frames = {"robots": self.roster, "findings": self.findings}
        parts = {name: json.loads(one.fill_nan(None).write_json()) for name, one in frames.items()}
        parts["untested"] = [one.text for one in self.untested]
        return json.dumps(parts, indent=2, allow_nan=False)


def history_of(path: Path, progress: Progress | None = None) -> History:
    """The history in ``jobs.parquet`` at `path`.

    `progress` hears how many robots have been followed.

    Raises
    ------
    ResultError
        If it cannot be read, or no finished job has both a robot and parameters.
    """
    every = read_jobs(path)
    finished = every.filter(pl.col("status").is_in(["ok", "incomplete"]))
    names = [name for name in PARAMETERS if (finished[name] * finished[f"{name}_std"]).count()]
    jobs = finished.filter(pl.col("robot").is_not_null())
    if not names:
        raise ResultError(
            f"{path}: no job has given parameters; see its column reason, and run algid batch again"
        )
    if not jobs.height:
        raise ResultError(
            f"{path}: none of {counted(finished.height, 'finished job')} has a robot; give each "
            "robot's logs a folder of their own, or name robots in a manifest, and run algid batch "
            "again"
        )
    windows, findings = followed(jobs, names, progress)
    time, tested = pl.col("time"), windows.drop_nulls("p")["robot"].unique().implode()
    roster = jobs.group_by("robot").agg(
        logs=pl.len(),
        undated=time.null_count(),
        first=time.min(),
        last=time.max(),
        latest=pl.col("job").sort_by("time", nulls_last=False).last(),
    )
    roster = roster.with_columns(tested=pl.col("robot").is_in(tested)).sort("robot")
    listed = jobs.sort("robot", "time", descending=[False, True], nulls_last=True)
    return History(
        windows,
        findings,
        roster,
        listed,
        finished.height - jobs.height,
        every.height - finished.height,
    )
