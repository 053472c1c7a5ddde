"""Run a batch: do every due job and record every ended one, whatever happens to workers."""

from __future__ import annotations

import fnmatch
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

from algid import __version__
from algid.base.errors import AlgidError, OutputError, SettingError, text_of
from algid.base.staging import TEMPORARY, delete_leftovers
from algid.base.stores import Store
from algid.batches.job import Task, is_full, redacted, run_task
from algid.batches.jobs import TABLE, Job
from algid.batches.records import (
    FAILURES,
    Input,
    JobRecord,
    JobStatus,
    make_folders,
    read_records,
    record_name,
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


@dataclass(frozen=True)
class Batched:
    """How a batch ended.

    Parameters
    ----------
    records : of its jobs, each with name, status and the reason of a failure
    ran, left : how many were run now, and how many are left where it was stopped
    stopped : why it could not go on, where it could not
    unreadable : why records that are there cannot be read, by their places
    anew : how many jobs that had ended were run again, by why
    out : where results and ``jobs.parquet`` are, less what opens it
    interrupted : whether it was stopped by a signal
    links : to folders, that were passed over
    """

    records: list[JobRecord]
    ran: int
    left: int
    stopped: str | None = None
    unreadable: Mapping[str, str] = field(default_factory=dict)
    anew: Mapping[str, int] = field(default_factory=dict)
    out: str = ""
    interrupted: bool = False
    links: Sequence[str] = ()

    @property
    def failed(self) -> list[JobRecord]:
        """Jobs without a result, or with one that must not be used."""
        return [record for record in self.records if record.status in FAILURES]

    @property
    def counts(self) -> dict[str, int]:
        """Jobs by status, those there are."""
        counts = Counter(record.status for record in self.records)
        return {end.value: counts[end] for end in JobStatus if end in counts}


class Batch:
    """A batch on one OUT, whose lock its caller holds.

    Parameters
    ----------
    store : OUT
    recipe : what its jobs share
    executor : who runs them
    slots : how many are handed out at once
    progress : called with the record of each job that ends, and how many of how many have
    shared : whether other batches do other jobs of the same OUT
    """

    def __init__(
        self,
        store: Store,
        recipe: BatchConfig,
        executor: Executor,
        slots: int,
        progress: Callable[[JobRecord, int, int], object],
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
        self.records, self.unreadable = read_records(store)
        """Why records that are there cannot be read, by their places."""

    def run(self, jobs: Sequence[Job], retry_failed: bool = False) -> Batched:
        """Bring `jobs` to an end, and write ``jobs.parquet``.

        Labels, robot and time decide nothing about a job's outcome: a record that stands takes
        over new ones. Jobs of earlier runs that are not among `jobs` keep their rows, and one of
        which it cannot be known whether its logs and results are as they were fails this time and
        keeps what is known of it.
        """
        waiting, unreachable = deque[Task](), dict[str, JobRecord]()
        for job in jobs:
            before, trouble, of = self.records.get(job.name), job.trouble, self._recipe
            profile = None
            try:
                if trouble is None:
                    profile = of.profile(job.profile)
            except SettingError as error:
                trouble = str(error)
            task = Task(job, of.settings, profile, of.parameters, of.out, of.report)
            if not (job.logs or of.parameters or trouble):
                trouble = (
                    f"{', '.join(job.loaded)}: a loaded log alone; add the arm's log without "
                    f"payload, named {job.name}-unloaded.*, or give the arm's result as "
                    f"{flag('parameters')}"
                )
            if trouble is not None:
                ended = task.record(JobStatus.FAILED, trouble)
            elif before is None:
                waiting.append(task)
                continue
            else:
                try:
                    known = self._up_to_date(before, task, retry_failed)
                except AlgidError as error:
                    unreachable[job.name] = task.record(JobStatus.FAILED, str(error))
                    continue
                if not isinstance(known, JobRecord):
                    self.anew[known] += 1
                    waiting.append(task)
                    continue
                ended = known
            if ended != before:
                self._keep(ended)
        left = self._work(waiting)
        try:
            if not (self._written and self._store.exists(TABLE)):
                if self._shared:  # the others have come further meanwhile
                    self.records |= read_records(self._store)[0]
                write_jobs(self._store, [self.records[name] for name in sorted(self.records)])
                self._written = True
        except OutputError as error:
            self._cannot_go_on(error)
        now = {**self.records, **unreachable}
        records = [now[job.name] for job in jobs if job.name in now]
        return Batched(records, self._ran, left, self._stopped, self.unreadable, self.anew)

    def watch(
        self,
        look: Callable[[], list[Job]],
        retry_failed: bool = False,
        complain: Callable[[str], object] | None = None,
    ) -> Batched:
        """Run what is found until stopped.

        Nothing but settled logs are taken, and a trouble is reported once.
        """
        settling, complaint = StableFiles(), ""
        ended = self.run([])
        while not self.stop.is_set():
            jobs = list[Job]()
            try:
                jobs = settling.settled(look())
            except AlgidError as error:  # a store may be away for a while
                if str(error) != complaint and complain is not None:
                    complain(str(error))
                complaint = str(error)
            if jobs:
                ended, retry_failed = self.run(jobs, retry_failed), False
            self.stop.wait(LOOK_EVERY)
        return ended

    def _up_to_date(self, record: JobRecord, task: Task, retry_failed: bool) -> JobRecord | str:
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
        if record.has_result and not self._store.exists(f"{job.name}.algid/result.json"):
            return "without their result"
        if (record.job.logs, record.job.loaded) != (job.logs, job.loaded):
            return "of other logs"
        found = list[Input]()
        for before, path in zip(record.inputs, task.job.logs + task.job.loaded, strict=True):
            now = unchanged(before, path)
            if now is None:
                return "of other logs"
            found.append(now)
        return replace(record, job=job, inputs=tuple(found))

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
                    self._progress(record, total - len(waiting) - len(running), total)
        for future in running:
            future.cancel()
        return len(waiting) + len(running)

    def _record(self, task: Task, future: Future[Any]) -> JobRecord | None:
        """How the task ended, or None where it is to be run again."""
        try:
            ended: JobRecord | str = future.result()
        except WorkerDiedError as died:
            self._kills[task.job.name] += 1
            if self._kills[task.job.name] < MOST_KILLS:
                return None
            return task.record(JobStatus.KILLED, f"it took its worker with it: {died}")
        except CallFailedError as failed:
            return task.record(JobStatus.FAILED, str(failed))
        except Exception as error:  # no job's fault: no process can be started, a cluster is lost
            self._stop_because(f"{text_of(error)}; {RUN_AGAIN}")
            return None
        if isinstance(ended, JobRecord):
            return ended
        self._stop_because(f"{ended}; {MAKE_ROOM}")
        return None

    def _keep(self, record: JobRecord) -> bool:
        """Write a record; where its job failed on other logs than before, their result goes."""
        before = self.records.get(record.job.name)
        if before is not None and not record.has_result:
            pairs = zip(before.inputs, record.inputs, strict=False)
            same = len(before.inputs) == len(record.inputs)
            try:
                if not (same and all(one.same_as(other) for one, other in pairs)):
                    self._store.remove(f"{record.job.name}.algid")
            except OutputError as error:
                stays = f"; the result of what its log held before stays: {error}"
                record = replace(record, reason=record.reason + stays)
        try:
            write_record(self._store, record)
        except OutputError as error:
            self._cannot_go_on(error)
            return False
        self.records[record.job.name] = record
        self.unreadable.pop(record_name(record.job.name), None)
        self._written = False
        return True

    def _cannot_go_on(self, error: OutputError) -> None:
        self._stop_because(f"{error}; {MAKE_ROOM if is_full(error) else RUN_AGAIN}")

    def _stop_because(self, reason: str) -> None:
        self._stopped = self._stopped or reason
        self.stop.set()


class StableFiles:
    """Find jobs whose logs are unchanged since the last look: others are still being written."""

    def __init__(self) -> None:
        self._before: dict[str, list[Input] | None] = {}

    def settled(self, jobs: Sequence[Job]) -> list[Job]:
        """Those of `jobs` whose logs are as the last call saw them, and hold something."""
        before, self._before, still = self._before, {}, []
        for job in jobs:
            now = None
            with suppress(AlgidError):  # whoever reads it says why it cannot be looked at
                now = list(map(stat_of, job.logs + job.loaded))
            self._before[job.name] = now
            held = now is None or all(one.size for one in now)
            if held and job.name in before and before[job.name] == now:
                still.append(job)
        return still


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
