"""What a batch is made of: jobs, each the logs of one arm on one occasion, and how they ended.

The record of a job that has ended is one small file below ``OUT/.jobs``, written atomically.
``OUT/jobs.parquet`` has a row for each, in flat columns that SQL can ask.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError

from algid.base.errors import LogError, without_credentials
from algid.base.files import first_misfit
from algid.base.limits import LIMITS
from algid.base.stores import Store, is_url, reading

if TYPE_CHECKING:
    import polars as pl

FOLDER = ".jobs"
COLUMNS = (
    *("job", "robot", "time", "status", "reason", "seconds"),
    *("log_seconds", "verdict", "headline", "reasons", "command", "estimator"),
    *("version", "settings", "logs", "sha256", "size", "changed"),
)
"""Columns that every table has."""
_OF_LOGS = (("logs", "path"), ("sha256", "sha256"), ("size", "size"), ("changed", "mtime_ns"))
"""Columns of lists, and the field of each log."""
FIRST_EPOCH_NS = 10**17  # stamps before 1973 count from some start, not from 1970
Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
"""What a column of the table can hold."""
Label = str | Finite | Int64 | bool
Time = Annotated[str, BeforeValidator(lambda cell: utc_of(str(cell)).isoformat())]
TABLE = "jobs.parquet"
"""The table of all jobs, in OUT."""
_TAKEN = (".algid", ".json", TABLE)
"""Ends of results and records: as folders they would lie in one another."""


@dataclass(frozen=True)
class Job:
    """One identification of a batch.

    Parameters
    ----------
    name : str
        Unique in the batch; the result folder is ``OUT/NAME.algid``, so that it may hold slashes.
    logs, loaded : paths or URLs of the logs without and with payload
    profile : path of a profile, or None for the batch's
    robot : str or None
    time : ISO 8601 or None, when the logs were taken, where their stamps do not tell
    labels : anything else that is known, such as ``payload`` in kg
    trouble : str or None, why it cannot be run
    """

    name: str
    logs: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()
    profile: str | None = None
    robot: str | None = None
    time: Time | None = None
    labels: Mapping[str, Label] = field(default_factory=dict)
    trouble: str | None = None


def fit_name(name: str) -> str:
    """The name of a job, whose result and record can lie in OUT beside all others.

    Raises
    ------
    ValueError
        If they cannot.
    """
    *folders, _ = parts = name.split("/")
    sizes = [len(part.encode(errors="surrogatepass")) for part in parts]
    odd = not name.isprintable() or "\\" in name or "/." in f"/{name}"
    taken = any(folder.lower().endswith(_TAKEN) for folder in folders)
    if odd or taken or not 0 < min(sizes) <= max(sizes) <= 200 or sum(sizes) > LIMITS.name_bytes:
        raise ValueError(
            "a job's name becomes a folder's: expected parts of 1 to 200 printable characters, "
            f"{LIMITS.name_bytes} bytes in all, none starting with a dot, no folder that ends in "
            f"{' or '.join(_TAKEN)}"
        )
    return name


def safe_name(name: str) -> str:
    """A name that can stand for one that cannot: what is readable of it, and a hash."""
    digest = hashlib.sha256(name.encode(errors="surrogatepass")).hexdigest()
    return "%" + re.sub(r"[^-. \w]", "%", name[:40]) + f"~{digest[:8]}"


def redacted_path(path: str) -> str:
    """A path or URL to print and keep: without credentials, in letters that any file can hold."""
    return (
        without_credentials(path).encode(errors="surrogateescape").decode(errors="backslashreplace")
    )


def utc_of(text: str) -> datetime:
    """A time in ISO 8601 as one in UTC, which it is where it says nothing else.

    Raises
    ------
    ValueError
        If it is none, or none that stamps in int64 nanoseconds can name: from 1970 to 2261.
    """
    with suppress(ValueError, OverflowError):
        taken = datetime.fromisoformat(text)
        taken = taken.replace(tzinfo=taken.tzinfo or UTC).astimezone(UTC)
        if 1970 <= taken.year <= 2261:
            return taken
    raise ValueError("expected ISO 8601 like 2026-01-31T12:00:00Z, from 1970 to 2261")


class JobStatus(StrEnum):
    """How a job ended."""

    OK = "ok"
    INCOMPLETE = (
        "incomplete"  # a result is there, but data were lost or a parameter is not identifiable
    )
    FAILED = "failed"  # there is no result, or one that must not be used
    KILLED = "killed"  # it took its worker with it, three times


FAILURES = (JobStatus.FAILED, JobStatus.KILLED)


@dataclass(frozen=True)
class Input:
    """A log, or a file of its torques, as it was when the job started.

    Size in bytes, time of change in ns, and its hash.

    A URL stands without the credentials that the job's own holds. The hash decides nothing; it is
    None where there is no result.
    """

    path: str
    size: Int64
    mtime_ns: int
    sha256: str | None = field(default=None, compare=False)


@dataclass(frozen=True)
class JobRecord:
    """A job's end: `basis` stands for settings, profile, known parameters and version.

    `seconds` is its duration.

    `verdict` is the grade of the result, None where there is none; a job whose result must not be
    used failed. `reasons` are codes and texts, `command` is what to run first. `estimates` holds
    estimate, standard deviation and status by name, `estimator` whose they are; `start_ns` and
    `log_seconds` are the first log's first stamp and the length of all logs.
    """

    job: Job
    status: JobStatus
    reason: str
    basis: str
    inputs: tuple[Input, ...]
    settings: Mapping[str, Any]
    version: str
    seconds: Finite = 0.0
    start_ns: Int64 | None = None
    log_seconds: Finite | None = None
    estimator: str | None = None
    estimates: Mapping[str, tuple[Finite | None, Finite | None, str]] = field(default_factory=dict)
    verdict: Literal["good", "reservations", "failed"] | None = None
    headline: str | None = None
    reasons: tuple[str, ...] = ()
    command: str | None = None

    @property
    def has_result(self) -> bool:
        """Whether the job left a result, be it one that must not be used."""
        return self.status not in FAILURES or self.verdict is not None


def stat_of(path: str) -> Input:
    """Size and time of change of a log; of a folder, its files' total and latest.

    Zeros where there is none.

    Raises
    ------
    LogError
        If it may be there and cannot be looked at.
    """
    if is_url(path):
        with reading(path) as (filesystem, key):
            info = filesystem.get_file_info(key)
        found = (info.size, info.mtime_ns) if info.is_file else (0, 0)
        return Input(redacted_path(path), *found)
    files = [Path(path)]
    try:
        if files[0].is_dir():
            files = [file for file in files[0].iterdir() if file.is_file()]
        stats = [file.stat() for file in files]
    except (FileNotFoundError, NotADirectoryError, ValueError):  # a NUL in a path
        stats = []
    except OSError as error:
        raise LogError(
            f"{path}: it cannot be looked at ({error.strerror}); check name and rights"
        ) from error
    latest = max((one.st_mtime_ns for one in stats), default=0)
    return Input(redacted_path(path), sum(one.st_size for one in stats), latest)


def record_name(job: str) -> str:
    """Where the record of a job lies in OUT."""
    return f"{FOLDER}/{job}.json"


def write_record(store: Store, record: JobRecord) -> None:
    """Write a record, whole or not at all. Raises `OutputError`."""
    text = json.dumps(asdict(record), ensure_ascii=False, indent=1)
    store.write(record_name(record.job.name), text.encode())


def read_records(store: Store) -> tuple[dict[str, JobRecord], dict[str, str]]:
    """All records by job, and by its place why one cannot be read.

    The latter count as none, so that their jobs run again.
    """
    records, unreadable = dict[str, JobRecord](), dict[str, str]()
    read = TypeAdapter(JobRecord)  # leaves out fields that this version does not know
    for name in store.names(FOLDER):
        if not name.endswith(".json"):
            continue
        try:
            record = read.validate_json(store.read(name) or b"")
        except ValidationError as error:
            unreadable[name] = first_misfit(error)
        except LogError as error:
            unreadable[name] = str(error)
        else:
            if record_name(record.job.name) == name:
                records[record.job.name] = record
            else:
                unreadable[name] = f"it is that of another job, {record.job.name!r:.60}"
    return records, unreadable


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
    rows, labels, estimates = list[dict[str, Any]](), dict[str, Any](), dict[str, Any]()
    for one in records:
        row: dict[str, Any] = {**vars(one), "job": one.job.name, "robot": one.job.robot}
        row["settings"] = json.dumps(one.settings, sort_keys=True)
        start = one.start_ns or 0
        if one.job.time is not None:  # as its manifest says, or as its first stamp does
            row["time"] = utc_of(one.job.time)
        elif start >= FIRST_EPOCH_NS:
            row["time"] = datetime.fromtimestamp(start * 1e-9, UTC)
        row |= {column: [getattr(log, name) for log in one.inputs] for column, name in _OF_LOGS}
        for name, label in one.job.labels.items():
            is_text, column = isinstance(label, str | bool), f"label_{name}"
            row[column] = str(label) if is_text else label
            labels[column] = pl.String if is_text else labels.get(column, pl.Float64)
        for name, numbers in one.estimates.items():
            row |= zip((name, f"{name}_std", f"{name}_status"), numbers, strict=True)
            estimates |= {name: pl.Float64, f"{name}_std": pl.Float64, f"{name}_status": pl.String}
        rows.append(row)
    return pl.DataFrame(rows, kinds | labels | estimates, strict=False)
