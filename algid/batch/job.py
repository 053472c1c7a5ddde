"""What a worker does with one job: identify, and tell how it ended. No log's fault leaves this file."""

from __future__ import annotations

import errno
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid import __version__
from algid.batch.fetch import naming, staged
from algid.batch.jobs import Job
from algid.batch.records import End, Input, Record, estimates_of, stat_of
from algid.errors import AlgidError
from algid.identification.identify import identify
from algid.identification.source import Staged, sha256_of
from algid.report.verdict import verdict
from algid.results import Result
from algid.runtime import keep_freed, keep_to_one_core
from algid.settings import Settings
from algid.stores import is_url, open_store, put_folder

if TYPE_CHECKING:
    from algid.profile import Profile

NO_SPACE = (errno.ENOSPC, errno.EDQUOT)


class DiskFullError(Exception):
    """There is no space left where results go: no job's fault, and reason to stop."""


@dataclass(frozen=True)
class Task:
    """A job with all that decides its outcome; travels to the worker."""

    job: Job
    basis: str
    settings: Settings
    profile: Profile | None
    parameters: Result | None
    out: str
    report: bool


def run_task(task: Task) -> Record:
    """Identify one job and write its result folder.

    Raises
    ------
    DiskFullError
        If there is no space left.
    """
    keep_freed()
    keep_to_one_core()
    start = time.perf_counter()
    inputs = tuple(stat_of(path) for path in (*task.job.logs, *task.job.loaded))
    try:
        ended = _of_result(_identified(task))
        known = ended.pop("sha256")
        inputs = tuple(replace(one, sha256=known.get(one.path)) for one in inputs)
    except (AlgidError, ValueError, ArithmeticError, LookupError, TypeError, OSError, MemoryError) as error:
        if _no_space(error):
            raise DiskFullError(str(error)) from error
        ended = {"status": End.FAILED, "reason": _reason(error)}
        inputs = tuple(_hashed(one) for one in inputs)
    return ended_record(task, inputs, seconds=time.perf_counter() - start, **ended)


def ended_record(task: Task, inputs: tuple[Input, ...], **ended: Any) -> Record:
    """The record of a task that ended so."""
    return Record(
        job=task.job,
        basis=task.basis,
        inputs=inputs,
        settings=task.settings.as_json(),
        version=__version__,
        **ended,
    )


def _identified(task: Task) -> Result:
    """Identify; what lies in an object store is fetched before and put there after."""
    with tempfile.TemporaryDirectory(prefix="algid-") as temporary:
        stage = Path(temporary)
        place = (stage if is_url(task.out) else Path(task.out)) / task.job.name
        logs = _here(task.job.logs, stage / "logs", task.profile)
        loaded = _here(task.job.loaded, stage / "loaded", task.profile)
        with naming({log.path: log.url for log in (*logs, *loaded) if isinstance(log, Staged)}):
            result = identify(
                logs,
                loaded,
                task.settings,
                parameters=task.parameters,
                profile=task.profile,
                out=place.parent,
                name=place.name,
                force=True,
                report=task.report,
                shared_library=not is_url(task.out),
            )
        if is_url(task.out):
            put_folder(open_store(task.out), f"{task.job.name}.algid", place.with_name(f"{place.name}.algid"))
        return result


def _here(paths: Sequence[str], folder: Path, profile: Profile | None) -> list[str | Staged]:
    """Logs as they can be read on this machine."""
    return [staged(path, folder / str(n), profile) if is_url(path) else path for n, path in enumerate(paths)]


def _of_result(result: Result) -> dict[str, Any]:
    judged = verdict(result)
    good = result.complete and not result.data_lost and judged.level != "failed"
    return {
        "status": End.OK if good else End.INCOMPLETE,
        "reason": "" if good else judged.sentence if judged.level == "failed" else _what_lacks(result),
        "start_ns": result.log.start_ns,
        "log_seconds": sum(log.duration for log in result.logs),
        "estimator": result.estimator,
        "estimates": estimates_of(result),
        "sha256": {log.path: log.sha256 for log in result.logs},
    }


def _what_lacks(result: Result) -> str:
    lacking = [f"{name} {e.status.value}" for name, e in result.estimates.items() if e.status.value != "OK"]
    return "; ".join([*(["samples were lost"] if result.data_lost else []), *lacking])


def _hashed(one: Input) -> Input:
    """With its sha256, where it can be had."""
    if is_url(one.path):
        return one
    try:
        return replace(one, sha256=sha256_of(Path(one.path)))
    except OSError:
        return one


def _reason(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "it needs more memory than a worker has; raise --memory-limit"
    text = str(error) if isinstance(error, AlgidError) else f"{type(error).__name__}: {error}"
    return text[:2000]


def _no_space(error: BaseException | None) -> bool:
    while error is not None:
        if (isinstance(error, OSError) and error.errno in NO_SPACE) or "No space left on device" in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False


def basis_of(settings: Mapping[str, Any], profile: Profile | None, parameters: Result | None, report: bool) -> str:
    """A hash of everything but the logs that decides a job's outcome."""
    import hashlib
    import json

    content = {
        "settings": settings,
        "profile": None if profile is None else profile.model_dump(mode="json"),
        "parameters": None if parameters is None else parameters.model_dump(mode="json"),
        "report": report,
        "version": __version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
