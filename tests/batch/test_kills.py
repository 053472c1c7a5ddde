"""The command under signals: killed at random instants, it ends as if nothing had happened."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import algid
from algid.synth.sensors import Sensors

JOBS = 6


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    exact, _ = algid.synthesise("case1", duration=2.0, excitation="wide", sensors=Sensors(1e-4, 1e-3))
    rng = np.random.default_rng(0)
    for number in range(JOBS):
        noisy = replace(exact, theta=exact.theta + rng.normal(0, 1e-3, exact.theta.shape))
        algid.write_log(folder / f"d{number}-unloaded.mcap", noisy)
    return folder


def _start(logs: Path, out: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "algid", "batch", str(logs), "-o", str(out), "--workers", "2", "--no-report"]
    root = str(Path(__file__).parents[2])
    return subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": root},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def _digest(out: Path) -> dict[str, str]:
    files = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in out.rglob("*") if p.name == "result.json"}
    left = [str(p) for p in out.rglob(".*") if p.name not in (".jobs", ".lock")]
    return files | {"left": str(left), "jobs": pl.read_parquet(out / "jobs.parquet").drop("seconds").write_json()}


def test_a_batch_killed_again_and_again_ends_as_an_undisturbed_one(logs: Path, tmp_path: Path) -> None:
    undisturbed = _start(logs, tmp_path / "whole")
    start = time.monotonic()
    undisturbed.communicate()
    assert undisturbed.returncode == 0
    lasts = time.monotonic() - start
    instants = random.Random(1)
    for _ in range(2):
        running = _start(logs, tmp_path / "out")
        time.sleep(instants.uniform(0.4, 1.0) * lasts)
        running.kill()
        running.communicate()
    last = _start(logs, tmp_path / "out")
    told, _ = last.communicate()
    assert last.returncode == 0
    assert f"{JOBS} ok" in told
    assert _digest(tmp_path / "out") == _digest(tmp_path / "whole")


def test_ctrl_c_ends_without_a_traceback_and_keeps_what_is_finished(logs: Path, tmp_path: Path) -> None:
    running = _start(logs, tmp_path / "out")
    end = time.monotonic() + 60
    while not list((tmp_path / "out/.jobs").glob("*.json")) and time.monotonic() < end:
        time.sleep(0.005)
    running.send_signal(signal.SIGINT)
    told, errors = running.communicate()
    table = pl.read_parquet(tmp_path / "out/jobs.parquet")
    assert errors == ""
    assert running.returncode == 130
    assert f"{table.height} ok" in told
    assert set(table["status"]) == {"ok"}
