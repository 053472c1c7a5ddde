"""`algid batch --watch` as a process: what it takes, what it leaves alone, and how it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

import algid
from algid.synth.sensors import Sensors

PATIENCE = 60.0

pytestmark = pytest.mark.slow
# s, instead of 2
HASTY = "from algid.batches import run; run.LOOK_EVERY = 1.0; from algid.cli import main; main()"


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("made") / "log.csv"
    unloaded, _ = algid.synthesise(
        "case1", duration=2.0, torque="wide", sensors=Sensors(1e-4, 1e-3)
    )
    algid.write_log(path, unloaded)
    path.with_name("log.csv.truth.json").unlink(missing_ok=True)
    return path.read_bytes()


def _until(condition: Callable[[], object], running: subprocess.Popen[str]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        assert running.poll() is None
        time.sleep(0.05)


def _watching(logs: Path, out: Path) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        "-c",
        HASTY,
        "batch",
        str(logs),
        "-o",
        str(out),
        "--watch",
        "--workers",
        "1",
    ]
    return subprocess.Popen(
        [*command, "--no-report", "--estimator", "weak", "--model", "plain"],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def test_settled_logs_are_taken_as_they_arrive_until_sigterm(
    content: bytes, tmp_path: Path
) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    (logs / "a.csv").write_bytes(content)
    running = _watching(logs, out)
    try:
        with (logs / "growing.csv").open("wb") as growing:
            written, step = 0, 64  # a log of the usual length takes minutes so

            def grown_until_a_is_done() -> bool:
                nonlocal written
                growing.write(content[written : written + step])
                growing.flush()
                written += step
                return (out / "a.algid/result.json").exists()

            _until(grown_until_a_is_done, running)
            assert not (out / ".jobs/growing.json").exists()
            growing.write(content[written:])
        _until((out / "growing.algid/result.json").exists, running)
        (logs / "b.csv").write_bytes(content)
        _until((out / "b.algid/result.json").exists, running)
        running.send_signal(signal.SIGTERM)
        told, errors = running.communicate(timeout=PATIENCE)
    finally:
        running.kill()
        running.wait()
    assert errors == ""
    assert running.returncode == 0
    assert "jobs.parquet" in told
    table = pl.read_parquet(out / "jobs.parquet")
    assert dict(zip(table["job"], table["status"], strict=True)) == dict.fromkeys(
        ("a", "b", "growing"), "ok"
    )


def test_ctrl_c_ends_the_watch_without_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    running = _watching(tmp_path / "logs", tmp_path / "out")
    _until((tmp_path / "out/jobs.parquet").exists, running)
    running.send_signal(signal.SIGINT)
    told, errors = running.communicate(timeout=PATIENCE)
    assert (running.returncode, errors) == (0, "")
    assert "nothing done" in told
