"""Workers: answers, errors, deaths, memory."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from algid.batch.workers import Processes, WorkerDiedError
from tests.batch import calls


@pytest.fixture(scope="module")
def workers() -> Iterator[Processes]:
    executor = Processes(1, memory_limit=2 << 30)
    yield executor
    executor.shutdown(cancel_futures=True)


def test_answers_and_errors_come_back(workers: Processes) -> None:
    assert workers.submit(calls.add, 2, b=3).result() == 5
    with pytest.raises(ValueError, match="as asked"):
        workers.submit(calls.fail).result()


def test_only_the_call_that_kills_its_worker_fails(workers: Processes) -> None:
    futures = [workers.submit(calls.die), workers.submit(calls.add, 1, 1)]
    with pytest.raises(WorkerDiedError, match="SIGKILL"):
        futures[0].result()
    assert futures[1].result() == 2


def test_a_worker_has_one_thread_and_the_parent_keeps_its_own(workers: Processes) -> None:
    before = os.environ.get("OMP_NUM_THREADS")
    assert workers.submit(calls.environment, "OMP_NUM_THREADS").result() == "1"
    assert os.environ.get("OMP_NUM_THREADS") == before


def test_memory_is_bounded_and_the_worker_lives_on(workers: Processes) -> None:
    pids = workers.pids
    with pytest.raises(MemoryError):
        workers.submit(calls.fill, 4 << 30).result()
    assert workers.submit(calls.fill, 1 << 20).result() == 1 << 20
    assert workers.pids == pids


def test_workers_die_with_their_parent(tmp_path: Path) -> None:
    told = tmp_path / "pid"
    code = (
        "from algid.batch.workers import Processes\nfrom tests.batch import calls\n"
        f"if __name__ == '__main__':\n    Processes(1).submit(calls.linger, {str(told)!r}).result()\n"
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
