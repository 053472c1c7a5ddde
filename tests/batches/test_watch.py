"""`algid batch --watch` as a process: what it takes, what it leaves alone, and how it ends."""

from __future__ import annotations

import signal
from pathlib import Path

import polars as pl
import pytest

from tests.batches.commands import QUICK, Started, start, wait_until, write_logs

PATIENCE = 60.0

pytestmark = pytest.mark.slow
# s, instead of 2
HASTY = "from algid.batches import run; run.LOOK_EVERY = 1.0"


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    log = next(write_logs(tmp_path_factory.mktemp("made") / "logs", 1).glob("*.csv"))
    return log.read_bytes()


def _watching(logs: Path, out: Path) -> Started:
    command = ("batch", logs, "-o", out, "--watch", "--workers", "1", *QUICK)
    return start(*command, before=HASTY)


def test_logs_are_taken_as_they_arrive_until_sigterm(content: bytes, tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    running = _watching(logs, out)
    try:
        for name in ("a", "b"):
            (logs / f"{name}.csv").write_bytes(content)
            wait_until((out / f"{name}.algid/result.json").exists)
        running.send_signal(signal.SIGTERM)
        told, errors = running.communicate(timeout=PATIENCE)
    finally:
        running.kill()
        running.wait()
    assert (running.returncode, errors) == (0, "")
    assert "jobs.parquet" in told
    assert pl.read_parquet(out / "jobs.parquet")["status"].to_list() == ["ok", "ok"]
