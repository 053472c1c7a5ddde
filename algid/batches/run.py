"""Run a batch: do every due job and record every ended one, whatever happens to workers."""

from __future__ import annotations

import errno
import fcntl
import fnmatch
import io
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from algid import __version__
from algid.base.errors import AlgidError, OutputError, text_of
from algid.base.files import refuse_links, writing
from algid.base.progress import Progress
from algid.base.staging import TEMPORARY, delete_leftovers
from algid.base.stores import Store, is_url
from algid.batches.job import Task, redacted, run_task
from algid.batches.jobs import (
    FAILURES,
    FOLDER,
    TABLE,
    Input,
    Job,
    JobRecord,
    JobStatus,
    jobs_frame,
    read_records,
    record_name,
    stat_of,
    write_record,
)
from algid.batches.workers import CallFailedError, WorkerDiedError
from algid.options import flag

LOOK_EVERY = 2.0  # s, for logs that have arrived
_STOP_EVERY = 0.1  # s, for a stop


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


@dataclass(eq=False)
class Batch:
    """A batch on one OUT, whose lock its caller holds.

    Parameters
    ----------
    store : OUT
    task_of : gives what is to be done of a job
    submit : hands a call to a worker, and gives its future
    slots : how many are handed out at once
    progress : called with each job that ends, and how many of how many have
    shared : whether other batches do other jobs of the same OUT
    """

    store: Store
    task_of: Callable[[Job], Task]
    submit: Callable[..., Future[Any]]
    slots: int
    progress: Progress | None = None
    shared: bool = False
    ran: int = 0
    written: bool = False
    """Whether the table has all records."""
    stopped: str | None = None
    stop: threading.Event = field(default_factory=threading.Event)
    """If set, `run` returns at once; running jobs are left to whoever ends the executor."""
    anew: Counter[str] = field(default_factory=Counter)
    """Jobs that had ended and were run again, by why."""

    def __post_init__(self) -> None:
        self.records, self.unreadable = read_records(self.store)
        """Why records that are there cannot be read, by their places."""

    def run(self, jobs: Sequence[Job], retry_failed: bool = False) -> Batched:
        """Bring `jobs` to an end, and write ``jobs.parquet``.

        Labels, robot and time decide nothing about a job's outcome: a record that stands takes
        over new ones. Jobs of earlier runs that are not among `jobs` keep their rows, and one of
        which it cannot be known whether its logs and results are as they were fails this time and
        keeps what is known of it.
        """
        waiting, unreachable = deque[Task](), dict[str, JobRecord]()
        for task in map(self.task_of, jobs):
            name = task.job.name
            try:
                ended = self._standing(task, retry_failed)
            except AlgidError as error:
                unreachable[name] = task.record(JobStatus.FAILED, str(error))
                continue
            if ended is None:
                waiting.append(task)
            elif ended != self.records.get(name):
                self._keep(ended)
        left = self._work(waiting)
        try:
            if not (self.written and self.store.exists(TABLE)):
                if self.shared:  # the others have come further meanwhile
                    self.records |= read_records(self.store)[0]
                content = io.BytesIO()
                jobs_frame([one for _, one in sorted(self.records.items())]).write_parquet(content)
                self.store.write(TABLE, content.getvalue())
                self.written = True
        except OutputError as error:
            self._stop_because(str(error))
        now = {**self.records, **unreachable}
        records = [now[job.name] for job in jobs if job.name in now]
        return Batched(records, self.ran, left, self.stopped, self.unreadable, self.anew)

    def watch(
        self,
        look: Callable[[], list[Job]],
        retry_failed: bool = False,
        complain: Callable[[str], object] | None = None,
    ) -> Batched:
        """Run what is found until stopped.

        Logs are taken once they are as the last look has seen them and hold something: others are
        still being written. A trouble is reported once.
        """
        ended, before, complaint = self.run([]), dict[str, Sequence[Input]](), ""
        while not self.stop.is_set():
            jobs, settled, now = list[Job](), list[Job](), dict[str, Sequence[Input]]()
            try:
                jobs = look()
            except AlgidError as error:  # a store may be away for a while
                if str(error) != complaint and complain is not None:
                    complain(str(error))
                complaint = str(error)
            for job in jobs:
                now[job.name] = ()  # whoever reads it says why it cannot be looked at
                with suppress(AlgidError):
                    now[job.name] = list(map(stat_of, self.task_of(job).files))
                held = all(one.size for one in now[job.name])
                if held and now[job.name] == before.get(job.name):
                    settled.append(job)
            if settled:
                ended, retry_failed = self.run(settled, retry_failed), False
            before = now
            self.stop.wait(LOOK_EVERY)
        return ended

    def _standing(self, task: Task, retry_failed: bool) -> JobRecord | None:
        """The record of a job that is not to be run; why one runs anew is counted.

        Raises
        ------
        AlgidError
            If it cannot be known whether logs and result are as they were.
        """
        job, record = redacted(task.job), self.records.get(task.job.name)
        if job.trouble is not None:
            return task.record(JobStatus.FAILED, job.trouble)
        if record is None:
            return None
        if retry_failed and record.status in FAILURES:
            why = "failed before"
        elif record.basis != task.basis:
            other = record.version != __version__
            why = f"of algid {record.version}" if other else "of other settings"
        elif record.has_result and not self.store.exists(f"{job.name}.algid/result.json"):
            why = "without their result"
        elif (record.job.logs, record.inputs) != (job.logs, tuple(map(stat_of, task.files))):
            why = "of other logs"
        else:
            return replace(record, job=job)
        self.anew[why] += 1
        return None

    def _work(self, waiting: deque[Task]) -> int:
        """Run tasks; how many are left where the batch was stopped."""
        total = len(waiting)
        running: dict[Future[Any], Task] = {}
        while (running or waiting) and not self.stop.is_set():
            while waiting and len(running) < self.slots:
                task = waiting.popleft()
                try:
                    future = self.submit(run_task, task)
                except Exception as error:  # a client that is closed
                    future = Future()
                    future.set_exception(error)
                running[future] = task
            for future in wait(running, _STOP_EVERY, FIRST_COMPLETED).done:
                task = running.pop(future)
                record = self._record(task, future)
                if record is None or not self._keep(record):
                    waiting.append(task)
                else:
                    self.ran += 1
                    if self.progress is not None:
                        stage = f"{record.job.name[:50]}: {record.status.value}"
                        self.progress(stage, total - len(waiting) - len(running), total)
        for future in running:
            future.cancel()
        return len(waiting) + len(running)

    def _record(self, task: Task, future: Future[Any]) -> JobRecord | None:
        """How the task ended, or None where the batch cannot go on, which is no job's fault."""
        try:
            ended = future.result()
        except Exception as error:
            ended = error
        if isinstance(ended, WorkerDiedError) or type(ended).__name__ == "KilledWorker":  # Dask's
            return task.record(JobStatus.KILLED, f"it took its worker with it: {ended!s:.80}")
        if isinstance(ended, CallFailedError):
            return task.record(JobStatus.FAILED, str(ended))
        if not isinstance(ended, JobRecord):  # no process can be started, a cluster is lost
            why = text_of(ended).removeprefix("Exception: ").partition("\n")[0]
            self._stop_because(f"no worker can run jobs ({why})")
        elif ended.verdict is None and _is_full(ended.reason):
            self._stop_because(ended.reason)
        else:
            return ended
        return None

    def _keep(self, record: JobRecord) -> bool:
        """Write a record; where its job has no result now, the one of an earlier run goes."""
        name = record.job.name
        try:
            if self.records.get(name, record).has_result and not record.has_result:
                self.store.remove(f"{name}.algid")
            write_record(self.store, record)
        except OutputError as error:
            self._stop_because(str(error))
            return False
        self.records[name] = record
        self.written = False
        self.unreadable.pop(record_name(name), None)
        return True

    def _stop_because(self, reason: str) -> None:
        remedy = "make room and run again" if _is_full(reason) else "run again"
        self.stopped = self.stopped or f"{reason}; {remedy}: what is finished is kept"
        self.stop.set()


def _is_full(text: str) -> bool:
    """Whether a text says that there was no space left: libraries have exceptions of their own."""
    return any(os.strerror(number) in text for number in (errno.ENOSPC, errno.EDQUOT))


@contextmanager
def locked(out: str, shared: bool = False) -> Iterator[None]:
    """Hold OUT, or share it with others that share it; the system lets go of it with the process.

    The file that stands for it stays: two processes that find none would lock two. Object stores
    have no locks: two batches that run on one URL at the same time do the same jobs twice, and each
    leaves a ``jobs.parquet`` of what it knows. Every object is whole all the same, and the next
    batch takes up all records.

    Raises
    ------
    OutputError
        If another batch of this machine holds it, or it cannot be made.
    """
    if is_url(out):
        yield
        return
    path = Path(out, FOLDER, "lock")
    refuse_links(Path(out), f"{FOLDER}/lock")
    with writing(out, "cannot write there"):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    try:
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise OutputError(
                f"{out}: another batch is at work there; wait for it or choose another "
                f"{flag('out')}"
            ) from error
        yield
    finally:
        os.close(handle)


@contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """Ctrl-C and SIGTERM set `stop`; signals of other threads are left to the main one."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {
        number: signal.signal(number, lambda *_: stop.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def sweep(store: Store) -> None:
    """Delete what a killed run left half-written; links are not followed."""
    if store.folder is None:
        return
    for folder, inner, names in os.walk(store.folder):
        if fnmatch.filter(inner + names, TEMPORARY):
            delete_leftovers(Path(folder))
