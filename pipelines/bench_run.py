"""Run a command and tell what it took."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class Cost:
    """Wall and processor time in s, and peak memory in MB, of one run of a command."""

    wall: float
    cpu: float
    peak: float
    output: str


def run(command: Sequence[str]) -> Cost:
    """Run a command to its end; BLAS keeps to one thread, for the peers' good as well as algid's.

    Raises
    ------
    RuntimeError
        If it fails.
    """
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    assert process.stdout is not None
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stdout.close()
    if process.returncode not in (0, 3):  # 3: algid tells that a constant could not be identified
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}\n{output}")
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, output)


def python(*arguments: str) -> list[str]:
    """A command for this interpreter."""
    return [sys.executable, *arguments]


def middle(costs: Sequence[Cost]) -> Cost:
    """Medians of several runs; the first one's output."""
    return Cost(
        median(cost.wall for cost in costs),
        median(cost.cpu for cost in costs),
        max(cost.peak for cost in costs),
        costs[0].output,
    )
