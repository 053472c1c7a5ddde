"""Jobs on a Dask cluster: how many make a task, and what a fault of the cluster's own does to
them.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import polars as pl
import pytest

import algid
from algid.batches.cluster import (
    MOST_TOGETHER,
    TASK_SECONDS,
    ClusterExecutor,
    answered_in_turn,
    misfit_of,
)
from algid.batches.workers import CallFailedError, WorkerDiedError, WorkersGoneError
from algid.synth.sensors import Sensors
from tests.batches import calls
from tests.batches.clusters import ROOT, Dask, dask

__all__ = ["dask"]

pytest.importorskip("distributed", reason="distributed is absent")


class Remote:
    """A task that ends when the test says so."""

    def __init__(self, key: str, arguments: tuple[Any, ...]) -> None:
        self.key, self.calls, self.timeout = key, *arguments
        self.ended: Callable[[Any], None] = lambda _remote: None
        self.outcome: Callable[[], Any] = lambda: None

    def add_done_callback(self, ended: Callable[[Any], None]) -> None:
        self.ended = ended

    def result(self, timeout: float) -> Any:
        assert timeout > 0
        return self.outcome()

    def end(self, outcome: Callable[[], Any] | None = None, seconds: float = TASK_SECONDS) -> None:
        """Let it end with its calls' answers, or as `outcome` does."""
        self.outcome = outcome or (lambda: (seconds, answered_in_turn(self.calls, self.timeout)[1]))
        self.ended(self)


class Client:
    """A Dask client whose tasks are the test's."""

    def __init__(self) -> None:
        self.status = "running"
        self.threads = {"a worker": 2}
        self.tasks: list[Remote] = []

    def submit(self, _task: object, *arguments: Any, key: str) -> Remote:
        self.tasks.append(Remote(key, arguments))
        return self.tasks[-1]

    def nthreads(self) -> dict[str, int]:
        return self.threads

    def drive(self, answers: list[Future[Any]], ending: Callable[[Remote], None]) -> list[int]:
        """Let `ending` end tasks as they come, until all answers are there.

        How many calls each task held.
        """
        sizes, end = [], time.monotonic() + 30
        while not all(answer.done() for answer in answers):
            assert time.monotonic() < end
            if self.tasks:
                task = self.tasks.pop(0)
                sizes.append(len(task.calls))
                ending(task)
            time.sleep(0.001)
        return sizes


@pytest.fixture
def client() -> Client:
    return Client()


@pytest.fixture
def cluster(client: Client) -> Iterator[ClusterExecutor]:
    made = ClusterExecutor(client, "tcp://there:1", 2, "algid-", lambda: None, None)
    yield made
    made.end()


def _submit(cluster: ClusterExecutor, count: int) -> list[Future[Any]]:
    return [cluster.submit(calls.add, number, 1) for number in range(count)]


def test_short_calls_travel_together_and_the_last_ones_are_shared_out(
    client: Client, cluster: ClusterExecutor
) -> None:
    answers = _submit(cluster, 64)
    # how long they take is not known yet
    assert [len(task.calls) for task in client.tasks] == [
        1,
        1,
        1,
        1,
    ]
    sizes = client.drive(
        answers, lambda task: task.end(seconds=len(task.calls) * TASK_SECONDS / 10)
    )
    assert [answer.result() for answer in answers] == list(range(1, 65))
    assert max(sizes) == 10
    assert sizes[-4:] == [1, 1, 1, 1]
    assert len(sizes) < 24


@pytest.mark.parametrize(("seconds", "most"), [(30 * TASK_SECONDS, 1), (1e-9, MOST_TOGETHER)])
def test_long_calls_travel_alone_and_short_ones_not_without_bound(
    client: Client, cluster: ClusterExecutor, seconds: float, most: int
) -> None:
    sizes = client.drive(
        _submit(cluster, 400), lambda task: task.end(seconds=len(task.calls) * seconds)
    )
    assert max(sizes) == most


def test_of_a_task_that_takes_workers_with_it_the_one_call_that_does_so_fails(
    client: Client, cluster: ClusterExecutor
) -> None:
    from distributed.scheduler import KilledWorker

    poison = pickle.dumps((calls.add, (20, 1), {}))
    met: list[int] = []

    def killed() -> None:
        raise KilledWorker("algid-1", cast(Any, SimpleNamespace(address="tcp://box:1")), 2)

    def ending(task: Remote) -> None:
        if poison in task.calls:
            met.append(len(task.calls))
        task.end(killed if poison in task.calls else None, seconds=0.0)

    answers = _submit(cluster, 64)
    client.drive(answers, ending)
    assert len(met) == 2  # with others, and alone
    assert met[0] > met[1] == 1
    for number, answer in enumerate(answers):
        if number == 20:
            with pytest.raises(WorkerDiedError) as died:
                answer.result()
            assert died.value.kills > 2
        else:
            assert answer.result() == number + 1


def test_what_fails_in_a_task_fails_alone(client: Client, cluster: ClusterExecutor) -> None:
    answers = _submit(cluster, 8)
    bad, unpackable = cluster.submit(calls.fail), cluster.submit(lambda: None)
    sizes = client.drive([*answers, bad], lambda task: task.end(seconds=0.0))
    assert max(sizes) > 1
    with pytest.raises(CallFailedError, match="as asked"):
        bad.result()
    with pytest.raises(CallFailedError, match="pickled"):
        unpackable.result()


def _lost() -> None:
    from distributed.client import FutureCancelledError

    raise FutureCancelledError("algid-1", "scheduler-connection-lost", "long story\nof many lines")


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (lambda client: client.tasks[0].end(_lost), "it is gone, or has lost the jobs in hand"),
        (
            lambda client: client.tasks[0].end(lambda: "box: algid 0.0.1 stands there"),
            "algid 0.0.1 stands there",
        ),
        (lambda client: setattr(client, "status", "closed"), "it is gone; start dask scheduler"),
        (lambda client: client.threads.clear(), "no workers for 0.05 s; start dask worker"),
    ],
    ids=["lost", "misfit", "closed", "no workers"],
)
def test_a_fault_of_the_cluster_ends_every_call_and_is_none_of_theirs(
    client: Client, monkeypatch: pytest.MonkeyPatch, fault: Callable[[Client], None], reason: str
) -> None:
    monkeypatch.setattr("algid.batches.cluster.WATCH_EVERY", 0.01)
    monkeypatch.setattr("algid.batches.cluster.PATIENCE", 0.05)
    cluster = ClusterExecutor(client, "tcp://there:1", 2, "algid-", lambda: None, None)
    answers = _submit(cluster, 30)
    fault(client)
    for answer in (*answers, cluster.submit(calls.add, 1, 1)):
        with pytest.raises(WorkersGoneError, match=f"--scheduler tcp://there:1: .*{reason}"):
            answer.result(timeout=10)
    cluster.end()


def test_an_answer_that_was_lost_on_its_way_is_waited_for(
    client: Client, cluster: ClusterExecutor
) -> None:
    from distributed import TimeoutError as DaskTimeoutError

    answer = cluster.submit(calls.add, 1, 1)
    task = client.tasks.pop(0)

    def late() -> None:
        task.ended, task.outcome = (lambda _remote: None), (lambda: None)
        raise DaskTimeoutError

    task.end(late)
    end = time.monotonic() + 10
    while task.outcome is late and time.monotonic() < end:
        time.sleep(0.001)
    time.sleep(0.01)
    assert not answer.done()
    task.end()
    assert answer.result(timeout=10) == 2


def test_a_worker_that_does_not_fit_says_why(tmp_path: Path) -> None:
    """As it runs there: from its bytes, with another algid or none."""
    import cloudpickle

    (tmp_path / "other/algid").mkdir(parents=True)
    (tmp_path / "other/algid/__init__.py").write_text("__version__ = '0.0.1'\n")
    (tmp_path / "none/algid").mkdir(parents=True)
    (tmp_path / "none/algid/__init__.py").write_text("raise ImportError\n")
    (tmp_path / "mark").touch()
    code = "import pickle, sys; print(pickle.loads(bytes.fromhex(sys.argv[1]))())"
    for root, mark, said in (
        (ROOT, "mark", "None"),
        (ROOT, "absent", "it does not see /there; choose a place with -o that all machines see"),
        (
            tmp_path / "other",
            "mark",
            f"algid 0.0.1 stands there; install algid {algid.__version__}",
        ),
        (tmp_path / "none", "mark", "algid is not installed there"),
    ):
        misfit = cloudpickle.dumps(
            misfit_of(algid.__version__, str(tmp_path / mark), "/there")
        ).hex()
        command = [sys.executable, "-c", code, misfit]
        env = {**os.environ, "PYTHONPATH": str(root)}
        done = subprocess.run(
            command, capture_output=True, text=True, check=True, cwd=root, env=env
        )
        assert said in done.stdout


def test_calls_of_a_task_have_their_time_each() -> None:
    packed = [pickle.dumps((function, (), {})) for function in (calls.fail, calls.spin, calls.fail)]
    seconds, answers = answered_in_turn(packed, 0.2)
    assert seconds > 0.2
    assert [pickle.loads(answer)[0] for answer in answers] == [False, False, False]
    assert "longer than 0.2 s" in pickle.loads(answers[1])[1]


JOBS = 12
PATIENT = """
import sys
import algid.batches.cluster as cluster
cluster.PATIENCE = float(sys.argv.pop(1))
from algid.cli import main
main()
"""


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    unloaded, _ = algid.synthesise(
        "case1", duration=2.0, excitation="wide", sensors=Sensors(1e-4, 1e-3)
    )
    for number in range(JOBS):
        algid.write_log(folder / f"logs/d{number:02d}.mcap", unloaded)
    return folder


def _start(folder: Path, out: Path, dask: Dask, patience: float = 60.0) -> subprocess.Popen[str]:
    """A batch of ``folder/logs`` with relative paths: its own folder is not the workers'."""
    place = os.path.relpath(out, folder)
    command = [sys.executable, "-c", PATIENT, str(patience), "batch", "logs", "-o", place]
    command += ["--no-report", "--scheduler", dask.address]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        command, env=env, cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def _wait_for_records(out: Path, count: int) -> None:
    end = time.monotonic() + 60
    while len(list((out / ".jobs").glob("*.json"))) < count and time.monotonic() < end:
        time.sleep(0.005)


def _ends(out: Path) -> list[str]:
    return pl.read_parquet(out / "jobs.parquet")["status"].to_list()


@pytest.mark.slow
def test_a_lost_scheduler_is_told_and_costs_no_job(logs: Path, tmp_path: Path, dask: Dask) -> None:
    dask.worker()
    out = tmp_path / "out"
    first = _start(logs, out, dask)
    _wait_for_records(out, 2)
    dask.running[0].kill()
    told, errors = first.communicate(timeout=60)
    assert first.returncode == 1
    assert len(errors.splitlines()) == 1
    assert "run again: what is finished is kept" in errors
    assert "failed" not in told
    assert set(_ends(out)) == {"ok"}
    dask.running[0].wait()
    dask.scheduler()
    dask.worker()
    told, errors = _start(logs, out, dask).communicate(timeout=120)
    assert f"{JOBS} ok" in told
    assert errors == ""
    assert sorted(path.parent.name for path in out.rglob("result.json")) == [
        f"d{n:02d}.algid" for n in range(JOBS)
    ]
    assert not list(ROOT.glob("out*"))


@pytest.mark.slow
def test_the_only_worker_s_end_is_told_and_another_takes_its_place(
    logs: Path, tmp_path: Path, dask: Dask
) -> None:
    out = tmp_path / "out"
    victim = dask.worker()
    first = _start(logs, out, dask, patience=3.0)
    _wait_for_records(out, 2)
    victim.kill()
    told, errors = first.communicate(timeout=60)
    assert (first.returncode, len(errors.splitlines())) == (1, 1)
    assert "no workers for 3 s" in errors
    assert "failed" not in told
    victim = dask.worker()
    second = _start(logs, out, dask)
    _wait_for_records(out, len(_ends(out)) + 2)
    victim.kill()
    dask.worker()
    told, errors = second.communicate(timeout=120)
    assert f"{JOBS} ok" in told
    assert errors == ""


@pytest.mark.slow
def test_sigterm_ends_a_batch_that_has_no_worker(logs: Path, tmp_path: Path, dask: Dask) -> None:
    victim = dask.worker()
    running = _start(logs, tmp_path / "out", dask)
    _wait_for_records(tmp_path / "out", 2)
    victim.kill()
    time.sleep(1.0)
    running.send_signal(signal.SIGTERM)
    assert "left" in running.communicate(timeout=30)[0]
    assert running.returncode == 130


@pytest.mark.slow
def test_a_worker_of_another_version_is_refused(logs: Path, tmp_path: Path, dask: Dask) -> None:
    (tmp_path / "stub/algid").mkdir(parents=True)
    (tmp_path / "stub/algid/__init__.py").write_text("__version__ = '0.0.1'\n")
    dask.worker(root=tmp_path / "stub")
    running = _start(logs, tmp_path / "out", dask)
    told, errors = running.communicate(timeout=60)
    assert (running.returncode, told) == (2, "")
    assert "algid 0.0.1 stands there; install algid" in errors
    assert not (tmp_path / "out/jobs.parquet").exists()
