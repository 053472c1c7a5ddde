"""What is known of a job that has come to an end: one small file each, written whole, below ``OUT/.jobs``.

`jobs.parquet`: a row a job, in flat columns that SQL can ask.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.batch.jobs import Job
from algid.errors import LogError
from algid.identification.source import sha256_of
from algid.results import Result
from algid.stores import Store, is_url, object_stat, public

FOLDER = ".jobs"


class End(StrEnum):
    """How a job ended."""

    OK = "ok"
    INCOMPLETE = "incomplete"  # a result is there, but data were lost or a parameter is not identifiable
    FAILED = "failed"
    KILLED = "killed"  # it took its worker with it, three times


FAILURES = (End.FAILED, End.KILLED)


@dataclass(frozen=True)
class Input:
    """A log as it was when the job started: size in bytes, times of change in ns, and what was in it.

    A URL stands without the credentials that the job's own holds.

    `ctime_ns` is the file system's own time of change, which no tool can set back; 0 for an object in a store.
    """

    path: str
    size: int
    mtime_ns: int
    ctime_ns: int = 0
    sha256: str | None = None


@dataclass(frozen=True)
class JobRecord:
    """A job's end: `basis` stands for settings, profile, known parameters and version; `seconds` is its duration.

    `estimates` holds estimate, standard deviation and status by name, `estimator` whose they are; `start_ns` and
    `log_seconds` are the first log's first stamp and the length of all logs.
    """

    job: Job
    status: End
    reason: str
    basis: str
    inputs: tuple[Input, ...]
    settings: Mapping[str, Any]
    version: str
    seconds: float = 0.0
    start_ns: int | None = None
    log_seconds: float | None = None
    estimator: str | None = None
    estimates: Mapping[str, tuple[float | None, float | None, str]] = field(default_factory=dict)


def stat_of(path: str) -> Input:
    """Size and times of change of a log; of a folder, its files' total and latest. Zeros where there is none.

    Raises
    ------
    LogError
        If it may be there and cannot be looked at.
    """
    if is_url(path):
        return Input(public(path), *object_stat(path))
    try:
        files = filter(Path.is_file, Path(path).iterdir()) if Path(path).is_dir() else [Path(path)]
        found = [file.stat() for file in files]
    except (FileNotFoundError, NotADirectoryError):
        return Input(path, 0, 0)
    except OSError as error:
        raise LogError(f"{path}: it cannot be looked at ({error.strerror}); check name and rights") from error
    mtime, ctime = (max((getattr(s, name) for s in found), default=0) for name in ("st_mtime_ns", "st_ctime_ns"))
    return Input(path, sum(s.st_size for s in found), mtime, ctime)


def hash_of(path: str) -> str | None:
    """The SHA-256 of a log on this machine; None where it cannot be had."""
    try:
        return None if is_url(path) else sha256_of(Path(path))
    except OSError:
        return None


def unchanged(before: Input, path: str) -> bool:
    """Whether the log at `path` holds what it held: by size and times of change, or by its hash where these moved.

    Raises
    ------
    LogError
        If it may be there and cannot be looked at.
    """
    now = stat_of(path)
    if replace(now, sha256=before.sha256) == before:
        return True
    return now.size == before.size and before.sha256 is not None and hash_of(path) == before.sha256


def same_logs(before: Sequence[Input], now: Sequence[Input]) -> bool:
    """Whether logs hold what they held: by their hashes where both are known, by their times of change elsewhere."""

    def same(one: Input, other: Input) -> bool:
        hashed = one.sha256 is not None and other.sha256 is not None
        marks = [(i.path, i.size, i.sha256 if hashed else i.mtime_ns) for i in (one, other)]
        return marks[0] == marks[1]

    return len(before) == len(now) and all(map(same, before, now))


def estimates_of(result: Result) -> dict[str, tuple[float | None, float | None, str]]:
    """Estimate, standard deviation and status by name."""
    return {name: (e.estimate, e.std, e.status.value) for name, e in result.estimates.items()}


def write_record(store: Store, record: JobRecord) -> None:
    """Write a record, whole or not at all. Raises `OutputError`."""
    text = json.dumps(asdict(record), ensure_ascii=False, indent=1)
    store.write(f"{FOLDER}/{record.job.name}.json", text.encode())


def read_records(store: Store) -> dict[str, JobRecord]:
    """All records by job; one that cannot be read counts as none, so that its job runs again."""
    found = {}
    for name in store.names(FOLDER):
        with suppress(ValueError, KeyError, TypeError, AttributeError, RecursionError, LogError):
            fields = json.loads(store.read(name) or b"")
            job = fields.pop("job")
            record = JobRecord(
                job=Job(**{**job, "logs": tuple(job["logs"]), "loaded": tuple(job["loaded"])}),
                status=End(fields.pop("status")),
                inputs=tuple(Input(**one) for one in fields.pop("inputs")),
                estimates={name: tuple(three) for name, three in fields.pop("estimates").items()},
                **fields,
            )
            found[record.job.name] = record
    return found


if TYPE_CHECKING:
    import polars as pl

TABLE = "jobs.parquet"
FIRST_EPOCH_NS = 10**17  # stamps before 1973 count from some start, not from 1970


def write_jobs(store: Store, records: Sequence[JobRecord]) -> None:
    """Write ``jobs.parquet``, whole or not at all. Raises `OutputError`."""
    content = io.BytesIO()
    jobs_frame(records).write_parquet(content)
    store.write(TABLE, content.getvalue())


def jobs_frame(records: Sequence[JobRecord]) -> pl.DataFrame:
    """A row a record.

    Columns: job, robot, time, status, reason, seconds, log_seconds, estimator (whose numbers these are; the one
    asked for stands in the settings), version, settings (JSON); logs, sha256, size in bytes and time of change
    (lists; a log that was fetched in part has no sha256); ``label_X`` for each label, numbers where every one is,
    text otherwise; ``k``, ``k_std`` and
    ``k_status`` for each estimate, null where there is none.
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
        "estimator": pl.Series([r.estimator for r in records], dtype=pl.String),
        "version": pl.Series([r.version for r in records], dtype=pl.String),
        "settings": pl.Series([json.dumps(r.settings, sort_keys=True) for r in records], dtype=pl.String),
        "logs": pl.Series([[i.path for i in r.inputs] for r in records], dtype=pl.List(pl.String)),
        "sha256": pl.Series([[i.sha256 for i in r.inputs] for r in records], dtype=pl.List(pl.String)),
        "size": pl.Series([[i.size for i in r.inputs] for r in records], dtype=pl.List(pl.Int64)),
        "changed": pl.Series([[i.mtime_ns for i in r.inputs] for r in records], dtype=pl.List(pl.Int64)).cast(
            pl.List(pl.Datetime("ns", "UTC"))
        ),
    }
    for name in _names([r.job.labels for r in records]):
        labels = [r.job.labels.get(name) for r in records]
        numbers = all(label is None or type(label) in (int, float) for label in labels)
        kind, dtype = (float, pl.Float64) if numbers else (str, pl.String)
        columns[f"label_{name}"] = pl.Series([None if x is None else kind(x) for x in labels], dtype=dtype)
    for name in _names([r.estimates for r in records]):
        found = [r.estimates.get(name, (None, None, None)) for r in records]
        columns[name] = pl.Series([one[0] for one in found], dtype=pl.Float64)
        columns[f"{name}_std"] = pl.Series([one[1] for one in found], dtype=pl.Float64)
        columns[f"{name}_status"] = pl.Series([one[2] for one in found], dtype=pl.String)
    return pl.DataFrame(columns)


def time_of(record: JobRecord) -> datetime | None:
    """When the job's logs were taken, in UTC: as its manifest says, or as its first stamp does."""
    if record.job.time is not None:
        taken = datetime.fromisoformat(record.job.time)
        return taken.replace(tzinfo=UTC) if taken.tzinfo is None else taken.astimezone(UTC)
    if record.start_ns is None or record.start_ns < FIRST_EPOCH_NS:
        return None
    return datetime.fromtimestamp(record.start_ns * 1e-9, UTC)


def _names(several: Sequence[Mapping[str, Any]]) -> list[str]:
    return sorted({name for one in several for name in one})
