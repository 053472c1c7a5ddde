"""Processor seconds, user and system, wall time and memory of algid as whole processes: the least
of interleaved runs.

    python -m pipelines.bench_processor -o build/bench --rounds 5 [--day]

Wall time is told beside the processor's: algid reads and hashes in threads. The real arm takes part
where `--data` is. `--day` takes a log of 24 h instead, 7 GB of disk. Writes processor.md or day.md.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import polars as pl

from pipelines.bench_ingest import medians
from pipelines.bench_logs import log

HOUR, MILLION, DAY = 3_600_000, 1_000_000, 86_400_000
MANY, MANY_ROWS = 300, 5000
DFKI = Path("dfki") / "C1_sysid"
BARE, WEAK = ("--no-report",), ("--no-report", "--estimator", "weak")
COLUMNS = ["stamp_ns", "theta1", "theta2", "tau1", "tau2"]

# A process inherits the peak memory of the one that starts it: a small one stands in between.
_LAUNCH = """
import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=sys.stderr).returncode
wall = time.perf_counter() - start
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([code, used.ru_utime + used.ru_stime, wall, used.ru_maxrss / 1024]))
"""


@dataclass
class Timed:
    """A command, what is asked of its processor seconds, in how many rounds it runs, and of each
    run its processor and wall time in s and its peak memory in MB, or why it failed.
    """

    command: list[str]
    asked: str = ""
    rounds: int = 99
    costs: list[list[float]] = field(default_factory=list)
    failed: str = ""

    def go(self) -> None:
        """Run to the end; BLAS keeps to one thread.

        Modules are compiled once, as they are where pip has installed them, even if the environment
        forbids it.
        """
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        launcher = [sys.executable, "-I", "-S", "-c", _LAUNCH, sys.executable, *self.command]
        done = subprocess.run(launcher, capture_output=True, text=True, env=environment, check=True)
        code, *cost = json.loads(done.stdout)
        if code in (0, 3):  # 3: algid tells that a constant could not be identified
            self.costs.append(cost)
        else:
            self.failed = (
                done.stderr.strip().rpartition("\n")[2].replace("|", "/") or f"exit {code}"
            )

    @property
    def least(self) -> list[float]:
        """The least of each cost."""
        return np.min(self.costs, axis=0).tolist() if self.costs else [np.nan] * 3


def identify(first: Path, out: Path, *flags: str) -> list[str]:
    """The command that identifies a log, with its page unless `flags` say otherwise."""
    return ["-m", "algid", "identify", str(first), "-o", str(out), "--force", "-q", *flags]


def commands(folder: Path, data: Path) -> dict[str, Timed]:
    """Everything that is timed; builds the logs."""
    second, ten, million, hour = (
        log(folder / f"{name}.parquet", rows)
        for name, rows in (("second", 1000), ("ten", 10_000), ("million", MILLION), ("hour", HOUR))
    )
    many = folder / "many"
    many.mkdir(exist_ok=True)
    paths = [log(many / f"log{n:03d}.parquet", MANY_ROWS, n) for n in range(MANY)]
    out, pair = folder / "out", ("--loaded", str(ten))
    together = ("--name", "many", *map(str, paths[1:]))
    found = {
        "python alone": Timed(["-c", "pass"]),
        "with numpy": Timed(["-c", "import numpy"]),
        "`--help`": Timed(["-m", "algid", "--help"]),
        "one-second log, no page": Timed(identify(second, out, *BARE), "≤ 0.45"),
        "the same, page": Timed(identify(second, out), "≤ 0.6"),
        "ten-second pair, no page": Timed(identify(ten, out, *pair, *BARE), "≤ 0.8"),
        "ten-second pair, page": Timed(identify(ten, out, *pair), "≤ 1.0"),
        "weak, a second": Timed(identify(second, out, *WEAK)),
        "weak, 1,000,000 samples": Timed(identify(million, out, *WEAK)),
        "refined, one hour at 1 kHz": Timed(identify(hour, out, *BARE), "≤ 11.2", 2),
        f"weak, {MANY} logs of 5 s": Timed(identify(paths[0], out, *WEAK, *together), "≤ 6", 2),
        f"refined, {MANY} logs of 5 s": Timed(identify(paths[0], out, *BARE, *together), "≤ 15", 2),
    }
    runs = sorted((data / DFKI).glob("*.csv"))
    if runs:
        flags = ("--zero", "hanging", "--name", "real", *map(str, runs[1:]))
        found["real arm, ten logs, no page"] = Timed(
            identify(runs[0], out, *BARE, *flags), "≤ 1.5", 3
        )
    return found


def day(folder: Path) -> dict[str, Timed]:
    """A day of log in both formats, weak and refined."""
    return {
        f"24 h at 1 kHz, {kind}, {estimator}": Timed(
            identify(
                log(folder / f"day.{kind}", DAY),
                folder / "out",
                "--no-report",
                "--estimator",
                estimator,
            ),
            "≤ 25, 500 MB" if estimator == "weak" else "1 GB",
            1,
        )
        for kind, estimator in product(("parquet", "mcap"), ("weak", "refined"))
    }


def main() -> None:
    """Build, run in turn, tell."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--out", type=Path, default=Path("build/bench"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--day", action="store_true")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    timed = day(given.out) if given.day else commands(given.out, given.data)
    load = os.getloadavg()[0]
    for number in range(given.rounds):
        for one in timed.values():
            if number < one.rounds and not one.failed:
                one.go()
    lines = ["| what | asked | processor s | wall s | peak, MB |", "|---|---|---|---|---|"]
    for what, one in timed.items():
        cpu, wall, peak = one.least
        shown = one.failed or f"{cpu:.3f} | {wall:.2f} | {peak:.0f}"
        lines.append(f"| {what} | {one.asked} | {shown} |")
    if not given.day:
        million = partial(pl.read_parquet, given.out / "million.parquet", columns=COLUMNS)
        own = timed["weak, 1,000,000 samples"].least[0] - timed["weak, a second"].least[0]
        ratio = own / medians(9, million)[0, 1]
        lines.append(f"| weak, 1,000,000 samples, to polars' reading | ≤ 10 | {ratio:.1f} | | |")
    lines.append(
        f"\n{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}; "
        f"load average before and after: {load:.1f}, {os.getloadavg()[0]:.1f}.\n"
    )
    (given.out / f"{'day' if given.day else 'processor'}.md").write_text(
        "\n".join(lines), encoding="utf-8"
    )
    print("\n".join(lines))


if __name__ == "__main__":
    main()
