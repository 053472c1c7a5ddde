"""What a worker does with one job: identify, and say how it ended.

No exception leaves this file.
"""

from __future__ import annotations

import errno
import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid import __version__
from algid.base.errors import AlgidError, chain_of, text_of
from algid.base.files import refuse_links, temporary_folder
from algid.base.runtime import keep_freed, keep_to_one_core
from algid.base.stores import is_url, open_store, put_folder
from algid.batches.fetch import errors_name_url, staged
from algid.batches.jobs import Job, redacted_path
from algid.batches.records import Input, JobRecord, JobStatus, estimates_of, hash_of, stat_of
from algid.identification.identify import identify
from algid.identification.open_logs import Staged
from algid.options import flag
from algid.results import Result
from algid.settings import Settings

if TYPE_CHECKING:
    from algid.base.verdict import Verdict
    from algid.profile import Profile

NO_SPACE = {errno.ENOSPC, errno.EDQUOT}
NO_SPACE_LEFT = "No space left on device"  # what libraries say that raise exceptions of their own
TOO_LARGE = f"it needs more memory than a worker has; raise {flag('memory_limit')}"


@dataclass(frozen=True)
class DiskFull:
    """There is no space left where results go: no job's fault, and reason to stop."""

    reason: str


@dataclass(frozen=True, repr=False)
class Task:
    """A job with all that decides its outcome; travels to the worker.

    It is not printed: its URLs may hold credentials, and a cluster logs what it runs.
    """

    job: Job
    basis: str
    settings: Settings
    profile: Profile | None
    parameters: Result | None
    out: str
    report: bool


def run_task(task: Task) -> JobRecord | DiskFull:
    """Identify one job and write its result folder.

    Whatever is raised on the way is the job's end: libraries panic by exceptions of any base.
    """
    keep_freed()
    keep_to_one_core()
    start = time.perf_counter()
    inputs = inputs_of(task.job)
    try:
        result = _identified(task)
    except BaseException as error:
        if is_full(error):
            return DiskFull(text_of(error))
        reason = TOO_LARGE if isinstance(error, MemoryError) else text_of(error)
        inputs = tuple(replace(one, sha256=hash_of(one.path)) for one in inputs)
        return failed_record(task, reason, inputs=inputs, seconds=time.perf_counter() - start)
    judged = result.verdict
    status, reason = _end(result)
    hashes = {log.path: log.sha256 for log in result.logs}
    return _record(
        task,
        inputs=tuple(replace(one, sha256=hashes.get(one.path)) for one in inputs),
        status=status,
        reason=reason,
        seconds=time.perf_counter() - start,
        start_ns=result.log.start_ns,
        log_seconds=sum(log.duration for log in result.logs),
        estimator=result.estimator,
        verdict=judged.grade,
        headline=judged.headline,
        reasons=tuple(f"{one.code}: {one.sentence}" for one in judged.reasons),
        command=judged.command,
        estimates=estimates_of(result),
    )


def _end(result: Result) -> tuple[JobStatus, str]:
    """How a job that gave a result ended, and why, where all is not well."""
    if result.verdict.failed:
        return JobStatus.FAILED, _first_reason(result.verdict)
    lacking = []
    if result.data_lost:
        lacking.append("samples were lost")
    for name, one in result.estimates.items():
        if not one.measured:
            lacking.append(f"{name} {one.status.value}")
    if lacking:
        return JobStatus.INCOMPLETE, "; ".join(lacking)
    return JobStatus.OK, ""


def _first_reason(judged: Verdict) -> str:
    """Why a result must not be used."""
    reason = judged.sentence
    if judged.reasons and judged.reasons[0].text not in reason:
        reason += f" {judged.reasons[0].text}"
    return reason


def is_full(error: BaseException) -> bool:
    """Whether there was no space left, as an exception or what it came from says."""
    chain = list(chain_of(error))
    numbers = {one.errno for one in chain if isinstance(one, OSError)}
    return not numbers.isdisjoint(NO_SPACE) or any(NO_SPACE_LEFT in text_of(one) for one in chain)


def failed_record(
    task: Task, reason: str, status: JobStatus = JobStatus.FAILED, **known: Any
) -> JobRecord:
    """The record of a task without result; `known` are other fields of it."""
    known.setdefault("inputs", inputs_of(task.job))
    return _record(task, status=status, reason=reason, **known)


def redacted(job: Job) -> Job:
    """A job as records hold it: its URLs without credentials."""
    profile = job.profile
    if profile is not None:
        profile = redacted_path(profile)
    return replace(
        job,
        logs=tuple(map(redacted_path, job.logs)),
        loaded=tuple(map(redacted_path, job.loaded)),
        profile=profile,
    )


def _record(task: Task, **known: Any) -> JobRecord:
    return JobRecord(
        job=redacted(task.job),
        basis=task.basis,
        settings=task.settings.as_json(),
        version=__version__,
        **known,
    )


def inputs_of(job: Job) -> tuple[Input, ...]:
    """The job's logs as they are now, not hashed."""
    return tuple(map(_looked_at, job.logs + job.loaded))


def _looked_at(path: str) -> Input:
    """A log as it is now.

    As one that is not there where it cannot be looked at: its reader says why.
    """
    try:
        return stat_of(path)
    except AlgidError:
        return Input(redacted_path(path), 0, 0)


def _identified(task: Task) -> Result:
    """Identify; what lies in an object store is fetched before and put there after."""
    paths = task.job.logs + task.job.loaded + (task.out,)
    away = is_url(task.out)
    if not away:
        refuse_links(Path(task.out), task.job.name)
    with temporary_folder() if any(map(is_url, paths)) else nullcontext(Path()) as stage:
        place = (stage if away else Path(task.out)) / task.job.name
        logs = _fetched(task.job.logs, stage / "logs")
        loaded = _fetched(task.job.loaded, stage / "loaded")
        with errors_name_url(
            {log.path: log.url for log in logs + loaded if isinstance(log, Staged)}
        ):
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
                shared_library=not away,
            )
        if away:
            put_folder(
                open_store(task.out),
                f"{task.job.name}.algid",
                place.with_name(f"{place.name}.algid"),
            )
        return result


def _fetched(paths: Sequence[str], folder: Path) -> list[str | Staged]:
    """Logs as they can be read on this machine."""
    here: list[str | Staged] = []
    for number, path in enumerate(paths):
        if is_url(path):
            here.append(staged(path, folder / str(number)))
        else:
            here.append(path)
    return here


def basis_of(
    settings: Mapping[str, Any], profile: Profile | None, parameters: Result | None, report: bool
) -> str:
    """A hash of everything but the logs that decides a job's outcome."""
    content = {
        "settings": settings,
        "profile": _content(profile),
        "parameters": _content(parameters),
        "report": report,
        "version": __version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _content(one: Profile | Result | None) -> dict[str, Any] | None:
    """A profile or a result as JSON holds it."""
    if one is None:
        return None
    return one.model_dump(mode="json")
