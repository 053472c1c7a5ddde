"""Run a batch: do every due job and record every ended one, whatever happens to workers."""

from __future__ import annotations

import fnmatch
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

from algid import __version__
from algid.base.errors import AlgidError, OutputError, SettingError, text_of
from algid.base.staging import TEMPORARY, delete_leftovers
from algid.base.stores import Store
from algid.batches.job import DiskFull, Task, basis_of, failed_record, is_full, redacted, run_task
from algid.batches.jobs import TABLE, Job
from algid.batches.records import (
    FAILURES,
    Input,
    JobRecord,
    JobStatus,
    make_folders,
    read_records,
    record_name,
    same_logs,
    stat_of,
    unchanged,
    write_record,
)
from algid.batches.table import write_jobs
from algid.batches.workers import CallFailedError, WorkerDiedError
from algid.options import flag
from algid.profile import Profile
from algid.results import Result
from algid.settings import Settings

MOST_KILLS = 3
RUN_AGAIN = "run again: what is finished is kept"
MAKE_ROOM = f"make room and {RUN_AGAIN}"
LOOK_EVERY = 2.0  # s, for logs that have arrived
_STOP_EVERY = 0.1  # s, for a stop


@dataclass(frozen=True)
class BatchConfig:
    """What all jobs of a batch share; `profile` gives the profile of a job's file, or of none."""

    out: str
    settings: Settings
    profile: Callable[[str | None], Profile | None]
    parameters: Result | None = None
    report: bool = True

    def task(self, job: Job) -> Task:
        """The job with all that decides its outcome.

        Raises
        ------
        SettingError
            Where it cannot be run so.
        """
        if job.trouble is not None:
            raise SettingError(job.trouble)
        if not job.logs and self.parameters is None:
            raise SettingError(
                f"{', '.join(job.loaded)}: a loaded log alone; add the arm's log without payload, "
                f"named {job.name}-unloaded.*, or give the arm's result as {flag('parameters')}"
            )
        return self._task(job, self.profile(job.profile))

    def refused(self, job: Job, error: SettingError) -> JobRecord:
        """The record of a job that cannot be run."""
        return failed_record(self._task(job, None), str(error))

    def _task(self, job: Job, profile: Profile | None) -> Task:
        basis = basis_of(self.settings.as_json(), profile, self.parameters, self.report)
        return Task(job, basis, self.settings, profile, self.parameters, self.out, self.report)


@dataclass(frozen=True)
class BatchPlan:
    """Tasks to run, records of jobs that cannot even start, and records that stand as they are.

    Of `unreachable` jobs an earlier end is known, and it cannot be looked at whether their logs and
    results are as they were: they fail this time, and what is known of them stays. `anew` counts
    jobs that have ended before, by why they are run again.
    """

    tasks: list[Task] = field(default_factory=list)
    refused: list[JobRecord] = field(default_factory=list)
    up_to_date: list[JobRecord] = field(default_factory=list)
    unreachable: list[JobRecord] = field(default_factory=list)
    anew: Counter[str] = field(default_factory=Counter)


def plan(
    jobs: Iterable[Job],
    records: Mapping[str, JobRecord],
    recipe: BatchConfig,
    store: Store,
    retry_failed: bool = False,
) -> BatchPlan:
    """Split jobs into those to run and those whose stored result is up to date."""
    made = BatchPlan()
    for job in jobs:
        try:
            task = recipe.task(job)
        except SettingError as error:
            made.refused.append(recipe.refused(job, error))
            continue
        record = records.get(job.name)
        try:
            up_to_date = None if record is None else _up_to_date(record, task, store, retry_failed)
        except AlgidError as error:
            made.unreachable.append(failed_record(task, str(error)))
            continue
        if isinstance(up_to_date, JobRecord):
            made.up_to_date.append(up_to_date)
            continue
        made.tasks.append(task)
        if up_to_date is not None:
            made.anew[up_to_date] += 1
    return made


def _up_to_date(record: JobRecord, task: Task, store: Store, retry_failed: bool) -> JobRecord | str:
    """The record with its job and logs as they are now, or why its job is run anew.

    Times of change that moved while the content did not are stored, so that it is hashed once
    for them.
    """
    job = redacted(task.job)
    if retry_failed and record.status in FAILURES:
        return "failed before"
    if record.basis != task.basis:
        other = record.version != __version__
        return f"of algid {record.version}" if other else "of other settings"
    if _has_result(record) and not store.exists(f"{task.job.name}.algid/result.json"):
        return "without their result"
    paths = (*task.job.logs, *task.job.loaded)
    same = (record.job.logs, record.job.loaded) == (job.logs, job.loaded)
    inputs = [unchanged(*pair) for pair in zip(record.inputs, paths, strict=True)] if same else []
    found = tuple(one for one in inputs if one is not None)
    if not found or len(found) < len(inputs):
        return "of other logs"
    return replace(record, job=job, inputs=found)


def _has_result(record: JobRecord) -> bool:
    """Whether the job left a result, be it one that must not be used."""
    return record.status not in FAILURES or record.verdict is not None


@dataclass(frozen=True)
class Progress:
    """Where a batch stands: how many jobs are done of how many, and the record that came last."""

    done: int
    total: int
    last: JobRecord


@dataclass(frozen=True)
class BatchOutcome:
    """Outcome of a batch: its jobs' records, the number run now, and the number left when stopped.

    `stopped` says why it could not go on, where it could not.
    """

    records: list[JobRecord]
    ran: int
    left: int
    stopped: str | None = None


class Batch:
    """A batch on one OUT, whose lock its caller holds.

    Parameters
    ----------
    store : OUT
    recipe : what its jobs share
    executor : who runs them
    slots : how many are handed out at once
    progress : called with each job that ends
    shared : whether other batches do other jobs of the same OUT
    """

    def __init__(
        self,
        store: Store,
        recipe: BatchConfig,
        executor: Executor,
        slots: int,
        progress: Callable[[Progress], None],
        shared: bool = False,
    ) -> None:
        self._shared = shared
        self._store, self._recipe, self._executor = store, recipe, executor
        self._slots, self._progress = slots, progress
        self._kills: Counter[str] = Counter()
        self._stopped: str | None = None
        self._ran = 0
        self._written = False
        self.stop = threading.Event()
        """If set, `run` returns at once; running jobs are left to whoever ends the executor."""
        make_folders(store)
        self.anew = Counter[str]()
        """Jobs that had ended and were run again, by why."""
        known = read_records(store)
        self.records = known.records
        self.unreadable = known.unreadable
        """Why records that are there cannot be read, by their places."""

    def run(self, jobs: Sequence[Job], retry_failed: bool = False) -> BatchOutcome:
        """Bring `jobs` to an end, and write ``jobs.parquet``.

        Labels, robot and time decide nothing about a job's outcome: a record that stands takes
        over new ones. Jobs of earlier runs that are not among `jobs` keep their rows.
        """
        made = plan(jobs, self.records, self._recipe, self._store, retry_failed)
        self.anew += made.anew
        unreachable = {record.job.name: record for record in made.unreachable}
        for record in (*made.up_to_date, *made.refused):
            if record != self.records.get(record.job.name):
                self._keep(record)
        left = self._work(deque(made.tasks))
        self._write_table()
        now = {**self.records, **unreachable}
        return BatchOutcome(
            [now[job.name] for job in jobs if job.name in now], self._ran, left, self._stopped
        )

    def _write_table(self) -> None:
        """Write ``jobs.parquet`` where it is not that of the records."""
        if self._written and self._store.exists(TABLE):
            return
        try:
            if self._shared:  # the others have come further meanwhile
                self.records |= read_records(self._store).records
            write_jobs(self._store, [self.records[name] for name in sorted(self.records)])
            self._written = True
        except OutputError as error:
            self._cannot_go_on(error)

    def _work(self, waiting: deque[Task]) -> int:
        """Run tasks; how many are left where the batch was stopped."""
        total = len(waiting)
        running: dict[Future[Any], Task] = {}
        while (running or waiting) and not self.stop.is_set():
            while waiting and len(running) < self._slots:
                task = waiting.popleft()
                running[self._executor.submit(run_task, task)] = task
            for future in wait(running, _STOP_EVERY, FIRST_COMPLETED).done:
                task = running.pop(future)
                record = self._record(task, future)
                if record is None or not self._keep(record):
                    waiting.append(task)
                else:
                    self._ran += 1
                    self._progress(Progress(total - len(waiting) - len(running), total, record))
        for future in running:
            future.cancel()
        return len(waiting) + len(running)

    def _record(self, task: Task, future: Future[Any]) -> JobRecord | None:
        """How the task ended, or None where it is to be run again."""
        try:
            ended: JobRecord | DiskFull = future.result()
        except WorkerDiedError as died:
            self._kills[task.job.name] += 1
            if self._kills[task.job.name] < MOST_KILLS:
                return None
            return failed_record(task, f"it took its worker with it: {died}", JobStatus.KILLED)
        except CallFailedError as failed:
            return failed_record(task, str(failed))
        except Exception as error:  # no job's fault: no process can be started, a cluster is lost
            self._stop_because(f"{text_of(error)}; {RUN_AGAIN}")
            return None
        if isinstance(ended, DiskFull):
            self._stop_because(f"{ended.reason}; {MAKE_ROOM}")
            return None
        return ended

    def _keep(self, record: JobRecord) -> bool:
        record = self._without_old_result(record)
        try:
            write_record(self._store, record)
        except OutputError as error:
            self._cannot_go_on(error)
            return False
        self.records[record.job.name] = record
        self.unreadable.pop(record_name(record.job.name), None)
        self._written = False
        return True

    def _without_old_result(self, record: JobRecord) -> JobRecord:
        """The record of a job.

        Where it failed and its logs are others than before, their result is removed.
        """
        before = self.records.get(record.job.name)
        if _has_result(record) or before is None or same_logs(before.inputs, record.inputs):
            return record
        try:
            self._store.remove(f"{record.job.name}.algid")
        except OutputError as error:
            return replace(
                record,
                reason=f"{record.reason}; the result of what its log held before stays: {error}",
            )
        return record

    def _cannot_go_on(self, error: OutputError) -> None:
        self._stop_because(f"{error}; {MAKE_ROOM if is_full(error) else RUN_AGAIN}")

    def _stop_because(self, reason: str) -> None:
        self._stopped = self._stopped or reason
        self.stop.set()


class StableFiles:
    """Find jobs whose logs are unchanged since the last look: others are still being written."""

    def __init__(self) -> None:
        self._before: dict[str, Input | None] = {}

    def settled(self, jobs: Sequence[Job]) -> list[Job]:
        """Those of `jobs` whose logs are as the last call saw them, and hold something."""
        now = {}
        for job in jobs:
            for path in (*job.logs, *job.loaded):
                now[path] = _seen(path)
        before, self._before = self._before, now
        still = set()
        for path, seen in now.items():
            same = path in before and seen == before[path]
            if same and (seen is None or seen.size > 0):
                still.add(path)
        return [job for job in jobs if still.issuperset((*job.logs, *job.loaded))]


def _seen(path: str) -> Input | None:
    """A log as it is now, or None where it cannot be looked at: whoever reads it says why."""
    try:
        return stat_of(path)
    except AlgidError:
        return None


@contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """Ctrl-C and SIGTERM set `stop`; signals of other threads are left to the main one."""

    def handle(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [(number, signal.signal(number, handle)) for number in numbers]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


def sweep(store: Store) -> None:
    """Delete what a killed run left half-written; links are not followed."""
    if store.folder is None:
        return
    for folder, inner, names in os.walk(store.folder):
        if fnmatch.filter(inner + names, TEMPORARY):
            delete_leftovers(Path(folder))
