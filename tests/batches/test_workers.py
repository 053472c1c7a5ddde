"""Workers: answers, errors, deaths, memory."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from algid.base.errors import SettingError
from algid.batches.cluster import cluster
from algid.batches.workers import CallFailedError, WorkerDiedError, Workers
from tests.batches import calls
from tests.batches.commands import ROOT, wait_until
from tests.test_guard import lives


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(1, memory_limit=2 << 30) as executor:
        yield executor


def test_answers_and_errors_come_back(workers: Workers) -> None:
    assert workers.submit(calls.add, 2, 3).result() == 5
    with pytest.raises(CallFailedError, match="ValueError: as asked"):
        workers.submit(calls.fail).result()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (calls.raise_unprintable, "UnprintableError"),
        (calls.give_unpicklable, "pickle"),
        (calls.raise_base, "Panic: as asked"),
        (calls.take_not_here, "RuntimeError: not here"),
    ],
)
def test_no_exception_kills_or_hangs_a_worker(
    workers: Workers, call: Callable[[], object], words: str
) -> None:
    pid = workers.submit(os.getpid).result()
    with pytest.raises(CallFailedError, match=words):
        workers.submit(call).result(timeout=60)
    assert workers.submit(os.getpid).result() == pid


def test_what_cannot_travel_fails_its_own_call(workers: Workers) -> None:
    with pytest.raises(Exception, match="pickle"):
        workers.submit(calls.add, lambda: None).result(timeout=60)


def test_a_call_whose_worker_is_killed_runs_in_three_at_most(
    workers: Workers, tmp_path: Path
) -> None:
    assert workers.submit(calls.die_until, 3, str(tmp_path / "a")).result() == 3
    with pytest.raises(WorkerDiedError, match="SIGKILL"):
        workers.submit(calls.die_until, 4, str(tmp_path / "b")).result()
    assert (tmp_path / "b").stat().st_size == 3


def test_workers_that_are_ended_leave_no_process(tmp_path: Path) -> None:
    executor = Workers(2)
    told = tmp_path / "pid"
    idle = executor.submit(os.getpid).result()
    running = [executor.submit(calls.linger, str(told)), executor.submit(calls.spin)]
    waiting = executor.submit(calls.add, 1, 1)
    wait_until(lambda: told.exists() and told.read_text() != "")
    executor.shutdown()
    assert not lives(int(told.read_text()))
    assert not lives(idle)
    assert waiting.cancelled()
    with pytest.raises(WorkerDiedError, match="SIGKILL"):
        running[0].result(timeout=1)


@pytest.mark.parametrize(
    ("number", "file", "error", "words"),
    [
        (signal.SIGKILL, "a.csv", WorkerDiedError, "the worker was ended by SIGKILL"),
        (signal.SIGSEGV, "", CallFailedError, r"a library broke \(SIGSEGV\)"),
        (signal.SIGABRT, "a.csv", CallFailedError, "while reading a.csv: a library broke on it"),
        (signal.SIGPROF, "a.csv", CallFailedError, "while reading a.csv: no sample came within"),
    ],
)
def test_what_ends_a_worker_ends_one_call_and_leaves_nothing(
    tmp_path: Path,
    workers: Workers,
    number: signal.Signals,
    file: str,
    error: type[Exception],
    words: str,
) -> None:
    futures = [
        workers.submit(calls.die, int(number), file, str(tmp_path / "half")),
        workers.submit(calls.add, 1, 1),
    ]
    with pytest.raises(error, match=words):
        futures[0].result()
    assert futures[1].result() == 2
    assert list(tmp_path.iterdir()) == []


def test_a_worker_has_one_thread_and_the_guards_bounds_and_the_parent_its_own() -> None:
    before = os.environ.get("OMP_NUM_THREADS")
    with Workers(1) as executor:
        assert executor.submit(calls.environment, "OMP_NUM_THREADS").result() == "1"
        bound = executor.submit(calls.bound).result()
    assert os.environ.get("OMP_NUM_THREADS") == before
    if sys.platform == "linux":
        assert 0 < bound <= 0.9 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


@pytest.mark.skipif(sys.platform != "linux", reason="macOS bounds no process's memory")
def test_memory_is_bounded_and_the_worker_lives_on(workers: Workers) -> None:
    pid = workers.submit(os.getpid).result()
    with pytest.raises(CallFailedError, match="MemoryError"):
        workers.submit(calls.fill, 4 << 30).result()
    assert workers.submit(calls.fill, 1 << 20).result() == 1 << 20
    assert workers.submit(os.getpid).result() == pid


SCRIPT = """
import threading
from algid.batches.workers import Workers
from tests.batches import calls
print("imported", flush=True)

def work():
    with Workers(1) as executor:
        executor.submit(calls.linger, {told!r}).result()

threading.Thread(target=work).start()
"""


def test_workers_start_from_any_thread_import_no_main_and_die_with_their_parent(
    tmp_path: Path,
) -> None:
    told, script = tmp_path / "pid", tmp_path / "parent.py"
    script.write_text(SCRIPT.format(told=str(told)))
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(script)]
    with subprocess.Popen(command, env=env, text=True, stdout=subprocess.PIPE) as parent:
        wait_until(lambda: told.exists() and told.read_text() != "")
        assert lives(int(told.read_text()))
        parent.kill()
        assert parent.stdout.read() == "imported\n"
    wait_until(lambda: not lives(int(told.read_text())))


@pytest.mark.parametrize("address", ["", "inproc://a", "tcp://127.0.0.1:{}"])
def test_what_is_no_scheduler_is_refused_in_a_line(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="distributed is absent")
    monkeypatch.setattr("algid.batches.cluster.SECONDS", 0.5)
    told = r"^--scheduler .*: no scheduler answers \(.+\); start dask scheduler$"
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(SettingError, match=told):
        cluster(address.format(silent.getsockname()[1]), None, None).__enter__()


def test_a_call_that_takes_too_long_is_ended() -> None:
    told = r"longer than 0\.5 s; raise --timeout, and run it again with --retry-failed"
    with Workers(1, timeout=0.5) as executor, pytest.raises(CallFailedError, match=told):
        executor.submit(calls.spin).result()
