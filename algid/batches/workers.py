"""Worker processes of this machine that may die, hang or fail without harm to each other.

Each worker is a `concurrent.futures.ProcessPoolExecutor` of one process, tended by a thread here
that knows which call it runs: such a pool gives up as a whole when a process of it dies, without
telling whose call killed it. Calls and answers travel as bytes that are packed and unpacked here,
so that what cannot be pickled fails its own call alone.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing import connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from algid.errors import text_of
from algid.files import temporary_folder
from algid.options import flag

# One thread a worker: more would fight for the same cores.
THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "POLARS_MAX_THREADS",
    "ARROW_NUM_THREADS",
)
TOO_LONG = (
    f"it took longer than {{:g}} s; raise {flag('timeout')}, and run it again with "
    f"{flag('retry_failed')}"
)


class WorkerDiedError(Exception):
    """The process or machine that ran a call is gone.

    `kills` counts how often the call did that.
    """

    def __init__(self, how: str, kills: int = 1) -> None:
        super().__init__(how)
        self.how, self.kills = how, kills


class CallFailedError(Exception):
    """A call raised an exception, took too long, or cannot be sent; its text says which."""


class WorkersGoneError(Exception):
    """No worker can run calls any more: why, and what to do, in words."""


class Workers(Executor):
    """Calls run in fresh Python processes.

    Parameters
    ----------
    workers : how many processes
    memory_limit : bytes of data that each of them may use; None for any
    timeout : s that a call may take; None for any

    Notes
    -----
    A future fails with `WorkerDiedError` where its call's process dies, and with `CallFailedError`
    where the call raises or takes longer than `timeout`: its process is ended then, and another
    takes its place.
    """

    def __init__(
        self, workers: int, memory_limit: int | None = None, timeout: float | None = None
    ) -> None:
        self._calls: SimpleQueue[tuple[Future[Any], bytes] | None] = SimpleQueue()
        self._memory_limit, self._timeout = memory_limit, timeout
        self._running: set[_Worker] = set()
        self._ended = threading.Event()
        self._resources = ExitStack()
        self._temporary = self._resources.enter_context(temporary_folder())
        self._threads = [threading.Thread(target=self._tend, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    @property
    def pids(self) -> list[int]:
        """Process numbers of the workers that run."""
        return [
            worker.process.pid for worker in list(self._running) if worker.process.pid is not None
        ]

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` in a worker."""
        future: Future[Any] = Future()
        try:
            self._calls.put((future, packed((fn, args, kwargs))))
        except CallFailedError as error:
            future.set_exception(error)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers once their calls are done; at once with `cancel_futures`."""
        for _ in self._threads:
            self._calls.put(None)
        if cancel_futures:
            self._ended.set()
            for worker in list(self._running):
                worker.process.kill()
        if wait:
            for thread in self._threads:
                thread.join()
            self._resources.close()

    def _tend(self) -> None:
        """Feed one worker, and replace it when it is gone."""
        worker: _Worker | None = None
        while (call := self._calls.get()) is not None:
            future, packed = call
            if self._ended.is_set() or not future.set_running_or_notify_cancel():
                continue
            try:
                if worker is None:
                    worker = _Worker(self._memory_limit, self._temporary)
                    self._running.add(worker)
                    if self._ended.is_set():  # it was not yet there to be killed
                        worker.process.kill()
                future.set_result(worker.answer(packed, self._timeout))
            except (
                CallFailedError,
                WorkerDiedError,
                OSError,
            ) as error:  # OSError: no process could be started
                future.set_exception(error)
            if worker is not None and worker.gone:
                self._running.discard(worker)
                worker = None
        if worker is not None:
            worker.end()
            self._running.discard(worker)


class _Worker:
    """A pool of one process, and that process."""

    def __init__(self, memory_limit: int | None, temporary: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(1, context, _prepare, (memory_limit, temporary))
        self.gone = False
        try:
            pid = self._pool.submit(os.getpid).result()
            self.process = next(
                process for process in multiprocessing.active_children() if process.pid == pid
            )
        except (BrokenProcessPool, StopIteration) as error:
            self._pool.shutdown()
            raise WorkerDiedError("the worker ended before it began") from error

    def answer(self, packed: bytes, timeout: float | None) -> Any:
        """What the call gives.

        Raises
        ------
        CallFailedError
            If the call raises, or takes longer than `timeout`: the worker is gone then.
        WorkerDiedError
            If the worker dies.
        """
        try:
            coming = self._pool.submit(answered, packed)
            if coming not in wait([coming], timeout).done:
                self.process.kill()
                self.end()
                raise CallFailedError(TOO_LONG.format(timeout))
            return unpacked(coming.result())
        except BrokenProcessPool as error:
            self.end()
            code = self.process.exitcode or 0
            how = (
                f"was ended by {signal.Signals(-code).name}"
                if code < 0
                else f"ended with exit code {code}"
            )
            raise WorkerDiedError(f"the worker {how}") from error

    def end(self) -> None:
        """Let the process end, and wait for it."""
        self.gone = True
        self._pool.shutdown()
        self.process.join()


def _prepare(memory_limit: int | None, temporary: Path) -> None:
    """The start of a worker's life."""
    # Ctrl-C reaches the whole group; the parent decides
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before anything loads numpy
    tempfile.tempdir = str(temporary)  # the parent removes it, however this process ends
    threading.Thread(target=_die_with_parent, daemon=True).start()
    if memory_limit is None:
        return
    import resource

    import polars as pl
    import pyarrow.parquet  # noqa: F401

    pl.select(
        pl.lit(1)
    ).lazy().collect()  # a library whose threads cannot start waits for them for ever
    # Data, not address space: allocators and threads reserve far more addresses than they use.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = memory_limit if hard == resource.RLIM_INFINITY else min(memory_limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def answered(call: bytes) -> bytes:
    """Run a call; whatever it raises becomes words, and the worker lives on."""
    try:
        fn, args, kwargs = pickle.loads(call)
        return packed((True, fn(*args, **kwargs)))
    except BaseException as error:
        return pickle.dumps((False, text_of(error)))


def packed(value: Any) -> bytes:
    """A value as bytes. Raises `CallFailedError`, in words that are the same with every Python."""
    try:
        return pickle.dumps(value)
    except Exception as error:  # pickling runs the value's own code
        raise CallFailedError(f"cannot be pickled for a worker ({text_of(error)})") from error


def unpacked(answer: bytes) -> Any:
    """What `answered` gave. Raises `CallFailedError`."""
    try:
        good, content = pickle.loads(answer)
    except Exception as error:  # unpickling runs the answer's own code
        raise CallFailedError(text_of(error)) from error
    if not good:
        raise CallFailedError(content)
    return content


def _die_with_parent() -> None:
    """An orphan would go on writing beside the batch that is started next."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
