"""The command under signals: killed at random instants, it ends as if nothing had happened."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import algid
from tests.batches.clusters import Dask, dask
from tests.batches.commands import QUICK, ROOT, Started, left, start, wait_for_records, write_logs

__all__ = ["dask"]

JOBS = 6

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_logs(tmp_path_factory.mktemp("made") / "logs", JOBS, ".mcap")


@dataclass(frozen=True)
class Undisturbed:
    """What a batch that nothing happens to leaves, and the seconds that it takes."""

    digest: dict[str, str]
    lasts: float


@pytest.fixture(scope="module")
def undisturbed(logs: Path, tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    start = time.monotonic()
    running = _start(logs, out)
    running.communicate()
    assert running.returncode == 0
    return Undisturbed(_digest(out), time.monotonic() - start)


HANGING = """
import sys
import algid.readers as readers
opened = readers.open_log
def open_log(path, *more):
    while "hangs" in str(path):
        pass
    return opened(path, *more)
readers.open_log = open_log
"""
"""In every interpreter a reader that never ends on what is named so."""


def _start(logs: Path, out: Path, *flags: str, site: Path = ROOT) -> Started:
    where = flags or ("--workers", "2")
    return start("batch", logs, "-o", out, *QUICK, *where, site=site)


def _digest(out: Path) -> dict[str, str]:
    files = {
        str(p.relative_to(out)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in out.rglob("result.json")
    }
    return files | {
        "left": str(left(out)),
        "jobs": pl.read_parquet(out / "jobs.parquet").drop("seconds").write_json(),
    }


FORKING = """
import os, sys
from pathlib import Path
import algid.api.batch as door
import algid.batches.workers
from tests.batches.test_run import Here
import algid.identification.identify, polars, pyarrow.fs, pyarrow.parquet, scipy.optimize

algid.batches.workers.Workers = lambda *_: __import__("contextlib").nullcontext(Here())
for line in sys.stdin:
    child = os.fork()
    if child == 0:
        logs, out = line.split()
        quick = dict(estimator="weak", model="plain", report=False)
        os._exit(len(door.batch(logs, out, **quick).failed))
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


def test_batches_killed_sixty_times_at_random_end_as_undisturbed_ones(
    logs: Path, tmp_path: Path, undisturbed: Undisturbed
) -> None:
    """Forks of a process that has imported everything: a kill costs no second of imports."""
    command = [sys.executable, "-W", "ignore", "-c", FORKING]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, env=env, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as server:
        instants, kills, outs, code, longest = random.Random(1), 0, 0, 1, None
        while kills < 60 or code:
            out = tmp_path / f"out{outs}"
            print(logs, out, file=server.stdin, flush=True)
            pid, start = int(server.stdout.readline()), time.monotonic()
            if longest is not None and kills < 60:
                time.sleep(instants.uniform(0.0, 0.4) * longest)
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            code = int(server.stdout.readline())
            kills += code == -signal.SIGKILL
            for result in out.glob("*.algid"):
                algid.read_result(result)  # whole, at any instant
            if code == 0:
                assert _digest(out) == undisturbed.digest
                longest = longest or time.monotonic() - start
                outs += 1
    assert outs > 1


def test_the_started_process_is_killed_and_the_batch_resumed_at_once(
    logs: Path, tmp_path: Path, undisturbed: Undisturbed
) -> None:
    """Its child and the workers go with it; nothing waits for them but the next run itself."""
    running = _start(logs, tmp_path / "out")
    wait_for_records(tmp_path / "out", 1)
    running.kill()
    running.wait()
    last = _start(logs, tmp_path / "out")
    told, errors = last.communicate()
    running.communicate()
    assert (last.returncode, errors) == (0, "")
    assert f"{JOBS} ok" in told
    assert _digest(tmp_path / "out") == undisturbed.digest


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_ends_at_once_even_where_a_job_hangs_and_keeps_what_is_finished(
    logs: Path, tmp_path: Path, sent: signal.Signals
) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs/d0-unloaded.mcap").symlink_to(logs / "d0-unloaded.mcap")
    (tmp_path / "logs/hangs.csv").write_text("t,theta1,theta2,tau1,tau2\n")
    (tmp_path / "sitecustomize.py").write_text(HANGING)
    running = _start(tmp_path / "logs", tmp_path / "out", "--workers", "2", site=tmp_path)
    wait_for_records(tmp_path / "out", 1)
    running.send_signal(sent)
    told, errors = running.communicate(timeout=60)
    assert (running.returncode, errors) == (128 + sent, "")
    assert "1 ok; 1 run now, 1 left" in told
    assert pl.read_parquet(tmp_path / "out/jobs.parquet")["job"].to_list() == ["d0"]
    assert left(tmp_path / "out") == []


@pytest.mark.parametrize("victim", ["worker", "batch", "scheduler"])
def test_on_dask_a_death_changes_no_result(
    logs: Path, tmp_path: Path, dask: Dask, undisturbed: Undisturbed, victim: str
) -> None:
    """By relative paths: the folder of the batch is not the workers'."""
    worker, _ = dask.worker(), dask.worker()
    out = os.path.relpath(tmp_path / "out", logs.parent)
    command = ("batch", logs.name, "-o", out, *QUICK, "--scheduler", dask.address)
    running = start(*command, cwd=logs.parent)
    wait_for_records(tmp_path / "out", 1)
    victims: dict[str, subprocess.Popen[Any]] = {"worker": worker, "batch": running}
    killed = victims.get(victim, dask.running[0])
    killed.kill()
    if victim != "worker":
        _, errors = running.communicate(timeout=60)
        if victim == "scheduler":
            assert running.returncode == 1
            assert len(errors.splitlines()) == 1
            assert "run again: what is finished is kept" in errors
            killed.wait()
            dask.scheduler()
            dask.worker()
        running = start(*command, cwd=logs.parent)
    told, errors = running.communicate(timeout=120)
    assert (running.returncode, errors) == (0, "")
    assert f"{JOBS} ok" in told
    assert _digest(tmp_path / "out") == undisturbed.digest
