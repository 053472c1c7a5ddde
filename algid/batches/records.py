"""Records of ended jobs: one small file each, written atomically, below ``OUT/.jobs``."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from algid.base.errors import LogError, OutputError
from algid.base.files import refuse_links, sha256_of, writing
from algid.base.limits import LIMITS
from algid.base.stores import Store, is_url, object_stat
from algid.batches.jobs import (
    COLUMNS,
    TABLE,
    Finite,
    Int64,
    Job,
    name_fault,
    redacted_path,
    utc_of,
)
from algid.options import flag
from algid.results import Result

FOLDER = ".jobs"


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
    """A log as it was when the job started: size in bytes, times of change in ns, and its hash.

    A URL stands without the credentials that the job's own holds.

    `ctime_ns` is the file system's own time of change, which no tool can set back; 0 for an object
    in a store.
    """

    path: str
    size: Int64
    mtime_ns: int
    ctime_ns: int = 0
    sha256: str | None = None


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


def stat_of(path: str) -> Input:
    """Size and times of change of a log; of a folder, its files' total and latest.

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
        return Input(redacted_path(path), 0, 0)
    except OSError as error:
        raise LogError(
            f"{path}: it cannot be looked at ({error.strerror}); check name and rights"
        ) from error
    size = sum(one.st_size for one in stats)
    mtime = max((one.st_mtime_ns for one in stats), default=0)
    ctime = max((one.st_ctime_ns for one in stats), default=0)
    return Input(redacted_path(path), size, mtime, ctime)


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

    It does by its size and times of change, or by its hash where these moved.

    Raises
    ------
    LogError
        If it may be there and cannot be looked at.
    """
    now = replace(stat_of(path), sha256=before.sha256)
    if now == before:
        return before
    if now.size != before.size or before.sha256 is None or hash_of(path) != before.sha256:
        return None
    return now


def same_logs(before: Sequence[Input], now: Sequence[Input]) -> bool:
    """Whether logs are unchanged: by hashes if both are known, else by size and time of change."""

    def same(one: Input, other: Input) -> bool:
        if (one.path, one.size) != (other.path, other.size):
            return False
        if one.sha256 is None or other.sha256 is None:
            return one.mtime_ns == other.mtime_ns
        return one.sha256 == other.sha256

    return len(before) == len(now) and all(map(same, before, now))


def estimates_of(result: Result) -> dict[str, tuple[float | None, float | None, str]]:
    """Estimate, standard deviation and status by name."""
    return {name: (e.estimate, e.std, e.status.value) for name, e in result.estimates.items()}


def record_name(job: str) -> str:
    """Where the record of a job lies in OUT; no folder of one job's is the file of another's."""
    parts = [FOLDER]
    parts += job.split("/")
    for place, folder in enumerate(parts[:-1]):
        # x.json is the file of a job x: as a folder it is marked, and a marked one once more
        if folder.rstrip("~").endswith(".json"):
            parts[place] += "~"
    return f"{'/'.join(parts)}.json"


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


@dataclass(frozen=True)
class StoredRecords:
    """Records of earlier jobs, and why some of them cannot be read, by their places."""

    records: dict[str, JobRecord]
    unreadable: dict[str, str]


def read_records(store: Store) -> StoredRecords:
    """All records by job; one that cannot be read counts as none, so that its job runs again."""
    known = StoredRecords({}, {})
    columns: set[str] = set()
    for name in store.names(FOLDER):
        if not name.endswith(".json"):
            continue
        try:
            record = _record_in(store.read(name) or b"", name)
            named = columns | record.estimates.keys() | record.job.labels.keys()
            if len(named) > LIMITS.columns:
                raise ValueError(
                    f"all records together name more than {LIMITS.columns} labels and estimates"
                )
            columns = named
            known.records[record.job.name] = record
        except (ValueError, LogError) as error:
            known.unreadable[name] = str(error)
    return known


def _record_in(content: bytes, place: str) -> JobRecord:
    """The record that a file holds; fields that this version does not know are left out.

    Raises
    ------
    ValueError
        If it holds none, or one that no row of the table can hold.
    """
    from pydantic import TypeAdapter, ValidationError

    from algid.base.files import first_misfit

    try:
        record = TypeAdapter(JobRecord).validate_json(content)
    except ValidationError as error:
        raise ValueError(first_misfit(error)) from error
    fault = _fault(record, place)
    if fault is not None:
        raise ValueError(fault)
    return record


def _fault(record: JobRecord, place: str) -> str | None:
    """Why a record is invalid: no row of the table could hold it, or it is another job's."""
    job = record.job
    if name_fault(job.name) is not None or record_name(job.name) != place:
        return f"job.name: expected the job whose record lies here, found {job.name!r:.60}"
    if tuple(one.path for one in record.inputs) != job.logs + job.loaded:
        return "inputs: expected the job's own logs"
    if not all(map(_is_estimates, record.estimates)):
        return "estimates: expected the names of parameters"
    if job.time is not None:
        try:
            utc_of(job.time)
        except ValueError:
            return f"job.time: expected ISO 8601 from 1970 to 2261, found {job.time!r:.60}"
    return None


def _is_estimates(name: str) -> bool:
    """Whether a parameter's name is valid: its columns, with error and status, are no other's."""
    others = name in COLUMNS or name.startswith("label_") or name.endswith(("_std", "_status"))
    return 0 < len(name) <= LIMITS.estimate_letters and name.isprintable() and not others
