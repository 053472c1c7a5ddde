"""Jobs on the workers of a Dask cluster, which sees to their retries and to workers that die.

A worker runs a job as this machine does: in a process of its own, so that a crash, a hang or a lack
of memory ends that job alone.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import socket
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from algid import __version__
from algid.base.errors import OutputError, SettingError
from algid.base.runtime import cores
from algid.batches.workers import Workers
from algid.options import flag

SECONDS = 10  # for a scheduler to answer


def job_of(version: str) -> Callable[[bytes], Any]:
    """What runs on a worker: sent by value, it knows the version before it unpickles a call.

    It gives what the call does, or an exception: one that it raised would be logged there with its
    arguments, whose URLs may hold credentials.
    """

    def job(call: bytes) -> Any:
        import pickle
        import socket

        try:
            from algid import __version__ as found
        except ImportError:
            found = "none"
        if found != version:
            return Exception(f"{socket.gethostname()} has algid {found}; install algid {version}")
        from algid.batches.cluster import run_here

        return run_here(*pickle.loads(call))

    return job


def run_here(
    out: Path | None, timeout: float | None, fn: Callable[..., Any], args: Iterable[Any]
) -> Any:
    """What ``fn(*args)`` gives on this worker, or an exception."""
    if out is not None and not out.is_dir():
        place = f"choose a place with {flag('out')} that all machines see"
        return OutputError(f"{socket.gethostname()} does not see {out.parent}; {place}")
    try:
        return _slots(timeout).submit(fn, *args).result()
    except Exception as error:
        return error


@cache
def _slots(timeout: float | None) -> Workers:
    """The processes of this worker."""
    return Workers(cores(), timeout=timeout)


@contextmanager
def cluster(
    address: str, out: Path | None, timeout: float | None
) -> Iterator[tuple[Callable[..., Future[Any]], int]]:
    """What hands calls to a Dask cluster, and how many at once.

    Raises
    ------
    SettingError
        If ``algid[dask]`` is not installed, nothing answers at `address`, or it has no workers.
    """
    try:
        from distributed import Client
        from distributed.core import rpc
    except ImportError as error:
        remedy = "Dask is not installed; pip install 'algid[dask]'"
        raise SettingError(f"{flag('scheduler')}: {remedy}") from error
    # its tracebacks of a lost scheduler; the batch says it in a line
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)

    async def greet() -> None:  # a client would wait for one that says nothing
        async with rpc(address, timeout=SECONDS) as scheduler:  # type: ignore[no-untyped-call]
            await scheduler.identity()

    try:
        asyncio.run(asyncio.wait_for(greet(), SECONDS))
        client: Any = Client(address, timeout=SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
    except Exception as error:  # whatever there is that answers something else
        reason = " ".join(str(error).split())[:200] or f"no word within {SECONDS} s"
        raise SettingError(
            f"{flag('scheduler')} {address}: no scheduler answers ({reason}); start dask scheduler"
        ) from error
    try:
        threads = sum(client.nthreads().values())
        if not threads:
            raise SettingError(
                f"{flag('scheduler')} {address}: it has no workers; start dask worker {address}"
            )
        executor, job = client.get_executor(pure=False), job_of(__version__)

        def submit(fn: Callable[..., Any], *args: Any) -> Future[Any]:
            future: Future[Any] = executor.submit(job, pickle.dumps((out, timeout, fn, args)))
            return future

        yield submit, 2 * threads
    finally:
        with suppress(Exception):  # of a scheduler that is gone
            client.close(timeout=SECONDS)
