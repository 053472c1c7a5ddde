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

            wait_until(grown_until_a_is_done)
            assert not (out / ".jobs/growing.json").exists()
            growing.write(content[written:])
        wait_until((out / "growing.algid/result.json").exists)
        (logs / "b.csv").write_bytes(content)
        wait_until((out / "b.algid/result.json").exists)
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
