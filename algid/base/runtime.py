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
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from itertools import islice
from typing import TypeVar

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


def beside(work: Callable[[], T]) -> Future[T]:
    """A piece of work in a thread of its own, which does not keep the process alive.

    Done at once on one core.
    """
    done: Future[T] = Future()

    def settle() -> None:
        try:
            done.set_result(work())
        except BaseException as error:  # handed to whoever asks for the result
            done.set_exception(error)

    if _has_other_cores:
        threading.Thread(target=settle, daemon=True).start()
    else:
        settle()
    return done


def ahead(source: Iterator[T]) -> Iterator[T]:
    """The same items, the next one being made in a thread of its own while the last one is used.

    On one core each is made when it is asked for.
    """
    if not _has_other_cores:
        yield from source
        return
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(list, islice(source, 1))
        while item := coming.result():
            coming = pool.submit(list, islice(source, 1))
            yield item[0]
