"""`jobs.parquet`: a row a job, in flat columns that SQL can ask."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from algid.base.stores import Store
from algid.batches.jobs import TABLE, Label, utc_of
from algid.batches.records import Input, JobRecord

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

    def column(
        kind: pl.DataType | type[pl.DataType], value: Callable[[JobRecord], Any]
    ) -> pl.Series:
        return pl.Series([value(record) for record in records], dtype=kind)

    def of_logs(kind: type[pl.DataType], value: Callable[[Input], Any]) -> pl.Series:
        return column(pl.List(kind), lambda record: [value(log) for log in record.inputs])

    columns = {
        "job": column(pl.String, lambda record: record.job.name),
        "robot": column(pl.String, lambda record: record.job.robot),
        "time": column(pl.Datetime("us", "UTC"), time_of),
        "status": column(pl.String, lambda record: record.status.value),
        "reason": column(pl.String, lambda record: record.reason),
        "seconds": column(pl.Float64, lambda record: record.seconds),
        "log_seconds": column(pl.Float64, lambda record: record.log_seconds),
        "verdict": column(pl.String, lambda record: record.verdict),
        "headline": column(pl.String, lambda record: record.headline),
        "reasons": column(pl.List(pl.String), lambda record: list(record.reasons)),
        "command": column(pl.String, lambda record: record.command),
        "estimator": column(pl.String, lambda record: record.estimator),
        "version": column(pl.String, lambda record: record.version),
        "settings": column(pl.String, lambda record: json.dumps(record.settings, sort_keys=True)),
        "logs": of_logs(pl.String, lambda log: log.path),
        "sha256": of_logs(pl.String, lambda log: log.sha256),
        "size": of_logs(pl.Int64, lambda log: log.size),
        "changed": of_logs(pl.Int64, lambda log: _in_int64(log.mtime_ns)).cast(
            pl.List(pl.Datetime("ns", "UTC"))
        ),
    }
    for name in _names([record.job.labels for record in records]):
        columns[f"label_{name}"] = _label_column(
            [record.job.labels.get(name) for record in records]
        )
    for name in _names([record.estimates for record in records]):
        values, stds, statuses = list[float | None](), list[float | None](), list[str | None]()
        for record in records:
            value, std, status = record.estimates.get(name, (None, None, None))
            values.append(value)
            stds.append(std)
            statuses.append(status)
        columns[name] = pl.Series(values, dtype=pl.Float64)
        columns[f"{name}_std"] = pl.Series(stds, dtype=pl.Float64)
        columns[f"{name}_status"] = pl.Series(statuses, dtype=pl.String)
    return pl.DataFrame(columns)


def _label_column(labels: Sequence[Label | None]) -> pl.Series:
    """Numbers where every label is one, else text."""
    import polars as pl

    if all(label is None or type(label) in (int, float) for label in labels):
        return pl.Series(labels, dtype=pl.Float64, strict=False)
    texts = [None if label is None else str(label) for label in labels]
    return pl.Series(texts, dtype=pl.String)


def _in_int64(number: int) -> int | None:
    """A time in ns; None where it lies too far off, as file systems may say."""
    if not -(2**63) <= number < 2**63:
        return None
    return number


def time_of(record: JobRecord) -> datetime | None:
    """When the job's logs were taken, in UTC: as its manifest says, or as its first stamp does."""
    if record.job.time is not None:
        return utc_of(record.job.time)
    if record.start_ns is None or record.start_ns < FIRST_EPOCH_NS:
        return None
    return datetime.fromtimestamp(record.start_ns * 1e-9, UTC)


def _names(several: Sequence[Mapping[str, Any]]) -> list[str]:
    names: set[str] = set()
    for one in several:
        names.update(one)
    return sorted(names)
