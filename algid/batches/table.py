"""`jobs.parquet`: a row a job, in flat columns that SQL can ask."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from algid.batches.jobs import JobRecord, utc_of

if TYPE_CHECKING:
    import polars as pl

COLUMNS = (
    *("job", "robot", "time", "status", "reason", "seconds"),
    *("log_seconds", "verdict", "headline", "reasons", "command", "estimator"),
    *("version", "settings", "logs", "sha256", "size", "changed"),
)
"""Columns that every table has."""
_OF_LOGS = (("logs", "path"), ("sha256", "sha256"), ("size", "size"), ("changed", "mtime_ns"))
"""Columns of lists, and the field of each log."""
FIRST_EPOCH_NS = 10**17  # stamps before 1973 count from some start, not from 1970


def jobs_frame(records: Sequence[JobRecord]) -> pl.DataFrame:
    """A row a record.

    Columns: job, robot, time, status, reason, seconds, log_seconds, verdict (good, reservations or
    failed), headline, reasons, command, estimator (whose numbers these are; the one asked for
    stands in the settings), version, settings (JSON); logs, sha256, size in bytes and time of
    change (lists); ``label_X`` for each label, numbers where every one is, text otherwise; ``k``,
    ``k_std`` and ``k_status`` for each estimate, null where there is none.
    """
    import polars as pl

    texts, sizes, times = pl.List(pl.String), pl.List(pl.Int64), pl.List(pl.Datetime("ns", "UTC"))
    kinds: dict[str, Any] = dict.fromkeys(COLUMNS, pl.String)
    kinds |= {"time": pl.Datetime("us", "UTC"), "seconds": pl.Float64, "log_seconds": pl.Float64}
    kinds |= {"reasons": texts, "logs": texts, "sha256": texts, "size": sizes, "changed": times}
    rows, labels = list[dict[str, Any]](), dict[str, Any]()
    for one in records:  # text, unless they are numbers in every job
        for name, label in one.job.labels.items():
            if type(label) in (str, bool) or name not in labels:
                labels[name] = pl.String if type(label) in (str, bool) else pl.Float64
    for name in sorted(labels):
        kinds[f"label_{name}"] = labels[name]
    for name in sorted({name for one in records for name in one.estimates}):
        kinds |= {name: pl.Float64, f"{name}_std": pl.Float64, f"{name}_status": pl.String}
    for one in records:
        row: dict[str, Any] = {**vars(one), "job": one.job.name, "robot": one.job.robot}
        row["settings"] = json.dumps(one.settings, sort_keys=True)
        if one.job.time is not None:  # as its manifest says, or as its first stamp does
            row["time"] = utc_of(one.job.time)
        elif one.start_ns is not None and one.start_ns >= FIRST_EPOCH_NS:
            row["time"] = datetime.fromtimestamp(one.start_ns * 1e-9, UTC)
        row |= {column: [getattr(log, name) for log in one.inputs] for column, name in _OF_LOGS}
        for name, label in one.job.labels.items():
            row[f"label_{name}"] = str(label) if labels[name] == pl.String else label
        for name, numbers in one.estimates.items():
            row |= zip((name, f"{name}_std", f"{name}_status"), numbers, strict=True)
        rows.append(row)
    columns = {name: [row.get(name) for row in rows] for name in kinds}
    return pl.DataFrame(columns, kinds, strict=False)
