"""Workers that may die, hang or fail in any way without harm to each other: processes here, or a Dask cluster's.

Each worker is a `concurrent.futures.ProcessPoolExecutor` of one process, tended by a thread here that knows which call
it runs: such a pool gives up as a whole when a process of it dies, without telling whose call killed it. Calls and
answers travel as bytes that are packed and unpacked here, so that what cannot be pickled fails its own call alone.
"""

from __future__ import annotations

import ctypes
import hashlib
import multiprocessing
import os
import pickle
import signal
import socket
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from multiprocessing import connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from algid.errors import SettingError, text_of
from algid.files import temporary_folder
from algid.stores import public

# One thread a worker: more would fight for the same cores.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS", "ARROW_NUM_THREADS")
TOO_LONG = "it took longer than {:g} s; raise --timeout, and run it again with --retry-failed"
CONNECT_SECONDS = 10
LOOK_EVERY = 0.1  # s
MOST_DEATHS = 2  # the scheduler gives a task up at the next one
LAST_SECONDS = 5.0  # s that a job on a cluster has to end once it is interrupted


class WorkerDiedError(Exception):
    """The process or machine that ran a call is gone; `kills` counts how often the call did that."""

    def __init__(self, how: str, kills: int = 1) -> None:
        super().__init__(how)
        self.how, self.kills = how, kills


class CallFailedError(Exception):
    """A call raised an exception, took too long, or cannot travel: what is known of it, in words."""


class Workers(Executor):
    """Calls run in fresh Python processes.

    Parameters
    ----------
    workers : how many processes
    memory_limit : bytes of data that each of them may use; None for any
    timeout : s that a call may take; None for any

    Notes
    -----
    A future fails with `WorkerDiedError` where its call's process dies, and with `CallFailedError` where the call
    raises or takes longer than `timeout`: its process is ended then, and another takes its place.
    """

    def __init__(self, workers: int, memory_limit: int | None = None, timeout: float | None = None) -> None:
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
        return [worker.process.pid for worker in list(self._running) if worker.process.pid is not None]

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` in a worker."""
        future: Future[Any] = Future()
        try:
            self._calls.put((future, _packed((fn, args, kwargs))))
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
            except (CallFailedError, WorkerDiedError, OSError) as error:  # OSError: no process could be started
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
            self.process = next(process for process in multiprocessing.active_children() if process.pid == pid)
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
            coming = self._pool.submit(_answered, packed)
            if coming not in wait([coming], timeout).done:
                self.process.kill()
                self.end()
                raise CallFailedError(TOO_LONG.format(timeout))
            return _unpacked(coming.result())
        except BrokenProcessPool as error:
            self.end()
            code = self.process.exitcode or 0
            how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
            raise WorkerDiedError(f"the worker {how}") from error

    def end(self) -> None:
        """Let the process end, and wait for it."""
        self.gone = True
        self._pool.shutdown()
        self.process.join()


def _prepare(memory_limit: int | None, temporary: Path) -> None:
    """The start of a worker's life."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before anything loads numpy
    tempfile.tempdir = str(temporary)  # the parent removes it, however this process ends
    threading.Thread(target=_die_with_parent, daemon=True).start()
    if memory_limit is None:
        return
    import resource

    import polars as pl
    import pyarrow.parquet  # noqa: F401

    pl.select(pl.lit(1)).lazy().collect()  # a library whose threads cannot start waits for them for ever
    # Data, not address space: allocators and threads reserve far more addresses than they use.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = memory_limit if hard == resource.RLIM_INFINITY else min(memory_limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))


def _answered(packed: bytes) -> bytes:
    """Run a call; whatever it raises becomes words, and the worker lives on."""
    try:
        fn, args, kwargs = pickle.loads(packed)
        return _packed((True, fn(*args, **kwargs)))
    except BaseException as error:
        return pickle.dumps((False, text_of(error)))


def _packed(value: Any) -> bytes:
    """A value as bytes. Raises `CallFailedError`, in words that are the same with every Python."""
    try:
        return pickle.dumps(value)
    except Exception as error:  # pickling runs the value's own code
        raise CallFailedError(f"cannot be pickled for a worker ({text_of(error)})") from error


def _unpacked(packed: bytes) -> Any:
    """What `_answered` gave. Raises `CallFailedError`."""
    try:
        good, answer = pickle.loads(packed)
    except Exception as error:  # unpickling runs the answer's own code
        raise CallFailedError(text_of(error)) from error
    if not good:
        raise CallFailedError(answer)
    return answer


def _die_with_parent() -> None:
    """An orphan would go on writing beside the batch that is started next."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def cluster(address: str, out: str, timeout: float | None = None) -> Iterator[tuple[Executor, int]]:
    """The workers of a Dask cluster behind the interface of the local ones, and how many jobs to hand out at once.

    Waits for jobs of an earlier batch on `out` that was killed: their threads cannot be stopped from outside.

    Raises
    ------
    SettingError
        If ``algid[dask]`` is not installed, nothing answers at `address`, or it has no workers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise SettingError("--scheduler: Dask is not installed; pip install 'algid[dask]'") from error
    try:
        client: Any = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise SettingError(f"--scheduler {address}: no scheduler answers ({error}); start dask scheduler") from error
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise SettingError(f"--scheduler {address}: it has no workers; start dask worker {address}")
        prefix = f"algid-{hashlib.sha256(public(out).encode()).hexdigest()[:16]}-"

        def at_work(dask_worker: Any) -> bool:
            """Whether a worker, this runs on it, has a call of that batch in hand."""
            return any(str(task.key).startswith(prefix) for task in dask_worker.state.all_running_tasks)

        while any(client.run(at_work).values()):
            time.sleep(LOOK_EVERY)
        yield _Cluster(client, prefix, timeout), 2 * threads


class _Cluster(Executor):
    """Calls run on the cluster; they fail as those of `Workers` do."""

    def __init__(self, client: Any, prefix: str, timeout: float | None) -> None:
        self._client, self._prefix, self._timeout = client, prefix, timeout

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` on a worker; one that dies has the call run elsewhere."""
        from distributed.client import FutureCancelledError
        from distributed.scheduler import KilledWorker

        answer: Future[Any] = Future()
        answer.set_running_or_notify_cancel()
        packed = pickle.dumps((fn, args, kwargs))
        remote = self._client.submit(answered_within, packed, self._timeout, key=self._prefix + uuid.uuid4().hex)

        def settle(done: Any) -> None:
            try:
                answer.set_result(_unpacked(done.result()))
            except KilledWorker as error:
                answer.set_exception(WorkerDiedError(str(error).split("\n", maxsplit=1)[0], kills=MOST_DEATHS + 1))
            except (FutureCancelledError, Exception) as error:
                answer.set_exception(error)

        remote.add_done_callback(settle)
        return answer


def answered_within(packed: bytes, timeout: float | None) -> bytes:
    """`_answered` in a thread of its own, which is interrupted after `timeout` and, if it goes on, given up.

    A thread of Python cannot be ended from outside; an exception reaches it between two of its own instructions.
    """
    answers: SimpleQueue[bytes] = SimpleQueue()
    thread = threading.Thread(target=lambda: answers.put(_answered(packed)), daemon=True)
    thread.start()
    thread.join(timeout)
    if thread.is_alive():
        assert timeout is not None
        reason = TOO_LONG.format(timeout)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), ctypes.py_object(SystemExit))
        thread.join(LAST_SECONDS)
        if thread.is_alive():
            reason += f"; it still runs on {socket.gethostname()}, process {os.getpid()}: restart that worker"
        return pickle.dumps((False, reason))
    return answers.get()
