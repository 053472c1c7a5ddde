"""A batch over every log that is refused: each job fails alone, in words, and the batch ends."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from tests.batches.refusals import write_refusals


@pytest.mark.slow
def test_every_refusal_fails_its_own_job_and_no_worker(tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    said = write_refusals(logs)
    command = [
        sys.executable,
        "-m",
        "algid",
        "batch",
        str(logs),
        "-o",
        str(out),
        "--workers",
        "2",
        "--timeout",
        "120",
    ]
    done = subprocess.run(
        [*command, "--no-report"], capture_output=True, text=True, timeout=580, check=False
    )
    assert (done.returncode, done.stderr) == (1, "")
    table = pl.read_parquet(out / "jobs.parquet")
    assert set(table["job"]) == set(said)
    assert set(table["status"]) <= {"failed", "incomplete"}
    failed = table.filter(pl.col("status") == "failed")
    assert failed.height > 0.9 * len(said)
    for name, reason in failed.select("job", "reason").rows():
        assert re.search(said[name], reason), (name, reason)
        assert "\n" not in reason, name
        assert "longer than 120 s" not in reason, name
        assert not re.match(r"[A-Za-z]+(Error|Exception|Panic)\b", reason), (name, reason)
