"""Jobs on a Dask cluster, and what a fault of the cluster's own does to them."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

import algid
from algid.base.errors import SettingError
from algid.base.stores import open_store
from algid.batches.cluster import cluster, job_of
from algid.batches.job import Task
from algid.batches.jobs import Job
from algid.batches.run import Batch
from algid.batches.workers import CallFailedError, WorkerDiedError
from algid.settings import Settings
from tests.batches import calls
from tests.batches.clusters import Dask, dask

__all__ = ["dask"]

pytest.importorskip("distributed", reason="distributed is absent")


def test_what_is_no_jobs_fault_ends_the_batch_and_what_is_fails_alone(tmp_path: Path) -> None:
    from distributed.scheduler import KilledWorker

    def submit(*_call: Any) -> Future[Any]:
        outcome = outcomes.pop()
        if isinstance(outcome, OSError):
            raise outcome
        done: Future[Any] = Future()
        if isinstance(outcome, CallFailedError):
            done.set_result(outcome)
        else:
            done.set_exception(outcome)
        return done

    killed = KilledWorker("run-1", cast(Any, SimpleNamespace(address="tcp://box:1")), 3)
    task_of = partial(Task, settings=Settings(), out=str(tmp_path))
    ends = list[Any]()
    faults: list[BaseException] = [CallFailedError("as asked"), WorkerDiedError("as asked"), killed]
    outcomes: list[BaseException] = [CancelledError(), OSError("as asked"), *reversed(faults)]
    while outcomes:
        batch = Batch(open_store(str(tmp_path)), task_of, submit, 1)
        ended = batch.run([Job("a", ("a.csv",))], retry_failed=True)
        ends.append(ended.stopped or ended.records[0].status.value)
    assert ends[:3] == ["failed", "killed", "killed"]
    assert ends[3:] == [
        f"no worker can run jobs ({why}); run again: what is finished is kept"
        for why in ("OSError: as asked", "CancelledError: ")
    ]


def test_a_worker_runs_jobs_of_its_own_version_that_see_the_output(tmp_path: Path) -> None:
    def run(version: str, folder: Path, fn: Callable[..., Any], *args: Any) -> Any:
        return job_of(version)(pickle.dumps((folder, None, fn, args)))

    assert run(algid.__version__, tmp_path, calls.add, 1, 1) == 2
    assert isinstance(run(algid.__version__, tmp_path, calls.fail), CallFailedError)
    assert f"has algid {algid.__version__}; install algid 0.1" in str(
        run("0.1", tmp_path, calls.add)
    )
    told = str(run(algid.__version__, Path("/there/.jobs"), calls.add))
    assert told.endswith("does not see /there; choose a place with -o that all machines see")


def test_calls_run_on_the_workers_that_there_are(dask: Dask, tmp_path: Path) -> None:
    with (
        pytest.raises(SettingError, match=f"{dask.address}: it has no workers; start dask worker"),
        cluster(dask.address, tmp_path, None),
    ):
        pass
    dask.worker()
    with cluster(dask.address, tmp_path, None) as (submit, slots):
        assert slots == 2
        assert submit(calls.add, 1, 1).result(timeout=60) == 2
        assert "as asked" in str(submit(calls.fail).result(timeout=60))


def test_no_secret_is_in_what_dask_prints_of_a_call() -> None:
    """Keys are made of the function's name; a worker logs the arguments of one that raises."""
    place = "s3://KEY:SECRET@lab/a.csv"
    task = Task(Job("a", (place,)), Settings(), place)
    assert "SECRET" not in f"{task!r} {task}"
    told = job_of("0.1")(pickle.dumps((None, None, calls.add, (task,))))
    assert isinstance(told, Exception)
    assert "SECRET" not in str(told)
