"""Workers: answers, errors, deaths, memory."""

from __future__ import annotations

import os
import pickle
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from algid.batches.cluster import answered_within, cluster
from algid.batches.workers import TOO_LONG, CallFailedError, WorkerDiedError, Workers
from algid.errors import SettingError
from tests.batches import calls


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    executor = Workers(1, memory_limit=2 << 30)
    yield executor
    executor.shutdown(cancel_futures=True)


def test_answers_and_errors_come_back(workers: Workers) -> None:
    assert workers.submit(calls.add, 2, b=3).result() == 5
    with pytest.raises(CallFailedError, match="ValueError: as asked"):
        workers.submit(calls.fail).result()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (calls.raise_its_own_cause, "ValueError: as asked"),
        (calls.raise_a_long_chain, "ValueError: 5000"),
        (calls.raise_unpicklable, "UnpicklableError: as asked"),
        (calls.raise_unprintable, "UnprintableError"),
        (calls.raise_huge, "ValueError: xxx"),
        (calls.raise_base, "Panic: as asked"),
        (calls.leave, "SystemExit: 3"),
        (calls.interrupt, "KeyboardInterrupt"),
        (calls.give_unpicklable, "pickle"),
        (calls.give_what_cannot_be_unpacked, "RuntimeError: not here"),
    ],
)
def test_no_exception_or_answer_kills_or_hangs_a_worker(
    workers: Workers, call: Callable[[], object], words: str
) -> None:
    assert workers.submit(calls.add, 1, 1).result() == 2
    pids = workers.pids
    with pytest.raises(CallFailedError, match=words) as failed:
        workers.submit(call).result(timeout=60)
    assert len(str(failed.value)) < 2100
    assert workers.submit(calls.add, 1, 1).result() == 2
    assert workers.pids == pids


def test_arguments_that_cannot_travel_fail_their_own_call(workers: Workers) -> None:
    with pytest.raises(CallFailedError, match="pickle"):
        workers.submit(calls.add, lambda: None).result(timeout=60)
    with pytest.raises(CallFailedError, match="RuntimeError: not here"):
        workers.submit(calls.add, calls.NotHere(), 1).result(timeout=60)
    assert workers.submit(calls.add, 1, 1).result() == 2


@pytest.mark.slow
def test_a_call_past_its_time_fails_alone_and_its_worker_is_replaced() -> None:
    with Workers(
        1, timeout=3.0
    ) as executor:  # the first call waits for the process, not within its time
        futures = [executor.submit(calls.spin), executor.submit(calls.add, 1, 1)]
        with pytest.raises(
            CallFailedError,
            match="longer than 3 s; raise --timeout, and run it again with --retry-f",
        ):
            futures[0].result(timeout=60)
        assert futures[1].result(timeout=60) == 2


@pytest.mark.skipif(
    sys.gettrace() is not None, reason="a traced call is not interrupted as a call is"
)
def test_a_call_that_goes_on_on_a_cluster_is_interrupted_or_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert pickle.loads(answered_within(pickle.dumps((calls.add, (1, 1), {})), 60.0)) == (True, 2)
    spinning = pickle.dumps((calls.spin, (), {}))
    assert pickle.loads(answered_within(spinning, 0.2)) == (False, TOO_LONG.format(0.2))
    monkeypatch.setattr("algid.batches.cluster.LAST_SECONDS", 0.1)
    sleeping = pickle.dumps((time.sleep, (60.0,), {}))  # however late a busy machine begins it
    good, reason = pickle.loads(answered_within(sleeping, 1.0))
    assert not good
    assert f"process {os.getpid()}: restart that worker" in reason


def test_workers_that_are_ended_at_once_leave_no_process_and_no_folder(tmp_path: Path) -> None:
    executor = Workers(2)
    folder = Path(executor.submit(calls.temporary_file).result(timeout=60)).parent
    told = tmp_path / "pid"
    running = [
        executor.submit(calls.linger, str(told)),
        executor.submit(calls.spin),
        executor.submit(calls.add, 1, 1),
    ]
    _wait_until(lambda: told.exists() and told.read_text() != "")
    assert folder.is_dir()
    pids = executor.pids
    executor.shutdown(cancel_futures=True)
    assert not any(map(_lives, pids))
    assert not folder.exists()
    assert not running[2].done()
    with pytest.raises(WorkerDiedError, match="SIGKILL"):
        running[0].result(timeout=1)


def test_only_the_call_that_kills_its_worker_fails(workers: Workers) -> None:
    futures = [workers.submit(calls.die), workers.submit(calls.add, 1, 1)]
    with pytest.raises(WorkerDiedError, match="SIGKILL"):
        futures[0].result()
    assert futures[1].result() == 2


def test_a_worker_has_one_thread_and_the_parent_keeps_its_own(workers: Workers) -> None:
    before = os.environ.get("OMP_NUM_THREADS")
    assert workers.submit(calls.environment, "OMP_NUM_THREADS").result() == "1"
    assert os.environ.get("OMP_NUM_THREADS") == before


def test_memory_is_bounded_and_the_worker_lives_on(workers: Workers) -> None:
    assert workers.submit(calls.add, 1, 1).result() == 2
    pids = workers.pids
    with pytest.raises(CallFailedError, match="MemoryError"):
        workers.submit(calls.fill, 4 << 30).result()
    assert workers.submit(calls.fill, 1 << 20).result() == 1 << 20
    assert workers.pids == pids


def test_workers_die_with_their_parent(tmp_path: Path) -> None:
    told = tmp_path / "pid"
    code = (
        "from algid.batches.workers import Workers\nfrom tests.batches import calls\n"
        f"if __name__ == '__main__':\n    Workers(1).submit(calls.linger, {str(told)!r}).result()\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(code)
    root = str(Path(__file__).parents[2])
    parent = subprocess.Popen([sys.executable, str(script)], env={**os.environ, "PYTHONPATH": root})
    _wait_until(lambda: told.exists() and told.read_text() != "")
    parent.kill()
    parent.wait()
    _wait_until(lambda: not _lives(int(told.read_text())))


def _lives(pid: int) -> bool:
    """Whether a process runs; one that is dead but not collected by its new parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _wait_until(condition: object) -> None:
    end = time.monotonic() + 30
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize(
    "address", [".", "", "x", "inproc://a", "tcp://127.0.0.1:99999", "tcp://a:0", "tcp://a b:1"]
)
def test_what_is_no_address_of_a_scheduler_is_refused_at_once(address: str) -> None:
    pytest.importorskip("distributed", reason="distributed is absent")
    with (
        pytest.raises(
            SettingError, match=r"^--scheduler: expected an address like tcp://HOST:8786, found '"
        ),
        cluster(address, "out"),
    ):
        pass


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["refused", "silent", "other", "tls"])
def test_a_scheduler_that_does_not_answer_as_one_gets_one_line(kind: str) -> None:
    pytest.importorskip("distributed", reason="distributed is absent")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        if kind == "refused":
            server.close()
        if kind == "other":
            threading.Thread(target=_greet_as_another, args=(server,), daemon=True).start()
        scheme = "tls" if kind == "tls" else "tcp"
        command = [sys.executable, "-m", "algid", "batch", __file__, "-o", "out", "--scheduler"]
        with tempfile.TemporaryDirectory() as place:
            done = subprocess.run(
                [*command, f"{scheme}://127.0.0.1:{port}"],
                cwd=place,
                env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(
        r"algid: --scheduler t\w\w://127.0.0.1:\d+: no scheduler answers \(.+\); .*\n", done.stderr
    )


def _greet_as_another(server: socket.socket) -> None:
    while True:
        try:
            connection, _ = server.accept()
        except OSError:
            return
        with connection:
            connection.sendall(b"HTTP/1.0 400 Bad Request\r\n\r\n" * 100)
