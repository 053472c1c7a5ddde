"""Bounds on the threads of the linear algebra, and work that runs beside other work.

algid multiplies small blocks: a second thread of BLAS gains nothing there and spins while it waits, which on a
busy machine makes the same products several times slower. Whole logs are what runs side by side.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Generic, TypeVar

_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

T = TypeVar("T")


def bound_by_environment() -> None:
    """One thread for any BLAS that is loaded from now on, unless the user's environment says otherwise."""
    for variable in _VARIABLES:
        os.environ.setdefault(variable, "1")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread for the BLAS libraries that are loaded, within the block."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


def ahead(source: Iterator[T]) -> Iterator[T]:
    """The same items, the next one being made in a thread of its own while the last one is used."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(list, islice(source, 1))
        while item := coming.result():
            coming = pool.submit(list, islice(source, 1))
            yield item[0]


def beside(source: Iterable[T], work: Callable[[T], None]) -> Iterator[T]:
    """The same items, each worked on in a thread of its own while it is used; in order, one at a time.

    Once the items are at their end, so is the work; its exception is raised here.
    """
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        before = pool.submit(lambda: None)
        for item in source:
            before.result()
            before = pool.submit(work, item)
            yield item
        before.result()


class Beside(Generic[T]):
    """A piece of work in a thread of its own; it does not keep the process alive."""

    def __init__(self, work: Callable[[], T]) -> None:
        self._work = work
        self._found: list[T] = []
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._found.append(self._work())
        except BaseException as error:  # handed to whoever asks for the result
            self._error = error

    def result(self) -> T:
        """What the work gave, once it has ended; its exception is raised here."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._found[0]
