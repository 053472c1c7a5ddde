"""Worker processes of this machine: a crash, a hang or a lack of memory ends one call alone.

Each slot is a thread with a process of its own, ``python -m algid.batches.workers``, which imports
nothing of the caller's ``__main__``. Calls and answers travel over a pipe, and so do the notes of
the worker to its guard.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection, Pipe
from typing import Any

from algid.base.errors import text_of
from algid.guard import BREAKING, Notes, begin
from algid.options import flag

THREADS = (
    *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"),
    *("POLARS_MAX_THREADS", "ARROW_NUM_THREADS"),
)
"""One thread a worker: more would fight for the same cores."""
MOST_KILLS = 3
TOO_LONG = (
    f"it took longer than {{:g}} s; raise {flag('timeout')}, and run it again with "
    f"{flag('retry_failed')}"
)


class CallFailedError(Exception):
    """A call raised an exception, took too long or broke its process; its text says which."""


class WorkerDiedError(CallFailedError):
    """Every process that ran the call is gone, and it is not known that the call was at fault."""


class Workers(ThreadPoolExecutor):
    """Calls run in fresh Python processes; one that dies is replaced.

    Parameters
    ----------
    workers : how many processes
    memory_limit : bytes of data that each may use; None for the guard's own bound
    timeout : s that a call may take; None for any

    Notes
    -----
    A call whose process is killed runs in another, `MOST_KILLS` times at most: then its future
    fails with `WorkerDiedError`. It does with `CallFailedError` where the call raises, breaks its
    process, or takes longer than `timeout`.
    """

    def __init__(
        self, workers: int, memory_limit: int | None = None, timeout: float | None = None
    ) -> None:
        super().__init__(workers)
        self._timeout = min(timeout or 1e6, 1e6)  # poll() takes no longer one
        self._slot = threading.local()  # each thread's own process and pipe
        self._started = list[subprocess.Popen[bytes]]()
        self._stopped = False
        self._arguments = [str(os.getpid()), str(memory_limit or 0)]
        paths = os.pathsep.join(map(os.path.abspath, sys.path))
        self._environment = {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": paths}

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:  # type: ignore[override]
        """Run ``fn(*args)`` in a worker."""
        return super().submit(self._answer, (fn, args))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """End the workers at once, whatever they do."""
        self._stopped = True
        for process in self._started:
            process.kill()
        super().shutdown(wait, cancel_futures=cancel_futures)
        for process in self._started:
            process.wait()

    def _start(self) -> None:
        self._slot.pipe, theirs = Pipe()
        with theirs:
            self._slot.process = subprocess.Popen(
                [sys.executable, "-P", "-m", __name__, str(theirs.fileno()), *self._arguments],
                env=self._environment,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        self._started.append(self._slot.process)
        if self._stopped:  # it was not yet there to be killed
            self._slot.process.kill()

    def _answer(self, call: tuple[Any, ...], kills: int = 1) -> Any:
        """What a call gives in this thread's process."""
        slot, notes, reason = self._slot, Notes(), None
        try:
            if getattr(slot, "process", None) is None:
                self._start()
                slot.pipe.recv()  # the time of imports is not the call's
            slot.pipe.send(call)
            end = time.monotonic() + self._timeout
            while slot.pipe.poll(max(0.0, end - time.monotonic())):
                told = slot.pipe.recv()
                if isinstance(told, str):
                    notes.take(told)
                    continue
                good, content = told
                if good:
                    return content
                raise CallFailedError(content)
            slot.process.kill()
            reason = TOO_LONG.format(self._timeout)
        except (EOFError, ConnectionError):
            pass
        number = -slot.process.wait()
        slot.process = None
        notes.remove_unfinished()
        if number in (signal.SIGPROF, *BREAKING):
            reason = notes.end(number)[1]
        if reason is not None:
            raise CallFailedError(reason)
        if kills < MOST_KILLS and not self._stopped:
            return self._answer(call, kills + 1)
        how = f"exit code {-number}" if number <= 0 else signal.Signals(number).name
        raise WorkerDiedError(f"the worker was ended by {how}")


def serve() -> None:
    """Answer the calls that come over a pipe until it is closed."""
    number, parent, memory = map(int, sys.argv[1:])
    pipe, lock = Connection(number), threading.Lock()
    if memory:  # a library whose threads cannot start waits for them for ever
        import polars as pl
        import pyarrow.parquet  # noqa: F401

        pl.select(pl.lit(1)).lazy().collect()

    def send(value: object) -> None:
        with lock:  # notes come from every thread
            pipe.send(value)

    begin(send, parent, memory or None)
    send((True, None))
    while True:
        call = pipe.recv_bytes()
        try:
            fn, args = pickle.loads(call)
            send((True, fn(*args)))
        except BaseException as error:  # whatever a call raises becomes words
            send((False, text_of(error)))


if __name__ == "__main__":
    serve()
