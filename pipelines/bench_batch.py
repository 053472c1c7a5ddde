"""Throughput of batches on one and two workers and on Dask, overhead beyond identification, and
kills.

Usage: python -m pipelines.bench_batch FOLDER [LOGS [KILLS]]

The machine's load is printed beside the figures: on a shared machine they say less. Processor time
says more there, though not all: idle processes of Dask take 2 % of a core each, for as long as the
others let the batch last.
"""

from __future__ import annotations

import hashlib
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from algid import synthesise
from algid.base.runtime import keep_freed, keep_to_one_core
from algid.batches.workers import THREADS
from algid.identification.identify import identify
from algid.writers import write_log

BATCH = [sys.executable, "-m", "algid", "batch"]
with socket.socket() as _free:
    _free.bind(("127.0.0.1", 0))
    PORT = _free.getsockname()[1]
CLUSTER = {
    **dict.fromkeys(THREADS, "1"),
    # sampling of stacks takes some 6 % of a worker's processor time
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
}
ADDRESS = f"tcp://127.0.0.1:{PORT}"
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
    start = time.perf_counter()
    subprocess.run([*BATCH, str(source), "-o", str(out), "--no-report", "-q", *flags], check=True)
    return time.perf_counter() - start


def spent(who: int, pids: Iterable[int] = ()) -> float:
    """Processor seconds so far: of this process or of its children that have ended, and of others
    that run.
    """
    own = resource.getrusage(who)
    fields = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids]
    ticks = sum(int(one[11]) + int(one[12]) for one in fields)
    return own.ru_utime + own.ru_stime + ticks / os.sysconf("SC_CLK_TCK")


def alone(source: Path, out: Path) -> float:
    """Seconds of identification alone, in this process with one thread."""
    shutil.rmtree(out, ignore_errors=True)
    paths = sorted(source.iterdir())
    keep_freed()  # as workers do
    keep_to_one_core()
    start = time.perf_counter()
    for path in paths:
        identify(path, out=out, report=False)
    return time.perf_counter() - start


@contextmanager
def dask(workers: int, folder: Path) -> Iterator[Dask]:
    """A scheduler and workers of this machine; what they say goes to files in `folder`."""
    cluster = Dask(folder)
    try:
        cluster.start("scheduler", "--host", "127.0.0.1", "--port", str(PORT), until="Scheduler at")
        for _ in range(workers):
            cluster.add_worker()
        yield cluster
    finally:
        for process in cluster.running:
            process.kill()
            process.wait()


class Dask:
    """Processes of a cluster: the scheduler first, then the workers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.running: list[subprocess.Popen[bytes]] = []
        folder.mkdir(parents=True, exist_ok=True)

    def add_worker(self) -> None:
        """Start a worker of one thread, and wait until the scheduler knows it."""
        self.start("worker", ADDRESS, "--nthreads", "1", "--no-nanny", until="Registered to")

    def kill_a_worker(self, instants: random.Random) -> None:
        """Kill one, and start another in its place."""
        victim = instants.choice(self.running[1:])
        victim.kill()
        victim.wait()
        self.running.remove(victim)
        self.add_worker()

    def start(self, kind: str, *flags: str, until: str) -> None:
        """Start a process, and wait for what it says when it is ready."""
        code = f"from distributed.cli import dask_{kind}; dask_{kind}.main()"
        said = self.folder / f"{kind}{time.monotonic_ns()}.txt"
        with said.open("wb") as stream:
            command = [sys.executable, "-c", code, *flags, "--no-dashboard"]
            self.running.append(
                subprocess.Popen(
                    command, env={**os.environ, **CLUSTER}, stdout=stream, stderr=stream
                )
            )
        end = time.monotonic() + 60
        while until not in said.read_text():
            if time.monotonic() > end or self.running[-1].poll() is not None:
                raise RuntimeError(f"the {kind} does not start: {said.read_text()[-2000:]}")
            time.sleep(0.05)


def digest(out: Path) -> str:
    """Hash of all results, the table without its durations, and what is left half-written."""
    found = hashlib.sha256()
    for path in sorted(out.rglob("result.json")):
        found.update(path.read_bytes())
    found.update(pl.read_parquet(out / "jobs.parquet").drop("seconds").write_json().encode())
    found.update(str([p for p in out.rglob(".*") if p.name != ".jobs"]).encode())
    return found.hexdigest()


def kills(source: Path, out: Path, count: int, seconds: float) -> list[tuple[str, int, bool]]:
    """Kill batches `count` times at random instants: whom, how often, and whether all ended as
    undisturbed ones.

    A batch whose parent was killed is run again, and killed again, until one ends.
    """
    whole = out.with_name("whole")
    run(source, whole, "--workers", "2")
    expected = digest(whole)
    share = count // 4
    pool = ("--workers", "2")
    found = [
        (
            "the parent",
            count - 3 * share,
            _survives(source, out, pool, count - 3 * share, seconds, kill, expected),
        ),
        (
            "a worker of the pool",
            share,
            _survives(source, out, pool, share, seconds, kill_a_worker, expected),
        ),
    ]
    with dask(2, out.with_name("dask")) as cluster:
        flags = ("--scheduler", ADDRESS)
        seconds = max(seconds, run(source, out, *flags))

        def kill_of_cluster(_parent: int, instants: random.Random) -> None:
            cluster.kill_a_worker(instants)

        for whom, killing in (
            ("the parent of a Dask batch", kill),
            ("a Dask worker", kill_of_cluster),
        ):
            found.append(
                (whom, share, _survives(source, out, flags, share, seconds, killing, expected))
            )
    return found


def _survives(
    source: Path,
    out: Path,
    flags: tuple[str, ...],
    count: int,
    seconds: float,
    killing: Callable[[int, random.Random], None],
    expected: str,
) -> bool:
    instants = random.Random(0)
    command = [*BATCH, str(source), "-o", str(out), "--no-report", "-q", *flags]
    shutil.rmtree(out, ignore_errors=True)
    same = True
    for _ in range(count):
        if (out / "jobs.parquet").exists():
            shutil.rmtree(out)
        batch = subprocess.Popen(command)
        time.sleep(instants.uniform(0.2, 1.0) * seconds)
        killing(batch.pid, instants)
        if batch.wait() == 0:
            same &= digest(out) == expected
        elif batch.returncode != -signal.SIGKILL:
            same = False
    subprocess.run(command, check=True)
    return same and digest(out) == expected


def kill(parent: int, _instants: random.Random) -> None:
    """Kill the batch itself, unless it has ended."""
    if Path(f"/proc/{parent}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
        os.kill(parent, signal.SIGKILL)


def kill_a_worker(parent: int, instants: random.Random) -> None:
    """Kill one of the processes that work for the batch `parent`."""
    tasks = Path(f"/proc/{parent}/task")
    with suppress(OSError):  # it may end meanwhile
        found = [
            int(c) for task in tasks.iterdir() for c in (task / "children").read_text().split()
        ]
        working = [
            pid for pid in found if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
        ]
        if not working:
            return
        os.kill(instants.choice(working), signal.SIGKILL)


def turn(source: Path, out: Path, folder: Path) -> tuple[float, ...]:
    """Seconds of one worker, of two, of identification alone and of its processor time, of Dask's
    two and of all their processor time.
    """
    one, two = run(source, out, "--workers", "1"), run(source, out, "--workers", "2")
    before = spent(resource.RUSAGE_SELF)
    bare = alone(source, out)
    ideal = spent(resource.RUSAGE_SELF) - before
    with dask(2, folder) as running:
        pids = [process.pid for process in running.running]
        before = spent(resource.RUSAGE_CHILDREN, pids)
        cluster = run(source, out, "--scheduler", ADDRESS)
        used = spent(resource.RUSAGE_CHILDREN, pids) - before
    return one, two, bare, ideal, cluster, used


def main(folder: Path, count: int = 1000, killed: int = 50) -> None:
    """Print a Markdown table."""
    shutil.rmtree(folder, ignore_errors=True)
    source, out = logs(folder / "logs", count), folder / "out"
    load = os.getloadavg()[0]
    turns = [turn(source, out, folder / f"dask{number}") for number in range(TURNS)]
    one, two, bare, ideal, cluster, used = (min(costs) for costs in zip(*turns, strict=True))
    print(
        f"{count} logs of 10 s at 1 kHz, the least of {TURNS} turns; {os.cpu_count()} cores, load "
        f"{load:.1f} to {os.getloadavg()[0]:.1f}."
    )
    print("\n| what | asked | measured |\n|---|---|---|")
    print(f"| two workers over one | ≥ 1.8 | {one / two:.2f} ({one:.1f} s, {two:.1f} s) |")
    print(
        f"| overhead of one worker beyond identification | ≤ 15 % | {100 * (one / bare - 1):.0f} "
        f"% ({bare:.1f} s) |"
    )
    print(
        f"| Dask's two workers over the process pool's | ≥ 0.95 | {two / cluster:.2f} "
        f"({cluster:.1f} s) |"
    )
    share = f"{ideal / used:.2f} ({ideal:.1f} s of {used:.1f} s)"
    print(
        f"| processor time of identification over all that Dask's batch takes | ≥ 0.95 | {share} |",
        flush=True,
    )
    small = folder / "small"
    small.mkdir()
    for path in sorted(source.iterdir())[:12]:
        shutil.copy(path, small)
    seconds = run(small, out, "--workers", "2")
    for whom, times, same in kills(small, out, killed, seconds):
        outcome = "the same bytes" if same else "DIFFERENT"
        print(
            f"| {times} kills of {whom} at random instants | as undisturbed | {outcome} |",
            flush=True,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
