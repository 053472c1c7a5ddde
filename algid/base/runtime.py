"""Bounds on the threads of the linear algebra.

algid multiplies small blocks: a second thread of BLAS gains nothing there and spins while it
waits, which on a busy machine makes the same products several times slower. Whole logs are what
runs side by side.

Memory that was used once is kept for the next block of a log, or the next log.

glibc hands freed arrays back to the system and takes them anew for the next ones, filled with
zeros page by page: a fifth of the processor time of short logs, an eighth of the time that `weak`
takes for a day.

Work that runs beside other work, in threads of its own where the process has cores for them.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from functools import cache
from itertools import islice
from typing import Any, Generic, TypeVar

_VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def bound_by_environment() -> None:
    """One thread for any BLAS loaded from now on, unless the user's environment differs.

    Nor are all installed packages searched for plugins of pydantic.
    """
    for variable in (*_VARIABLES, "PYDANTIC_DISABLE_PLUGINS"):
        os.environ.setdefault(variable, "1")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread for the BLAS libraries that are loaded, within the block."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
KEPT = 64 << 20
"""Bytes at the end of the heap that stay with the process."""
OWN_PAGES = 32 << 20
"""Arrays from this size on have pages of their own, which go back; the largest that glibc takes."""


@cache
def keep_freed() -> None:
    """Have this process keep freed memory, where its C library is glibc."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return
    mallopt(_MMAP_THRESHOLD, OWN_PAGES)
    mallopt(_TRIM_THRESHOLD, KEPT)


def cores() -> int:
    """Processors that this process may use; those of the machine where the system does not say."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS
        return os.cpu_count() or 1


T = TypeVar("T")

_has_other_cores = True


def keep_to_one_core() -> None:
    """Do all work of this process in the calling thread: other cores have other processes."""
    global _has_other_cores  # like BLAS's threads, a matter of the process
    _has_other_cores = False


def executor(threads: int) -> Executor:
    """Threads for work beside other work.

    Where the process keeps to one core, calls run as they are handed in.
    """
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads) if _has_other_cores else _AtOnce()


class _AtOnce(Executor):
    """Runs each call in the thread that hands it in."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(fn(*args, **kwargs))
        except Exception as error:  # handed to whoever asks for the result
            done.set_exception(error)
        return done


def ahead(source: Iterator[T]) -> Iterator[T]:
    """The same items, the next one being made in a thread of its own while the last one is used."""
    with executor(1) as pool:
        coming = pool.submit(list, islice(source, 1))
        while item := coming.result():
            coming = pool.submit(list, islice(source, 1))
            yield item[0]


class Worker(Generic[T]):
    """Work on items in a thread of its own, in order and one at a time, while they are used.

    Its ``with`` block ends once the work does. The work's exception is raised where the next item
    is handed over, or at the end of the block.
    """

    def __init__(self, work: Callable[[T], None]) -> None:
        self._work = work
        self._pool = executor(1)
        self._before: Future[None] | None = None

    def __enter__(self) -> Worker[T]:
        return self

    def push(self, item: T) -> None:
        """Hand over an item, once the work on the one before is done."""
        if self._before is not None:
            self._before.result()
        self._before = self._pool.submit(self._work, item)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._pool.shutdown()
        if kind is None and self._before is not None:
            self._before.result()


class Beside(Generic[T]):
    """A piece of work in a thread of its own, which does not keep the process alive.

    Done at once on one core.
    """

    def __init__(self, work: Callable[[], T]) -> None:
        self._work = work
        self._found: list[T] = []
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True) if _has_other_cores else None
        if self._thread is None:
            self._run()
        else:
            self._thread.start()

    def _run(self) -> None:
        try:
            self._found.append(self._work())
        except BaseException as error:  # handed to whoever asks for the result
            self._error = error

    def result(self) -> T:
        """What the work gave, once it has ended; its exception is raised here."""
        if self._thread is not None:
            self._thread.join()
        if self._error is not None:
            raise self._error
        return self._found[0]
