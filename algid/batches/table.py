"""`jobs.parquet`: a row a job, in flat columns that SQL can ask."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from algid.base.stores import Store
from algid.batches.jobs import TABLE, utc_of
from algid.batches.records import COLUMNS, JobRecord

if TYPE_CHECKING:
    import polars as pl

_OF_LOGS = {"logs": "path", "sha256": "sha256", "size": "size", "changed": "mtime_ns"}
"""By column of lists the field of each log."""
FIRST_EPOCH_NS = 10**17  # stamps before 1973 count from some start, not from 1970


def write_jobs(store: Store, records: Sequence[JobRecord]) -> None:
    """Write ``jobs.parquet``, whole or not at all. Raises `OutputError`."""
    content = io.BytesIO()
    jobs_frame(records).write_parquet(content)
    store.write(TABLE, content.getvalue())


def jobs_frame(records: Sequence[JobRecord]) -> pl.DataFrame:
    """A row a record.

    Columns: job, robot, time, status, reason, seconds, log_seconds, verdict (good, reservations or
    failed), headline, reasons, command, estimator (whose numbers these are; the one asked for
    stands in the settings), version, settings (JSON); logs, sha256, size in bytes and time of
    change (lists); ``label_X`` for each label, numbers where every one is, text otherwise; ``k``,
    ``k_std`` and ``k_status`` for each estimate, null where there is none.
    """
    import polars as pl

    rows = []
    for one in records:
        row: dict[str, Any] = {**vars(one), "status": one.status.value, "reasons": [*one.reasons]}
        row |= {"job": one.job.name, "robot": one.job.robot, "time": time_of(one)}
        row["settings"] = json.dumps(one.settings, sort_keys=True)
        for column, name in _OF_LOGS.items():
            row[column] = [getattr(log, name) for log in one.inputs]
        # a file's time of change may be any
        row["changed"] = [ns if abs(ns) < 2**63 else None for ns in row["changed"]]
        rows.append(row)
    texts, numbers, instant = pl.List(pl.String), pl.List(pl.Int64), pl.Datetime("ns", "UTC")
    kinds: dict[str, Any] = dict.fromkeys(COLUMNS, pl.String)
    kinds |= {"time": pl.Datetime("us", "UTC"), "seconds": pl.Float64, "log_seconds": pl.Float64}
    kinds |= {"reasons": texts, "logs": texts, "sha256": texts, "size": numbers, "changed": numbers}
    columns = {
        name: pl.Series([row[name] for row in rows], dtype=kind) for name, kind in kinds.items()
    }
    columns["changed"] = columns["changed"].cast(pl.List(instant))
    for name in sorted({name for one in records for name in one.job.labels}):
        labels = [one.job.labels.get(name) for one in records]
        if all(label is None or type(label) in (int, float) for label in labels):
            columns[f"label_{name}"] = pl.Series(labels, dtype=pl.Float64, strict=False)
        else:
            words = [None if label is None else str(label) for label in labels]
            columns[f"label_{name}"] = pl.Series(words, dtype=pl.String)
    for name in sorted({name for one in records for name in one.estimates}):
        values, errors, states = zip(
            *(one.estimates.get(name, (None, None, None)) for one in records), strict=True
        )
        columns[name] = pl.Series(values, dtype=pl.Float64)
        columns[f"{name}_std"] = pl.Series(errors, dtype=pl.Float64)
        columns[f"{name}_status"] = pl.Series(states, dtype=pl.String)
    return pl.DataFrame(columns)


def time_of(record: JobRecord) -> datetime | None:
    """When the job's logs were taken, in UTC: as its manifest says, or as its first stamp does."""
    if record.job.time is not None:
        return utc_of(record.job.time)
    if record.start_ns is None or record.start_ns < FIRST_EPOCH_NS:
        return None
    return datetime.fromtimestamp(record.start_ns * 1e-9, UTC)
