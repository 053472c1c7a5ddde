"""The workers of a Dask cluster behind the interface of the local ones."""

from __future__ import annotations

import hashlib
import time
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from algid.batch.workers import WorkerDiedError
from algid.errors import SettingError

CONNECT_SECONDS = 10
LOOK_EVERY = 0.1  # s
MOST_DEATHS = 2  # the scheduler gives a task up at the next one


@contextmanager
def cluster(address: str, out: str) -> Iterator[tuple[Executor, int]]:
    """The cluster behind a scheduler, and how many jobs to hand out at once.

    Waits for jobs of an earlier batch on `out` that was killed: their threads cannot be stopped.

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
        prefix = f"algid-{hashlib.sha256(out.encode()).hexdigest()[:16]}-"
        while any(client.run(_at_work, prefix).values()):
            time.sleep(LOOK_EVERY)
        yield _Cluster(client, prefix), 2 * threads


def _at_work(prefix: str, dask_worker: Any) -> bool:
    """Whether a worker, this function runs on it, has a call in hand whose key starts so."""
    return any(str(task.key).startswith(prefix) for task in dask_worker.state.all_running_tasks)


class _Cluster(Executor):
    """Calls run on the cluster; a call that costs worker after worker fails with `WorkerDiedError`."""

    def __init__(self, client: Any, prefix: str) -> None:
        self._client, self._prefix = client, prefix

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run ``fn(*args, **kwargs)`` on a worker; one that dies has the call run elsewhere."""
        answer: Future[Any] = Future()
        answer.set_running_or_notify_cancel()
        remote = self._client.submit(fn, *args, **kwargs, key=self._prefix + uuid.uuid4().hex)
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
