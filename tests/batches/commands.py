"""Logs for batches under test, and commands as processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import algid
from algid.synth.sensors import Sensors

ROOT = Path(__file__).parents[2]
QUICK = ("--no-report", "--estimator", "weak", "--model", "plain")
Started = subprocess.Popen[str]


def write_logs(folder: Path, count: int, suffix: str = ".csv") -> Path:
    """Write logs ``d0-unloaded`` and so on, each with noise of its own, into a new folder."""
    folder.mkdir(parents=True)
    exact, _ = algid.synthesise("case1", duration=2.0, torque="wide", sensors=Sensors(1e-4, 1e-3))
    rng = np.random.default_rng(0)
    for number in range(count):
        noisy = replace(exact, theta=exact.theta + rng.normal(0, 1e-3, exact.theta.shape))
        algid.write_log(folder / f"d{number}-unloaded{suffix}", noisy)
    return folder


def start(
    *arguments: str | Path, site: Path = ROOT, cwd: Path | None = None, before: str = "pass"
) -> Started:
    """The command, once `before` has run; ``site/sitecustomize.py`` runs in it and its workers."""
    code = f"{before}; from algid.cli import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, site)))},
        cwd=cwd,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def wait_until(condition: Callable[[], object]) -> None:
    """Wait for at most a minute."""
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def wait_for_records(out: Path, count: int) -> None:
    """Wait until that many jobs have ended."""
    wait_until(lambda: len(list((out / ".jobs").glob("*.json"))) >= count)


def left(folder: Path) -> list[str]:
    """What stands in a folder under a temporary name."""
    return [path.name for path in folder.rglob(".*") if path.name != ".jobs"]
