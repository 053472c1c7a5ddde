"""Throughput of batches on one and two workers and on Dask, and overhead beyond identification.

    python -m pipelines.bench_batch FOLDER [LOGS]

The machine's load is printed beside the figures: on a shared machine they say less. Processor time
says more there, though not all: idle processes of Dask take 2 % of a core each, for as long as the
others let the batch last. (`tests/batches/test_kills.py` kills batches at random instants.)
"""

from __future__ import annotations

import os
import resource
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from algid import synthesise
from algid.base.runtime import keep_freed, keep_to_one_core
from algid.batches.workers import THREADS
from algid.identification.identify import identify
from algid.writers import write_log

CLUSTER = {
    **os.environ,
    **dict.fromkeys(THREADS, "1"),
    # sampling of stacks takes some 6 % of a worker's processor time
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
}
TURNS = 3
"""Of which the least of each counts: a shared processor drifts by a tenth meanwhile."""


def logs(folder: Path, count: int) -> Path:
    """`count` logs of 10 s at 1 kHz with noise of their own."""
    exact, _ = synthesise("case1", duration=10.0, torque="wide")
    rng = np.random.default_rng(0)
    for number in range(count):
        theta = exact.theta + 1e-3 * rng.standard_normal(exact.theta.shape)
        tau = exact.tau + 1e-2 * rng.standard_normal(exact.tau.shape)
        write_log(folder / f"d{number:04d}.mcap", replace(exact, theta=theta, tau=tau, omega=None))
    return folder


def run(source: Path, out: Path, *flags: str) -> float:
    """Seconds of a whole batch, its start included."""
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, "-m", "algid", "batch", str(source), "-o", str(out), "--no-report"]
    start = time.perf_counter()
    subprocess.run([*command, "-q", *flags], check=True)
    return time.perf_counter() - start


def spent(who: int, pids: Iterable[int] = ()) -> float:
    """Processor seconds so far: of this process or of its children that have ended, and of others
    that run.
    """
    own = resource.getrusage(who)
    fields = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids]
    ticks = sum(int(one[11]) + int(one[12]) for one in fields)
    return own.ru_utime + own.ru_stime + ticks / os.sysconf("SC_CLK_TCK")


@contextmanager
def dask(workers: int) -> Iterator[tuple[str, list[int]]]:
    """A scheduler and workers of this machine: its address, and the processes."""
    from distributed import Client

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    address = f"tcp://127.0.0.1:{port}"
    calls = [("scheduler", "--host", "127.0.0.1", "--port", port)]
    calls += [("worker", address, "--nthreads", "1", "--no-nanny")] * workers
    running = []
    try:
        for kind, *flags in calls:
            code = f"from distributed.cli import dask_{kind}; dask_{kind}.main()"
            command = [sys.executable, "-c", code, *flags, "--no-dashboard"]
            running.append(subprocess.Popen(command, env=CLUSTER, stderr=subprocess.DEVNULL))
        with Client(address, timeout=60) as client:  # type: ignore[no-untyped-call]
            client.wait_for_workers(workers, timeout=60)
        yield address, [one.pid for one in running]
    finally:
        for process in running:
            process.kill()
            process.wait()


def turn(source: Path, out: Path) -> tuple[float, ...]:
    """Seconds of one worker, of two, of identification alone and of its processor time, of Dask's
    two and of all their processor time.
    """
    one, two = run(source, out, "--workers", "1"), run(source, out, "--workers", "2")
    shutil.rmtree(out, ignore_errors=True)
    keep_freed()  # as workers do
    keep_to_one_core()
    before, start = spent(resource.RUSAGE_SELF), time.perf_counter()
    for path in sorted(source.iterdir()):
        identify(path, out=out, report=False)
    bare, ideal = time.perf_counter() - start, spent(resource.RUSAGE_SELF) - before
    with dask(2) as (address, pids):
        before = spent(resource.RUSAGE_CHILDREN, pids)
        cluster = run(source, out, "--scheduler", address)
        used = spent(resource.RUSAGE_CHILDREN, pids) - before
    return one, two, bare, ideal, cluster, used


def main(folder: Path, count: int = 250) -> None:
    """Print a Markdown table."""
    shutil.rmtree(folder, ignore_errors=True)
    source, load = logs(folder / "logs", count), os.getloadavg()[0]
    turns = [turn(source, folder / "out") for _ in range(TURNS)]
    one, two, bare, ideal, cluster, used = np.min(turns, axis=0)
    print(f"""\
{count} logs of 10 s at 1 kHz, the least of {TURNS} turns; {os.cpu_count()} cores, load before and
after: {load:.1f}, {os.getloadavg()[0]:.1f}.

| what | asked | measured |
|---|---|---|
| two workers over one | ≥ 1.8 | {one / two:.2f} ({one:.1f} s, {two:.1f} s) |
| one worker over identification alone | ≤ 1.15 | {one / bare:.2f} ({bare:.1f} s) |
| Dask's two workers over the process pool's | ≥ 0.95 | {two / cluster:.2f} ({cluster:.1f} s) |
| identification over all of Dask's batch, processor time | ≥ 0.95 | {ideal / used:.2f} \
({ideal:.1f} s of {used:.1f} s) |""")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
