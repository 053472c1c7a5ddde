"""Logs that are still being written are left alone until their size has come to rest.

Run a batch: what is to be done is done, what comes to an end is recorded, whatever happens to the workers.
"""

from __future__ import annotations

import shutil
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import FrameType
from typing import Any

from algid.batch.job import DiskFullError, Task, ended_record, run_task
from algid.batch.jobs import Job
from algid.batch.plan import Plan, Recipe, plan
from algid.batch.records import End, Record, read_records, stat_of, write_jobs, write_record
from algid.batch.workers import WorkerDiedError
from algid.errors import OutputError
from algid.stores import FolderStore, Store

LOOK_EVERY = 2.0  # s


class Settling:
    """Tells jobs whose logs have not changed since the look before."""

    def __init__(self) -> None:
        self._before: dict[str, tuple[int, int]] = {}

    def settled(self, jobs: Sequence[Job]) -> list[Job]:
        """Those of `jobs` whose logs are as the last call saw them, and hold something."""
        now = {path: _look(path) for job in jobs for path in (*job.logs, *job.loaded)}
        before, self._before = self._before, now
        return [
            job
            for job in jobs
            if all(now[path] == before.get(path) and now[path][0] > 0 for path in (*job.logs, *job.loaded))
        ]


def _look(path: str) -> tuple[int, int]:
    seen = stat_of(path)
    return seen.size, seen.mtime_ns


MOST_KILLS = 3


@dataclass(frozen=True)
class Progress:
    """Where a batch stands: how many jobs are done of how many, and the record that came last."""

    done: int
    total: int
    last: Record


@dataclass(frozen=True)
class Ended:
    """How a batch ended: its jobs' records, how many were run now, and how many are left where it was stopped."""

    records: list[Record]
    ran: int
    left: int
    full: str | None = None


class Batch:
    """A batch on one OUT, whose lock its caller holds; `slots` bounds how many jobs are handed out at once."""

    def __init__(
        self, store: Store, recipe: Recipe, executor: Executor, slots: int, told: Callable[[Progress], None]
    ) -> None:
        self._store, self._recipe, self._executor = store, recipe, executor
        self._slots, self._told = slots, told
        self._kills: Counter[str] = Counter()
        self._full: str | None = None
        self._ran = 0
        self.stop = threading.Event()
        self.records = read_records(store)

    def run(self, jobs: Sequence[Job], retry_failed: bool = False) -> Ended:
        """Bring `jobs` to an end, and write ``jobs.parquet``.

        Jobs of earlier runs that are not among `jobs` keep their rows.
        """
        made = plan(jobs, self.records, self._recipe, self._store, retry_failed)
        self._relabel(made, {job.name: job for job in jobs})
        left = self._work(deque(made.tasks))
        self.write_table()
        ended = [self.records[job.name] for job in jobs if job.name in self.records]
        return Ended(ended, self._ran, left, self._full)

    def write_table(self) -> None:
        """Write ``jobs.parquet`` from the records."""
        try:
            write_jobs(self._store, [self.records[name] for name in sorted(self.records)])
        except OutputError as error:
            self._full = self._full or str(error)

    def _relabel(self, made: Plan, jobs: dict[str, Job]) -> None:
        for record in made.standing:
            if record.job != jobs[record.job.name]:
                self._keep(replace(record, job=jobs[record.job.name]))
        for record in made.refused:
            self._keep(record)

    def _work(self, waiting: deque[Task]) -> int:
        """Run tasks; how many are left where the batch was stopped."""
        total = len(waiting)
        running: dict[Future[Any], Task] = {}
        while running or (waiting and not self.stop.is_set()):
            while waiting and len(running) < self._slots and not self.stop.is_set():
                task = waiting.popleft()
                running[self._executor.submit(run_task, task)] = task
            done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
            if self.stop.is_set():
                waiting.extend(running.pop(future) for future in list(running) if future.cancel())
            for future in done & running.keys():
                task = running.pop(future)
                record = self._ended(task, future)
                if record is None or not self._keep(record):
                    waiting.append(task)
                else:
                    self._ran += 1
                    self._told(Progress(total - len(waiting) - len(running), total, record))
        return len(waiting)

    def _ended(self, task: Task, future: Future[Any]) -> Record | None:
        """The task's record, or None where it is to be run again."""
        try:
            record: Record = future.result()
        except WorkerDiedError as died:
            self._kills[task.job.name] += died.kills
            if self._kills[task.job.name] < MOST_KILLS:
                return None
            return ended_record(task, (), status=End.KILLED, reason=f"it took its worker with it: {died.how}")
        except DiskFullError as error:
            self._no_space(str(error))
            return None
        except Exception as error:  # the job's own fault, whatever it is: the others go on
            return ended_record(task, (), status=End.FAILED, reason=f"{type(error).__name__}: {error}"[:2000])
        return record

    def _keep(self, record: Record) -> bool:
        try:
            write_record(self._store, record)
        except OutputError as error:
            self._no_space(str(error))
            return False
        self.records[record.job.name] = record
        return True

    def _no_space(self, told: str) -> None:
        self._full = told
        self.stop.set()


@contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """The first Ctrl-C or SIGTERM sets `stop`; the second one raises `KeyboardInterrupt`."""

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
    if not isinstance(store, FolderStore):
        return
    for path in [
        *store.root.rglob(".*.algid.*"),
        *(store.root / ".jobs").rglob(".*.json.*"),
        *store.root.glob(".jobs.parquet.*"),
    ]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
