"""Long logs with gaps: what inspecting, converting and tracking them takes.

Usage: python -m pipelines.bench_long [FOLDER] [SAMPLES]

Processor time and wall time of each, beside what polars takes to read the same CSV and do nothing
else, and of a track how they grow from half the gaps to all of them.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from algid.log import Log, Origin
from algid.writers import write_log

SAMPLES = 10_000_000
GAPS = 2_000
HOUR_AT_100_HZ, HOUR_GAPS = 360_000, 720


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench-long")
    samples = int(sys.argv[2]) if len(sys.argv) > 2 else SAMPLES
    folder.mkdir(parents=True, exist_ok=True)
    log, text = folder / "long.parquet", folder / "long.csv"
    long = moving(samples, GAPS, 1000.0)
    for path in (log, text):
        write_log(path, long)
    del long
    read = f"import polars; print(polars.read_csv({str(text)!r}).height)"
    print(f"polars.read_csv {samples:.0e} rows: {spent_by('-c', read)}", flush=True)
    for name, arguments in (
        (f"inspect {samples:.0e} rows of CSV, {GAPS} gaps", ("inspect", text)),
        (f"inspect {samples:.0e} rows of Parquet, {GAPS} gaps", ("inspect", log)),
        (
            f"convert {samples:.0e} rows to MCAP",
            ("convert", log, "-o", folder / "long.mcap", "--force"),
        ),
    ):
        print(f"{name}: {timed(*arguments)}", flush=True)
    arm = folder / "arm.csv"
    write_log(arm, moving(30_000, 0, 1000.0))
    timed(
        "identify",
        arm,
        "-o",
        folder,
        "--force",
        "--no-report",
        "-q",
        "--estimator",
        "weak",
        "--model",
        "plain",
    )
    lengths = ("--l1", "0.16", "--l2", "0.12")
    for gaps in (HOUR_GAPS // 2, HOUR_GAPS):
        hour = folder / f"hour-{gaps}.parquet"
        write_log(hour, moving(HOUR_AT_100_HZ, gaps, 100.0))
        spent = timed(
            "track",
            hour,
            "--parameters",
            folder / "arm.algid",
            *lengths,
            "-o",
            folder,
            "--force",
            "-q",
        )
        print(f"track an hour at 100 Hz, {gaps} gaps: {spent}", flush=True)


def moving(samples: int, gaps: int, rate: float) -> Log:
    """An arm of k = 0.05, 0.5 and the like on smooth motion, with noise, and gaps of 50 periods
    evenly spread.
    """
    from algid.arm import regressor

    t = np.arange(samples) / rate
    draw = np.random.default_rng(1)
    theta = np.stack([0.8 * np.sin(2.1 * t) + 0.3 * np.sin(5.3 * t) - 1.5, 0.7 * np.cos(3.3 * t)])
    omega = np.stack([1.68 * np.cos(2.1 * t) + 1.59 * np.cos(5.3 * t), -2.31 * np.sin(3.3 * t)])
    alpha = np.stack([-3.528 * np.sin(2.1 * t) - 8.427 * np.sin(5.3 * t), -7.623 * np.cos(3.3 * t)])
    k = np.array([0.012, 0.5, 0.01, 1.5, 0.05, 0.2, 0.15])
    tau = np.empty((2, samples))
    for first in range(0, samples, 1 << 18):
        part = slice(first, first + (1 << 18))
        tau[:, part] = np.einsum(
            "ij...,j->i...", regressor(theta[:, part], omega[:, part], alpha[:, part]), k
        )
    stamp_ns = np.round(t * 1e9).astype(np.int64)
    if gaps:
        lost = np.zeros(samples, dtype=np.int64)
        lost[np.linspace(0, samples - 1, gaps + 2).astype(int)[1:-1]] = round(50e9 / rate)
        stamp_ns += np.cumsum(lost)
    theta = theta + 1e-4 * draw.standard_normal(theta.shape)
    return Log(stamp_ns, theta, tau + 1e-2 * draw.standard_normal(tau.shape), Origin("", "", {}))


def timed(*arguments: object) -> str:
    """Wall and processor time of a call of algid."""
    return spent_by("-m", "algid", *map(str, arguments))


def spent_by(*arguments: str) -> str:
    """Wall and processor time of a call of Python."""
    command = [sys.executable, *arguments]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3, 4):
        raise RuntimeError(f"{command}: {done.returncode}: {done.stderr[-500:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return (
        f"{time.perf_counter() - start:.1f} s, {spent:.1f} s of processors, at most "
        f"{after.ru_maxrss >> 10} MB so far"
    )


if __name__ == "__main__":
    main()
