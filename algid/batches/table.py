"""`jobs.parquet`: a row a job, in flat columns that SQL can ask."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from algid.batches.jobs import TABLE, utc_of
from algid.batches.records import JobRecord
from algid.stores import Store

if TYPE_CHECKING:
    import polars as pl

FIRST_EPOCH_NS = 10**17  # stamps before 1973 count from some start, not from 1970


def write_jobs(store: Store, records: Sequence[JobRecord]) -> None:
    """Write ``jobs.parquet``, whole or not at all. Raises `OutputError`."""
    content = io.BytesIO()
    jobs_frame(records).write_parquet(content)
    store.write(TABLE, content.getvalue())


def jobs_frame(records: Sequence[JobRecord]) -> pl.DataFrame:
    """A row a record.

    Columns: job, robot, time, status, reason, seconds, log_seconds, estimator (whose numbers these
    are; the one asked for stands in the settings), verdict (good, reservations or failed),
    version, settings (JSON); logs, sha256, size in bytes and time of change (lists; a log that was
    fetched in part has no sha256); ``label_X`` for each label, numbers where every one is, text
    otherwise; ``k``, ``k_std`` and ``k_status`` for each estimate, null where there is none.
    """
    import polars as pl

    columns: dict[str, pl.Series] = {
        "job": pl.Series([r.job.name for r in records], dtype=pl.String),
        "robot": pl.Series([r.job.robot for r in records], dtype=pl.String),
        "time": pl.Series([time_of(r) for r in records], dtype=pl.Datetime("us", "UTC")),
        "status": pl.Series([r.status.value for r in records], dtype=pl.String),
        "reason": pl.Series([r.reason for r in records], dtype=pl.String),
        "seconds": pl.Series([r.seconds for r in records], dtype=pl.Float64),
        "log_seconds": pl.Series([r.log_seconds for r in records], dtype=pl.Float64),
        "verdict": pl.Series([r.verdict for r in records], dtype=pl.String),
        "headline": pl.Series([r.headline for r in records], dtype=pl.String),
        "reasons": pl.Series([list(r.reasons) for r in records], dtype=pl.List(pl.String)),
        "command": pl.Series([r.command for r in records], dtype=pl.String),
        "estimator": pl.Series([r.estimator for r in records], dtype=pl.String),
        "version": pl.Series([r.version for r in records], dtype=pl.String),
        "settings": pl.Series(
            [json.dumps(r.settings, sort_keys=True) for r in records], dtype=pl.String
        ),
        "logs": pl.Series([[i.path for i in r.inputs] for r in records], dtype=pl.List(pl.String)),
        "sha256": pl.Series(
            [[i.sha256 for i in r.inputs] for r in records], dtype=pl.List(pl.String)
        ),
        "size": pl.Series([[i.size for i in r.inputs] for r in records], dtype=pl.List(pl.Int64)),
        "changed": pl.Series(
            [[_in_int64(i.mtime_ns) for i in r.inputs] for r in records], dtype=pl.List(pl.Int64)
        ).cast(pl.List(pl.Datetime("ns", "UTC"))),
    }
    for name in _names([r.job.labels for r in records]):
        labels = [r.job.labels.get(name) for r in records]
        numbers = all(label is None or type(label) in (int, float) for label in labels)
        kind, dtype = (float, pl.Float64) if numbers else (str, pl.String)
        columns[f"label_{name}"] = pl.Series(
            [None if x is None else kind(x) for x in labels], dtype=dtype
        )
    for name in _names([r.estimates for r in records]):
        found = [r.estimates.get(name, (None, None, None)) for r in records]
        columns[name] = pl.Series([one[0] for one in found], dtype=pl.Float64)
        columns[f"{name}_std"] = pl.Series([one[1] for one in found], dtype=pl.Float64)
        columns[f"{name}_status"] = pl.Series([one[2] for one in found], dtype=pl.String)
    return pl.DataFrame(columns)


def _in_int64(number: int) -> int | None:
    """A time in ns; None where it lies too far off, as file systems may say."""
    return number if -(2**63) <= number < 2**63 else None


def time_of(record: JobRecord) -> datetime | None:
    """When the job's logs were taken, in UTC: as its manifest says, or as its first stamp does."""
    if record.job.time is not None:
        return utc_of(record.job.time)
    if record.start_ns is None or record.start_ns < FIRST_EPOCH_NS:
        return None
    return datetime.fromtimestamp(record.start_ns * 1e-9, UTC)


def _names(several: Sequence[Mapping[str, Any]]) -> list[str]:
    return sorted({name for one in several for name in one})
