"""Records of ended jobs: one small file each, written atomically, below ``OUT/.jobs``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from algid.base.errors import LogError
from algid.base.files import first_misfit
from algid.base.stores import Store, is_url, object_stat
from algid.batches.jobs import Finite, Int64, Job, redacted_path

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
    """A log as it was when the job started: size in bytes, time of change in ns, and its hash.

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
        return Input(redacted_path(path), *object_stat(path))
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
