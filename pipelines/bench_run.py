"""Run a command and tell what it took."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

# A process inherits the peak memory of the one that starts it: a small one stands in between.
_LAUNCH = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stderr=subprocess.STDOUT).returncode
wall = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print()
print(json.dumps([code, wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024]))
"""


@dataclass(frozen=True)
class Cost:
    """Wall and processor time in s, and peak memory in MB, of one run of a command."""

    wall: float
    cpu: float
    peak: float
    output: str


def run(command: Sequence[str]) -> Cost:
    """Run a command to its end; BLAS keeps to one thread, for the peers' good as well as algid's.

    Modules are compiled once, as they are where pip has installed them, even if the environment
    forbids it.

    Raises
    ------
    RuntimeError
        If it fails.
    """
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    launcher = [sys.executable, "-I", "-S", "-c", _LAUNCH, *command]
    text = subprocess.run(
        launcher, capture_output=True, text=True, env=environment, check=True
    ).stdout
    output, _, figures = text.rstrip().rpartition("\n")
    code, wall, cpu, peak = json.loads(figures)
    if code not in (0, 3):  # 3: algid tells that a constant could not be identified
        raise RuntimeError(f"{' '.join(command)}: exit code {code}\n{output}")
    return Cost(wall, cpu, peak, output)


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
