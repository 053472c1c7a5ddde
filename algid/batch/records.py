"""What is known of a job that has come to an end: one small file each, written whole, below ``OUT/.jobs``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from algid.batch.jobs import Job
from algid.results import Result
from algid.stores import Store, is_url, object_stat

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
    """A log as it was when the job started: size in bytes, time of change in ns, and what was in it."""

    path: str
    size: int
    mtime_ns: int
    sha256: str | None = None


@dataclass(frozen=True)
class Record:
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
    """Size and time of change of a log; of a folder, its files' total and their latest. Zeros where there is none."""
    if is_url(path):
        return Input(path, *object_stat(path))
    try:
        found = [file.stat() for file in _files(Path(path))]
    except OSError:
        return Input(path, 0, 0)
    return Input(path, sum(s.st_size for s in found), max((s.st_mtime_ns for s in found), default=0))


def _files(path: Path) -> Iterator[Path]:
    if path.is_dir():
        yield from (Path(entry) for entry in os.scandir(path) if entry.is_file())
    else:
        yield path


def estimates_of(result: Result) -> dict[str, tuple[float | None, float | None, str]]:
    """Estimate, standard deviation and status by name."""
    return {name: (e.estimate, e.std, e.status.value) for name, e in result.estimates.items()}


def write_record(store: Store, record: Record) -> None:
    """Write a record, whole or not at all. Raises `OutputError`."""
    text = json.dumps(asdict(record), ensure_ascii=False, indent=1)
    store.write(f"{FOLDER}/{record.job.name}.json", text.encode())


def read_records(store: Store) -> dict[str, Record]:
    """All records by job; one that cannot be read counts as none, so that its job runs again."""
    found = {}
    for name in store.names(FOLDER):
        record = _parsed(store.read(name) or b"")
        if record is not None:
            found[record.job.name] = record
    return found


def _parsed(content: bytes) -> Record | None:
    try:
        fields = json.loads(content)
        job = fields.pop("job")
        return Record(
            job=Job(**{**job, "logs": tuple(job["logs"]), "loaded": tuple(job["loaded"])}),
            status=End(fields.pop("status")),
            inputs=tuple(Input(**one) for one in fields.pop("inputs")),
            estimates={name: tuple(three) for name, three in fields.pop("estimates").items()},
            **fields,
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
