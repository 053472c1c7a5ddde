"""The workers of a Dask cluster behind the interface of the local ones.

Dask runs the call of a worker that dies elsewhere, and waits without end for a worker where there
is none. Whatever is the cluster's own fault and no job's (its scheduler gone, no worker left, a
worker of another version) ends every call in hand with `WorkersGoneError`.

What runs on a worker before its version is known is sent by value: functions within functions,
which import nothing of algid but its version.
"""

from __future__ import annotations

import asyncio
import ctypes
import hashlib
import logging
import os
import pickle
import re
import socket
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from algid import __version__
from algid.batches.lock import lock_file
from algid.batches.workers import (
    TOO_LONG,
    CallFailedError,
    WorkerDiedError,
    WorkersGoneError,
    answered,
    packed,
    unpacked,
)
from algid.errors import SettingError, text_of
from algid.options import flag
from algid.stores import is_url, public, shown

CONNECT_SECONDS = 10
LOOK_EVERY = 0.1  # s, for jobs of an earlier batch
WATCH_EVERY = 1.0  # s, for what the cluster still has
PATIENCE = 60.0  # s without any worker: one that died may be started again
CLOSE_SECONDS = 5.0
ANSWER_SECONDS = (
    5.0  # s in which an answer travels; it may have been lost with its worker, and be made anew
)
MOST_DEATHS = 2  # the scheduler gives a task up at the next one
LAST_SECONDS = 5.0  # s that a job has to end once it is interrupted
TASK_SECONDS = 1.0  # s that a task should last: each costs the scheduler and the client some 13 ms
MOST_TOGETHER = 16
"""Calls of a task."""


@contextmanager
def cluster(address: str, out: str, timeout: float | None = None) -> Iterator[tuple[Executor, int]]:
    """The workers of a Dask cluster, and how many jobs to hand out at once.

    Waits for jobs of an earlier batch on `out` that was killed: their threads cannot be stopped
    from outside.

    Raises
    ------
    SettingError
        If ``algid[dask]`` is not installed, nothing answers at `address`, or it has no workers, or
        one that is of another version or does not see `out`.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise SettingError(
            f"{flag('scheduler')}: Dask is not installed; pip install 'algid[dask]'"
        ) from error
    _reach(address)
    try:
        client: Any = Client(  # type: ignore[no-untyped-call]
            address, timeout=CONNECT_SECONDS, set_as_default=False
        )
    except (OSError, ValueError) as error:
        raise SettingError(
            f"{flag('scheduler')} {address}: no scheduler answers ({error}); start dask scheduler"
        ) from error
    made = None
    loggers = {
        name: logging.getLogger(name).level for name in ("distributed", "distributed.client")
    }
    for (
        name
    ) in loggers:  # of a scheduler that is lost they have tracebacks; the batch says it in a line
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        threads = sum(client.nthreads().values())
        if not threads:
            raise SettingError(
                f"{flag('scheduler')} {address}: it has no workers; start dask worker {address}"
            )
        misfit = misfit_of(__version__, None if is_url(out) else str(lock_file(out)), shown(out))
        prefix = f"algid-{hashlib.sha256(public(out).encode()).hexdigest()[:16]}-"
        _refuse_misfits(client, misfit, address)
        _wait_for_earlier(client, prefix)
        made = ClusterExecutor(client, address, threads, prefix, misfit, timeout)
        yield made, 2 * threads * MOST_TOGETHER
    finally:
        if made is not None:
            made.end()
        with suppress(Exception):  # of a scheduler that is gone
            client.close(timeout=CLOSE_SECONDS)
        for name, level in loggers.items():
            logging.getLogger(name).setLevel(level)


_ADDRESS = re.compile(
    r"((?:tcp|tls)://)?(?P<host>\[[0-9A-Fa-f:.]+\]|[\w.-]+):(?P<port>[0-9]{1,5})", re.ASCII
)


def _reach(address: str) -> None:
    """Check that a scheduler answers: a client that fails to connect cannot be removed cleanly.

    Raises
    ------
    SettingError
        If the address is none, or no scheduler answers there in time.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None or not 0 < int(match["port"]) < 1 << 16:
        raise SettingError(
            f"{flag('scheduler')}: expected an address like tcp://HOST:8786, found {address!r:.60}"
        )
    try:
        asyncio.run(asyncio.wait_for(_greet(address), CONNECT_SECONDS))
    except Exception as error:  # whatever there is that answers something else
        reason = " ".join(str(error).split())[:200] or f"no word within {CONNECT_SECONDS} s"
        raise SettingError(
            f"{flag('scheduler')} {address}: no scheduler answers ({reason}); start dask scheduler"
        ) from error


async def _greet(address: str) -> None:
    from distributed.core import rpc

    async with rpc(address, timeout=CONNECT_SECONDS) as scheduler:  # type: ignore[no-untyped-call]
        await scheduler.identity()


def misfit_of(version: str, mark: str | None, out: str) -> Callable[[], str | None]:
    """What says on a worker why jobs must not run there, or None.

    `mark` is a file in OUT that is there meanwhile.
    """
    place = flag("out")

    def misfit() -> str | None:
        import os  # by value there is no module around it
        import socket

        try:
            from algid import __version__ as found
        except ImportError:
            return f"{socket.gethostname()}: algid is not installed there; install algid {version}"
        if found != version:
            return (
                f"{socket.gethostname()}: algid {found} stands there; install algid {version} "
                "and restart the worker"
            )
        # only what this function imports is certain to be there
        if mark is not None and not os.path.exists(mark):  # noqa: PTH110
            return (
                f"{socket.gethostname()}: it does not see {out}; choose a place with "
                f"{place} that all machines see"
            )
        return None

    return misfit


def _refuse_misfits(client: Any, misfit: Callable[[], str | None], address: str) -> None:
    answers = client.run(misfit, on_error="return")
    wrong = sorted({str(answer) for answer in answers.values() if answer is not None})
    if wrong:
        raise SettingError(f"{flag('scheduler')} {address}: worker on {'; worker on '.join(wrong)}")


def _wait_for_earlier(client: Any, prefix: str) -> None:
    def at_work(dask_worker: Any) -> bool:
        """Whether a worker, this runs on it, has a call of that batch in hand."""
        return any(str(task.key).startswith(prefix) for task in dask_worker.state.all_running_tasks)

    while any(client.run(at_work, on_error="ignore").values()):
        time.sleep(LOOK_EVERY)


@dataclass(eq=False)
class _Call:
    """A call on its way.

    `alone` once it was in a task that took workers with it, and none knows by which call.
    """

    packed: bytes
    future: Future[Any]
    alone: bool = False


class ClusterExecutor(Executor):
    """Calls run on the cluster, several in a task where they are short.

    They fail as those of `Workers` do.

    A future fails with `WorkersGoneError` where the cluster can run no calls any more.
    """

    def __init__(
        self,
        client: Any,
        address: str,
        threads: int,
        prefix: str,
        misfit: Callable[[], str | None],
        timeout: float | None,
    ) -> None:
        self._client, self._address, self._threads = client, address, threads
        self._prefix, self._timeout = prefix, timeout
        self._task = _task_unless(misfit)
        self._lock = threading.RLock()
        self._waiting: deque[_Call] = deque()
        self._sent: dict[str, tuple[Any, list[_Call]]] = {}
        self._finished: SimpleQueue[Any] = SimpleQueue()
        self._seconds = TASK_SECONDS  # that a call takes, as the last task had it
        self._gone: str | None = None
        self._ended = threading.Event()
        # Not Dask's own thread for what is finished: Python waits for that one at its end, and it
        # may wait for ever.
        for loop in (self._settle_finished, self._watch):
            threading.Thread(target=loop, daemon=True).start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` on a worker; one that dies has the call run elsewhere."""
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            call = _Call(packed((fn, args, kwargs)), future)
        except CallFailedError as error:
            future.set_exception(error)
            return future
        with self._lock:
            if self._gone is not None:
                future.set_exception(WorkersGoneError(self._gone))
            else:
                self._waiting.append(call)
                self._send()
        return future

    def end(self) -> None:
        """Send nothing more; what runs is left to the workers."""
        self._ended.set()
        self._give_up("the batch has ended")

    def _send(self) -> None:
        """Keep two tasks a thread with the scheduler: one that runs, and one that runs next."""
        while self._waiting and len(self._sent) < 2 * self._threads and self._gone is None:
            calls = self._next_calls()
            key = self._prefix + uuid.uuid4().hex
            try:
                remote = self._client.submit(
                    self._task, [call.packed for call in calls], self._timeout, key=key
                )
            except Exception as error:  # the client is closed, or cannot say what it is to send
                self._waiting.extendleft(reversed(calls))
                self._give_up(f"the scheduler takes no jobs ({text_of(error)})")
                return
            self._sent[key] = remote, calls
            remote.add_done_callback(self._finished.put)

    def _next_calls(self) -> list[_Call]:
        """Calls of the next task; fewer near the end, so that each thread has its share."""
        if self._waiting[0].alone:
            return [self._waiting.popleft()]
        share = -(-len(self._waiting) // (2 * self._threads))
        count = min(MOST_TOGETHER, max(1, int(TASK_SECONDS / self._seconds)), share)
        calls = [self._waiting.popleft()]
        while len(calls) < count and self._waiting and not self._waiting[0].alone:
            calls.append(self._waiting.popleft())
        return calls

    def _settle_finished(self) -> None:
        while True:
            self._settle(self._finished.get())

    def _settle(self, done: Any) -> None:
        """Hand the answers of a task to who waits for them."""
        from distributed import TimeoutError as DaskTimeoutError
        from distributed.scheduler import KilledWorker

        died, answers = None, list[bytes]()
        try:
            given = done.result(timeout=ANSWER_SECONDS)
            if isinstance(given, str):
                return self._give_up(f"a worker cannot run jobs: {given}")
            seconds, answers = given
        except DaskTimeoutError:
            done.add_done_callback(self._finished.put)
            return None
        except KilledWorker as error:
            died = text_of(error).partition("\n")[0]
        except BaseException as error:  # a task that is lost is cancelled, which is no Exception
            reason = text_of(error).partition("\n")[0]
            return self._give_up(f"it is gone, or has lost the jobs in hand; look at it ({reason})")
        with self._lock:
            _, calls = self._sent.pop(done.key, (None, []))
            if died is None:
                self._seconds = max(seconds / max(len(calls), 1), 1e-3)
            elif len(calls) > 1:
                self._waiting.extendleft(
                    _Call(call.packed, call.future, alone=True) for call in reversed(calls)
                )
                calls = []
            self._send()
        for place, call in enumerate(calls):
            if died is None:
                _settle_call(call.future, answers[place])
            else:
                call.future.set_exception(WorkerDiedError(died, kills=MOST_DEATHS + 1))
        return None

    def _watch(self) -> None:
        """Look whether the scheduler and a worker are there."""
        seen = time.monotonic()
        while not self._ended.wait(WATCH_EVERY):
            if self._client.status == "closed":
                return self._give_up("it is gone; start dask scheduler")
            threads = 0
            with suppress(Exception):  # it may be gone, or come again
                threads = sum(self._client.nthreads().values())
            if threads or not self._sent:
                seen, self._threads = time.monotonic(), threads or self._threads
            elif time.monotonic() - seen > PATIENCE:
                return self._give_up(
                    f"it has had no workers for {PATIENCE:g} s; start dask worker {self._address}"
                )
        return None

    def _give_up(self, reason: str) -> None:
        with self._lock:
            if self._gone is not None:
                return
            self._gone = f"{flag('scheduler')} {self._address}: {reason}"
            calls = [call for _, sent in self._sent.values() for call in sent] + list(self._waiting)
            self._sent.clear()
            self._waiting.clear()
        for call in calls:
            call.future.set_exception(WorkersGoneError(self._gone))


def _settle_call(future: Future[Any], answer: bytes) -> None:
    try:
        future.set_result(unpacked(answer))
    except CallFailedError as error:
        future.set_exception(error)


def _task_unless(misfit: Callable[[], str | None]) -> Callable[[list[bytes], float | None], Any]:
    """What runs a task's calls on a worker, unless there is a `misfit`: then that is the answer."""

    def task(calls: list[bytes], timeout: float | None) -> Any:
        wrong = misfit()
        if wrong is not None:
            return wrong
        from algid.batches.cluster import answered_in_turn

        return answered_in_turn(calls, timeout)

    return task


def answered_in_turn(calls: list[bytes], timeout: float | None) -> tuple[float, list[bytes]]:
    """Seconds that calls took, and their answers; each call has `timeout` for itself."""
    start = time.perf_counter()
    answers = [answered_within(call, timeout) for call in calls]
    return time.perf_counter() - start, answers


def answered_within(call: bytes, timeout: float | None) -> bytes:
    """`answered` in a thread of its own, interrupted after `timeout` and abandoned if it goes on.

    A thread of Python cannot be ended from outside; an exception reaches it between two of its own
    instructions.
    """
    answers: SimpleQueue[bytes] = SimpleQueue()
    thread = threading.Thread(target=lambda: answers.put(answered(call)), daemon=True)
    thread.start()
    thread.join(timeout)
    if thread.is_alive():
        assert timeout is not None
        reason = TOO_LONG.format(timeout)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(thread.ident or 0), ctypes.py_object(SystemExit)
        )
        thread.join(LAST_SECONDS)
        if thread.is_alive():
            reason += (
                f"; it still runs on {socket.gethostname()}, process {os.getpid()}: restart "
                "that worker"
            )
        return pickle.dumps((False, reason))
    return answers.get()
