"""Throughput of batches on one and two workers and on Dask, overhead beyond identification, and kills.

Usage: python -m pipelines.bench_batch FOLDER [LOGS [KILLS]]

The machine's load is printed beside the figures: on a shared machine they say less.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from algid.api import synthesise
from algid.pipeline.identify import identify
from algid.writers import write_log

BATCH = [sys.executable, "-m", "algid", "batch"]
PORT = 18786


def logs(folder: Path, count: int) -> Path:
    """`count` logs of 10 s at 1 kHz with noise of their own."""
    exact, _ = synthesise("case1", duration=10.0, excitation="wide")
    rng = np.random.default_rng(0)
    for number in range(count):
        theta = exact.theta + 1e-3 * rng.standard_normal(exact.theta.shape)
        tau = exact.tau + 1e-2 * rng.standard_normal(exact.tau.shape)
        write_log(folder / f"d{number:04d}.mcap", replace(exact, theta=theta, tau=tau, omega=None))
    return folder


def run(source: Path, out: Path, *flags: str) -> float:
    """Seconds of a whole batch, its start included."""
    shutil.rmtree(out, ignore_errors=True)
    start = time.perf_counter()
    subprocess.run([*BATCH, str(source), "-o", str(out), "--no-report", "-q", *flags], check=True)
    return time.perf_counter() - start


def alone(source: Path, out: Path) -> float:
    """Seconds of identification alone, in this process with one thread."""
    shutil.rmtree(out, ignore_errors=True)
    paths = sorted(source.iterdir())
    start = time.perf_counter()
    for path in paths:
        identify(path, out=out, report=False)
    return time.perf_counter() - start


@contextmanager
def dask(workers: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """A scheduler and workers of this machine."""
    code = "from distributed.cli import dask_scheduler, dask_worker; dask_{}.main()"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1"}
    base = [sys.executable, "-c"]
    address = f"tcp://127.0.0.1:{PORT}"
    started = [
        subprocess.Popen(
            [*base, code.format("scheduler"), "--host", "127.0.0.1", "--port", str(PORT), "--no-dashboard"],
            env=env,
            **quiet,  # type: ignore[call-overload]
        )
    ]
    for _ in range(workers):
        worker = [*base, code.format("worker"), address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
        started.append(subprocess.Popen(worker, env=env, **quiet))  # type: ignore[call-overload]
    try:
        time.sleep(8)
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def digest(out: Path) -> str:
    """Hash of all results, the table without its durations, and what is left half-written."""
    found = hashlib.sha256()
    for path in sorted(out.rglob("result.json")):
        found.update(path.read_bytes())
    found.update(pl.read_parquet(out / "jobs.parquet").drop("seconds").write_json().encode())
    found.update(str([p for p in out.rglob(".*") if p.name not in (".jobs", ".lock")]).encode())
    return found.hexdigest()


def kills(source: Path, out: Path, count: int, seconds: float) -> bool:
    """Whether a batch whose parent or worker is killed `count` times ends as an undisturbed one."""
    whole = out.with_name("whole")
    run(source, whole, "--workers", "2")
    instants = random.Random(0)
    shutil.rmtree(out, ignore_errors=True)
    same = True
    for number in range(count):
        if (out / "jobs.parquet").exists():
            shutil.rmtree(out)
        batch = subprocess.Popen([*BATCH, str(source), "-o", str(out), "--no-report", "-q", "--workers", "2"])
        time.sleep(instants.uniform(0.2, 1.0) * seconds)
        if number % 2:
            batch.kill()
        else:
            kill_a_worker(batch.pid, instants)
        batch.wait()
        if batch.returncode == 0:
            same &= digest(out) == digest(whole)
    subprocess.run([*BATCH, str(source), "-o", str(out), "--no-report", "-q", "--workers", "2"], check=True)
    return same and digest(out) == digest(whole)


def kill_a_worker(parent: int, instants: random.Random) -> None:
    """Kill one of the processes that work for the batch `parent`."""
    children = Path(f"/proc/{parent}/task/{parent}/children")
    found = [int(c) for task in children.parents[1].iterdir() for c in (task / "children").read_text().split()]
    working = [pid for pid in found if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    if working:
        os.kill(instants.choice(working), signal.SIGKILL)


def main(folder: Path, count: int = 1000, killed: int = 50) -> None:
    """Print a Markdown table."""
    shutil.rmtree(folder, ignore_errors=True)
    source, out = logs(folder / "logs", count), folder / "out"
    load = os.getloadavg()[0]
    one, two, bare = run(source, out, "--workers", "1"), run(source, out, "--workers", "2"), alone(source, out)
    print(f"{count} logs of 10 s at 1 kHz; {os.cpu_count()} cores, load {load:.1f} to {os.getloadavg()[0]:.1f}.")
    print("\n| what | asked | measured |\n|---|---|---|")
    print(f"| two workers over one | ≥ 1.8 | {one / two:.2f} ({one:.1f} s, {two:.1f} s) |")
    print(f"| overhead of one worker beyond identification | ≤ 15 % | {100 * (one / bare - 1):.0f} % ({bare:.1f} s) |")
    with dask(2):
        cluster = run(source, out, "--scheduler", f"tcp://127.0.0.1:{PORT}")
    print(
        f"| Dask's two workers over the process pool's | ≥ 0.85 | {two / cluster:.2f} ({cluster:.1f} s) |", flush=True
    )
    small = folder / "small"
    small.mkdir()
    for path in sorted(source.iterdir())[:12]:
        shutil.copy(path, small)
    seconds = run(small, out, "--workers", "2")
    told = "the same bytes" if kills(small, out, killed, seconds) else "DIFFERENT"
    print(f"| {killed} kills of parent and workers | as undisturbed | {told} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
