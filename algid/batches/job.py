"""What a worker does with one job: identify, and say how it ended.

No exception leaves this file.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid import __version__
from algid.base.errors import AlgidError, LogError, text_of, without_credentials
from algid.base.files import refuse_links, sha256_of, temporary_folder
from algid.base.runtime import keep_freed, keep_to_one_core
from algid.base.stores import is_url, open_store, put_folder, reading
from algid.batches.jobs import Input, Job, JobRecord, JobStatus, redacted_path, stat_of
from algid.identification.identify import identify
from algid.identification.recordings import Staged
from algid.options import flag
from algid.readers.two_files import torque_file_of
from algid.results import Result
from algid.settings import Settings

if TYPE_CHECKING:
    from algid.profile import Profile

TOO_LARGE = f"it needs more memory than a worker has; raise {flag('memory_limit')}"
_PIECE = 1 << 23


@dataclass(frozen=True, repr=False)
class Task:
    """A job with all that decides its outcome; travels to the worker.

    It is not printed: its URLs may hold credentials, and a cluster logs what it runs.
    """

    job: Job
    settings: Settings
    out: str
    profile: Profile | None = None
    parameters: Result | None = None
    report: bool = True

    @cached_property
    def basis(self) -> str:
        """A hash of everything but the logs that decides the job's outcome."""
        prior = self.settings.prior or (self.profile and self.profile.prior)
        content = {
            "profile": self.profile and self.profile.model_dump(mode="json"),
            "parameters": self.parameters and self.parameters.model_dump(mode="json"),
            "settings": self.settings.as_json(),
            "report": self.report,
            "version": __version__,
            "prior": prior and sha256_of(Path(prior)),
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    @property
    def files(self) -> tuple[str, ...]:
        """The job's logs, and the files that the profile takes their torques from."""
        logs = self.job.logs + self.job.loaded
        name = self.profile and self.profile.torque_file
        torques = [torque_file_of(path, name) for path in logs] if name else []
        return logs + tuple(map(str, filter(None, torques)))

    def record(
        self, status: JobStatus, reason: str, inputs: tuple[Input, ...] | None = None, **known: Any
    ) -> JobRecord:
        """The job's record; `inputs` are its files as they are now by default."""
        inputs = inputs or inputs_of(self.files)
        job, settings = redacted(self.job), self.settings.as_json()
        return JobRecord(job, status, reason, self.basis, inputs, settings, __version__, **known)


def run_task(task: Task) -> JobRecord:
    """Identify one job and write its result folder.

    Whatever is raised on the way is the job's end: libraries panic by exceptions of any base.
    """
    keep_freed()
    keep_to_one_core()
    start = time.perf_counter()
    inputs = inputs_of(task.files)
    try:
        result = _identified(task)
    except BaseException as error:
        reason = TOO_LARGE if isinstance(error, MemoryError) else text_of(error)
        seconds = time.perf_counter() - start
        return task.record(JobStatus.FAILED, reason, inputs, seconds=seconds)
    judged, hashes = result.verdict, {log.path: log.sha256 for log in result.logs}
    status, reason = JobStatus.OK, ""
    lacking = ["samples were lost"] if result.data_lost else []
    for name, one in result.estimates.items():
        if not one.measured:
            lacking.append(f"{name} {one.status.value}")
    if judged.failed:
        first = [one.text for one in judged.reasons[:1]]
        status, reason = JobStatus.FAILED, " ".join([judged.sentence, *first])
    elif lacking:
        status, reason = JobStatus.INCOMPLETE, "; ".join(lacking)
    return task.record(
        status,
        reason,
        tuple(replace(one, sha256=hashes.get(one.path)) for one in inputs),
        seconds=time.perf_counter() - start,
        start_ns=result.log.start_ns,
        log_seconds=sum(log.duration for log in result.logs),
        estimator=result.estimator,
        verdict=judged.grade,
        headline=judged.headline,
        reasons=tuple(map(str, judged.reasons)),
        command=judged.command,
        estimates={
            name: (one.estimate, one.std, one.status.value)
            for name, one in result.estimates.items()
        },
    )


def redacted(job: Job) -> Job:
    """A job as records hold it: its URLs without credentials."""
    logs, loaded = (tuple(map(redacted_path, paths)) for paths in (job.logs, job.loaded))
    profile = job.profile and redacted_path(job.profile)
    return replace(job, logs=logs, loaded=loaded, profile=profile)


def inputs_of(files: Iterable[str]) -> tuple[Input, ...]:
    """A job's files as they are now, not hashed.

    One that cannot be looked at is as one that is not there: its reader says why.
    """
    found = []
    for path in files:
        try:
            found.append(stat_of(path))
        except AlgidError:
            found.append(Input(redacted_path(path), 0, 0))
    return tuple(found)


def _identified(task: Task) -> Result:
    """Identify; what lies in an object store is fetched before and put there after."""
    job, away = task.job, is_url(task.out)
    if not away:
        refuse_links(Path(task.out), job.name)
    urls = [path for path in job.logs + job.loaded if is_url(path)]
    with temporary_folder() if urls or away else nullcontext(Path()) as stage:
        place = (stage if away else Path(task.out)) / job.name
        copies = {url: fetched(url, stage / f"logs/{n}") for n, url in enumerate(urls)}
        try:
            result = identify(
                [copies.get(path, path) for path in job.logs],
                [copies.get(path, path) for path in job.loaded],
                task.settings,
                parameters=task.parameters,
                profile=task.profile,
                out=place.parent,
                name=place.name,
                force=True,
                report=task.report,
                shared_library=not away,
            )
        except AlgidError as error:  # which names the copies
            for copy in copies.values():
                error.args = (str(error).replace(str(copy.path), copy.url),)
            raise
        if away:
            name = f"{job.name}.algid"
            put_folder(open_store(task.out), name, place.with_name(f"{place.name}.algid"))
        return result


def fetched(url: str, folder: Path) -> Staged:
    """A copy of a log of an object store in `folder`.

    Requests for parts of an object tell nothing of each other: where it was replaced between two
    of them, what was fetched is of neither. Therefore it is looked at again.

    Raises
    ------
    LogError
        If there is no such object, it cannot be read, or another took its place meanwhile.
    """
    with reading(url) as (filesystem, path):
        folder.mkdir(parents=True, exist_ok=True)
        copy = folder / path.rpartition("/")[2]
        with filesystem.open_input_file(path) as source, copy.open("wb") as target:
            version = source.metadata()
            try:
                shutil.copyfileobj(source, target, _PIECE)
            finally:
                with filesystem.open_input_file(path) as again:
                    if again.metadata() != version:
                        raise LogError(f"{url}: it was replaced while it was read; run again")
    return Staged(copy, without_credentials(url))
