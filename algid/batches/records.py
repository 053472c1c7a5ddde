"""Records of ended jobs: one small file each, written atomically, below ``OUT/.jobs``."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from algid.base.errors import LogError, OutputError
from algid.base.files import first_misfit, refuse_links, sha256_of, writing
from algid.base.limits import LIMITS
from algid.base.stores import Store, is_url, object_stat
from algid.batches.jobs import TABLE, Finite, Int64, Job, name_fault, redacted_path, utc_of
from algid.options import flag

FOLDER = ".jobs"
COLUMNS = (
    *("job", "robot", "time", "status", "reason", "seconds"),
    *("log_seconds", "verdict", "headline", "reasons", "command", "estimator"),
    *("version", "settings", "logs", "sha256", "size", "changed"),
)
"""Columns that every table has."""


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
    """A log as it was when the job started: size in bytes, time of change in ns, and its hash.

    A URL stands without the credentials that the job's own holds. The hash is None where it is not
    known: of an object, or of a log that could not be read.
    """

    path: str
    size: Int64
    mtime_ns: int
    sha256: str | None = None

    def same_as(self, other: Input) -> bool:
        """Whether both hold the same: by hashes if both are known, else by time of change."""
        by = "mtime_ns" if self.sha256 is None or other.sha256 is None else "sha256"
        return all(getattr(self, one) == getattr(other, one) for one in ("path", "size", by))


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
        return Input(redacted_path(path), *object_stat(path))
    files = [Path(path)]
    try:
        if files[0].is_dir():
            files = [file for file in files[0].iterdir() if file.is_file()]
        stats = [file.stat() for file in files]
    except (FileNotFoundError, NotADirectoryError):
        stats = []
    except OSError as error:
        raise LogError(
            f"{path}: it cannot be looked at ({error.strerror}); check name and rights"
        ) from error
    latest = max((one.st_mtime_ns for one in stats), default=0)
    return Input(redacted_path(path), sum(one.st_size for one in stats), latest)


def hash_of(path: str) -> str | None:
    """The SHA-256 of a log on this machine; None where it cannot be had."""
    if is_url(path):
        return None
    try:
        return sha256_of(Path(path))
    except OSError:
        return None


def unchanged(before: Input, path: str) -> Input | None:
    """The log at `path` as it is now, if it holds what it held, else None.

    It does by its size and time of change, or by its hash where the latter moved.

    Raises
    ------
    LogError
        If it may be there and cannot be looked at.
    """
    now = stat_of(path)
    if not before.same_as(now) and before.sha256 is not None and now.size == before.size:
        now = replace(now, sha256=hash_of(path))
    return replace(now, sha256=before.sha256) if before.same_as(now) else None


def record_name(job: str) -> str:
    """Where the record of a job lies in OUT."""
    return f"{FOLDER}/{job}.json"


def make_folders(store: Store) -> None:
    """Make room for records, before any job has run.

    Raises
    ------
    OutputError
        Where none can be written, or something else stands in their place.
    """
    if store.folder is None:
        return
    for name, wanted in ((FOLDER, True), (TABLE, False)):
        path = store.folder / name
        refuse_links(store.folder, f"{name}/x" if wanted else name)
        if os.path.lexists(path) and path.is_dir() != wanted:
            kind = "folder" if wanted else "file"
            raise OutputError(
                f"{path}: expected a {kind} of algid's own; move it, or choose another folder with "
                f"{flag('out')}"
            )
    with writing(store.folder / FOLDER):
        (store.folder / FOLDER).mkdir(parents=True, exist_ok=True)


def write_record(store: Store, record: JobRecord) -> None:
    """Write a record, whole or not at all. Raises `OutputError`."""
    text = json.dumps(asdict(record), ensure_ascii=False, indent=1)
    store.write(record_name(record.job.name), text.encode())


def read_records(store: Store) -> tuple[dict[str, JobRecord], dict[str, str]]:
    """All records by job, and by its place why one cannot be read.

    The latter count as none, so that their jobs run again.
    """
    records, unreadable, columns = dict[str, JobRecord](), dict[str, str](), set[str]()
    for name in store.names(FOLDER):
        if not name.endswith(".json"):
            continue
        try:
            # fields that this version does not know are left out
            record = TypeAdapter(JobRecord).validate_json(store.read(name) or b"")
        except (ValidationError, LogError) as error:
            text = first_misfit(error) if isinstance(error, ValidationError) else str(error)
            unreadable[name] = text
            continue
        named = columns | record.estimates.keys() | record.job.labels.keys()
        fault = _fault(record, name)
        if len(named) > LIMITS.columns:
            fault = f"all records together name more than {LIMITS.columns} labels and estimates"
        if fault is not None:
            unreadable[name] = fault
            continue
        columns, records[record.job.name] = named, record
    return records, unreadable


def _fault(record: JobRecord, place: str) -> str | None:
    """Why a record is invalid: no row of the table could hold it, or it is another job's."""
    job = record.job
    if name_fault(job.name) is not None or record_name(job.name) != place:
        return f"job.name: expected the job whose record lies here, found {job.name!r:.60}"
    if tuple(one.path for one in record.inputs) != job.logs + job.loaded:
        return "inputs: expected the job's own logs"
    for name in record.estimates:
        taken = name in COLUMNS or name.startswith("label_") or name.endswith(("_std", "_status"))
        if taken or not name.isprintable() or not 0 < len(name) <= LIMITS.estimate_letters:
            return "estimates: expected the names of parameters"
    try:
        utc_of(job.time or "2000-01-01")
    except ValueError:
        return f"job.time: expected ISO 8601 from 1970 to 2261, found {job.time!r:.60}"
    return None
