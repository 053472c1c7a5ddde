"""Worker processes that may die: each has a thread here that knows which call it runs.

`concurrent.futures.ProcessPoolExecutor` gives up as a whole when one process dies, without telling whose call
killed it. Here the one call fails with `WorkerDiedError`, and a new process takes the dead one's place.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from typing import Any

# One thread a worker: more would fight for the same cores.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS", "ARROW_NUM_THREADS")

_Call = tuple["Future[Any]", Callable[..., Any], tuple[Any, ...], dict[str, Any]]


class WorkerDiedError(Exception):
    """The process or machine that ran a call is gone; `kills` counts how often the call did that."""

    def __init__(self, how: str, kills: int = 1) -> None:
        super().__init__(how)
        self.how, self.kills = how, kills


class Processes(Executor):
    """Calls run in `workers` fresh Python processes, each bounded to `memory_limit` bytes of data."""

    def __init__(self, workers: int, memory_limit: int | None = None) -> None:
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._memory_limit = memory_limit
        self._context = multiprocessing.get_context("spawn")
        self._running: set[BaseProcess] = set()
        self._starting = threading.Lock()
        self._killed = False
        self._threads = [threading.Thread(target=self._tend, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    @property
    def pids(self) -> list[int]:
        """Process numbers of the workers that run."""
        return [process.pid for process in list(self._running) if process.pid is not None]

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` in a worker; the future fails with `WorkerDiedError` where that dies."""
        future: Future[Any] = Future()
        self._calls.put((future, fn, args, kwargs))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers once their calls are done; at once with `cancel_futures`."""
        for _ in self._threads:
            self._calls.put(None)
        if cancel_futures:
            self._killed = True
            for process in list(self._running):
                process.kill()
        if wait:
            for thread in self._threads:
                thread.join()

    def _tend(self) -> None:
        """Feed one worker, and replace it when it dies."""
        worker: tuple[BaseProcess, Connection] | None = None
        while (call := self._calls.get()) is not None:
            future, *work = call
            if self._killed or not future.set_running_or_notify_cancel():
                continue
            worker = worker or self._start()
            if not _answered(worker, future, work):
                self._end(worker)
                worker = None
        if worker is not None:
            self._end(worker)

    def _start(self) -> tuple[BaseProcess, Connection]:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, self._memory_limit), daemon=True)
        with self._starting:  # a child inherits the environment of the moment it starts
            before = {name: os.environ.get(name) for name in THREADS}
            os.environ.update(dict.fromkeys(THREADS, "1"))
            try:
                process.start()
            finally:
                for name, value in before.items():
                    os.environ.pop(name) if value is None else os.environ.update({name: value})
        theirs.close()
        self._running.add(process)
        return process, ours

    def _end(self, worker: tuple[BaseProcess, Connection]) -> None:
        process, ours = worker
        ours.close()
        process.join()
        self._running.discard(process)


def _answered(worker: tuple[BaseProcess, Connection], future: Future[Any], work: list[Any]) -> bool:
    """Whether the worker has done its work and lives."""
    process, ours = worker
    try:
        ours.send(work)
        good, answer = ours.recv()
    except (EOFError, OSError):
        process.join()
        future.set_exception(WorkerDiedError(_how(process.exitcode)))
        return False
    if good:
        future.set_result(answer)
    else:
        future.set_exception(answer)
    return True


def _how(code: int | None) -> str:
    if code is None or code >= 0:
        return f"the worker ended with exit code {code}"
    return f"the worker was ended by {signal.Signals(-code).name}"


def _serve(calls: Connection, memory_limit: int | None) -> None:
    """A worker's life: calls in, answers out, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    if memory_limit is not None:
        _bound_memory(memory_limit)
    while True:
        try:
            fn, args, kwargs = calls.recv()
        except (EOFError, OSError):
            return
        calls.send(_outcome(fn, args, kwargs))


def _outcome(fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[bool, Any]:
    try:
        return True, fn(*args, **kwargs)
    except Exception as error:
        error.__traceback__ = None
        return False, error


def _die_with_parent() -> None:
    """An orphan would go on writing beside the batch that is started next."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _bound_memory(limit: int) -> None:
    import resource

    import polars as pl
    import pyarrow.parquet  # noqa: F401

    pl.select(pl.lit(1)).lazy().collect()  # a library whose threads cannot start waits for them for ever
    # Data, not address space: allocators and threads reserve far more addresses than they use.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
