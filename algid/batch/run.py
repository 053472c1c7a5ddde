"""Run a batch: what is to be done is done, what comes to an end is recorded, whatever happens to the workers."""

from __future__ import annotations

import shutil
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import FrameType
from typing import Any

from algid.batch.job import DiskFull, Task, basis_of, failed_record, run_task
from algid.batch.jobs import Job
from algid.batch.records import (
    FAILURES,
    End,
    Input,
    JobRecord,
    read_records,
    stat_of,
    unchanged,
    write_jobs,
    write_record,
)
from algid.batch.workers import CallFailedError, WorkerDiedError
from algid.errors import OutputError, SettingError, text_of
from algid.profile import Profile
from algid.results import Result
from algid.settings import Settings
from algid.stores import Store

MOST_KILLS = 3
LOOK_EVERY = 2.0  # s, for logs that have arrived
_STOP_EVERY = 0.1  # s, for a stop


@dataclass(frozen=True)
class Recipe:
    """What all jobs of a batch share; `profile` gives the profile of a job's file, or of none."""

    out: str
    settings: Settings
    profile: Callable[[str | None], Profile | None]
    parameters: Result | None = None
    report: bool = True

    def task(self, job: Job) -> Task:
        """The job with all that decides its outcome. Raises `SettingError` where it cannot be run so."""
        if not job.logs and self.parameters is None:
            raise SettingError(
                f"{', '.join(job.loaded)}: a loaded log alone; add the arm's log without payload, named "
                f"{job.name}-unloaded.*, or give the arm's result as --parameters"
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
    """Tasks to run, records of jobs that cannot even start, and records that stand as they are."""

    tasks: list[Task]
    refused: list[JobRecord]
    standing: list[JobRecord]


def plan(
    jobs: Iterable[Job], records: Mapping[str, JobRecord], recipe: Recipe, store: Store, retry_failed: bool = False
) -> BatchPlan:
    """Sort jobs by what is known of them; a job whose logs and settings are as they were is not run again."""
    made = BatchPlan([], [], [])
    for job in jobs:
        try:
            task = recipe.task(job)
        except SettingError as error:
            made.refused.append(recipe.refused(job, error))
            continue
        record = records.get(job.name)
        if record is None or (retry_failed and record.status in FAILURES) or not _stands(record, task, store):
            made.tasks.append(task)
        else:
            made.standing.append(record)
    return made


def _stands(record: JobRecord, task: Task, store: Store) -> bool:
    if record.basis != task.basis or (record.job.logs, record.job.loaded) != (task.job.logs, task.job.loaded):
        return False
    if record.status not in FAILURES and not store.exists(f"{task.job.name}.algid/result.json"):
        return False
    return bool(record.inputs) and all(map(unchanged, record.inputs))


@dataclass(frozen=True)
class Progress:
    """Where a batch stands: how many jobs are done of how many, and the record that came last."""

    done: int
    total: int
    last: JobRecord


@dataclass(frozen=True)
class Ended:
    """How a batch ended: its jobs' records, how many were run now, and how many are left where it was stopped."""

    records: list[JobRecord]
    ran: int
    left: int
    full: str | None = None


class Batch:
    """A batch on one OUT, whose lock its caller holds.

    Parameters
    ----------
    store : OUT
    recipe : what its jobs share
    executor : who runs them
    slots : how many are handed out at once
    progress : called with each job that ends
    """

    def __init__(
        self, store: Store, recipe: Recipe, executor: Executor, slots: int, progress: Callable[[Progress], None]
    ) -> None:
        self._store, self._recipe, self._executor = store, recipe, executor
        self._slots, self._progress = slots, progress
        self._kills: Counter[str] = Counter()
        self._full: str | None = None
        self._ran = 0
        self.stop = threading.Event()
        """Set it, and `run` returns at once; what was running is left to whoever ends the executor."""
        self.records = read_records(store)

    def run(self, jobs: Sequence[Job], retry_failed: bool = False) -> Ended:
        """Bring `jobs` to an end, and write ``jobs.parquet``.

        Labels, robot and time decide nothing about a job's outcome: a record that stands takes over new ones. Jobs of
        earlier runs that are not among `jobs` keep their rows.
        """
        made = plan(jobs, self.records, self._recipe, self._store, retry_failed)
        named = {job.name: job for job in jobs}
        for record in made.standing:
            if record.job != named[record.job.name]:
                self._keep(replace(record, job=named[record.job.name]))
        for record in made.refused:
            self._keep(record)
        left = self._work(deque(made.tasks))
        try:
            write_jobs(self._store, [self.records[name] for name in sorted(self.records)])
        except OutputError as error:
            self._full = self._full or str(error)
        ended = [self.records[job.name] for job in jobs if job.name in self.records]
        return Ended(ended, self._ran, left, self._full)

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
            self._kills[task.job.name] += died.kills
            if self._kills[task.job.name] < MOST_KILLS:
                return None
            return failed_record(task, f"it took its worker with it: {died.how}", End.KILLED)
        except CallFailedError as failed:
            return failed_record(task, str(failed))
        except Exception as error:  # of the executor's own: the other jobs go on
            return failed_record(task, text_of(error))
        if isinstance(ended, DiskFull):
            self._stop_for_space(ended.reason)
            return None
        return ended

    def _keep(self, record: JobRecord) -> bool:
        try:
            write_record(self._store, record)
        except OutputError as error:
            self._stop_for_space(str(error))
            return False
        self.records[record.job.name] = record
        return True

    def _stop_for_space(self, reason: str) -> None:
        self._full = reason
        self.stop.set()


class Settling:
    """Finds jobs whose logs have not changed since the look before: logs that are being written are left alone."""

    def __init__(self) -> None:
        self._before: dict[str, Input] = {}

    def settled(self, jobs: Sequence[Job]) -> list[Job]:
        """Those of `jobs` whose logs are as the last call saw them, and hold something."""
        now = {path: stat_of(path) for job in jobs for path in (*job.logs, *job.loaded)}
        before, self._before = self._before, now
        still = {path for path, seen in now.items() if seen.size > 0 and seen == before.get(path)}
        return [job for job in jobs if still.issuperset((*job.logs, *job.loaded))]


@contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """The first Ctrl-C or SIGTERM sets `stop`; a second one raises `KeyboardInterrupt`."""

    def handle(_number: int, _frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def sweep(store: Store) -> None:
    """Remove what a killed run has left half-written; nothing else may be at work on the store."""
    if store.folder is None:
        return
    for path in [
        *store.folder.rglob(".*.algid.*"),
        *(store.folder / ".jobs").rglob(".*.json.*"),
        *store.folder.glob(".jobs.parquet.*"),
    ]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
