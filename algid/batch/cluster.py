"""The workers of a Dask cluster behind the interface of the local ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from algid.batch.processes import WorkerDiedError
from algid.errors import SettingError

CONNECT_SECONDS = 10
MOST_DEATHS = 2  # the scheduler gives a task up at the next one


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, int]]:
    """The cluster behind a scheduler, and how many jobs to hand out at once.

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
        yield _Cluster(client), 2 * threads


class _Cluster(Executor):
    """Calls run on the cluster; a call that costs worker after worker fails with `WorkerDiedError`."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` on a worker; one that dies has the call run elsewhere."""
        answer: Future[Any] = Future()
        answer.set_running_or_notify_cancel()
        remote = self._client.submit(fn, *args, **kwargs, pure=False)
        remote.add_done_callback(lambda done: _settle(answer, done))
        return answer


def _settle(answer: Future[Any], remote: Any) -> None:
    from distributed.client import FutureCancelledError
    from distributed.scheduler import KilledWorker

    try:
        answer.set_result(remote.result())
    except KilledWorker as error:
        answer.set_exception(WorkerDiedError(str(error).split("\n", maxsplit=1)[0], kills=MOST_DEATHS + 1))
    except (FutureCancelledError, Exception) as error:
        answer.set_exception(error)
