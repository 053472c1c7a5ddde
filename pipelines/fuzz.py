"""Read damaged and hostile logs.

Fail on a traceback, a hang, much memory, or a wrong result without a word.

Usage: python -m pipelines.fuzz [FILES] [SEED]

A batch goes over every one of the hostile files too, and has to end with a result or a reason for
each.

So many files with damaged bytes (`pipelines.mutations`) and as many that lie by their structure
(`pipelines.hostile`).
"""

from __future__ import annotations

import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl

from algid.base.errors import LogError
from algid.log import Log
from algid.readers import read_log
from pipelines.hostile import corpus
from pipelines.hostile.others import other_files
from pipelines.mutations import clean_files, clean_log, damage

FILES = 20_000
_BATCH = 500
_SECONDS = 5.0
_MEMORY = 1 << 30
# it is the batch that is tried, not the choice of a model
_QUICK = (
    "--estimator",
    "weak",
    "--model",
    "plain",
)
FAILURES = ("crash", "traceback", "hang", "silent")


def main() -> int:
    """Run batches in processes of their own, so that a crash is a finding and not the end."""
    files = int(sys.argv[1]) if len(sys.argv) > 1 else FILES
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    failed = 0
    for source in ("damaged", "hostile"):
        total: Counter[str] = Counter()
        memory, slowest = 0, 0.0
        for first in range(seed, seed + files, _BATCH):
            command = [
                sys.executable,
                "-m",
                "pipelines.fuzz",
                source,
                str(first),
                str(min(_BATCH, seed + files - first)),
            ]
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=_BATCH * _SECONDS, check=False
            )
            if done.returncode != 0:
                total["crash"] += 1
                print(
                    f"{source}, seed {first}: crashed with {done.returncode}\n{done.stderr[-2000:]}"
                )
            for line in done.stdout.splitlines():
                kind, _, text = line.partition("\t")
                if kind == "memory":
                    memory = max(memory, int(text))
                elif kind == "slowest":
                    slowest = max(slowest, float(text))
                elif kind.startswith("count "):
                    total[kind.removeprefix("count ")] += int(text)
                else:
                    print(line, flush=True)
        print(
            f"{files} {source} files: {dict(total)}; at most {memory >> 20} MB, {slowest:.2f} s",
            flush=True,
        )
        failed += sum(total[kind] for kind in FAILURES) + (memory > _MEMORY)
    failed += batches(files, seed)
    return int(failed > 0)


def batches(files: int, seed: int) -> int:
    """Have ``algid batch`` go over the hostile files, `_BATCH` at a time.

    How many of these runs were no good.
    """
    failed = 0
    total: Counter[str] = Counter()
    for first in range(seed, seed + files, _BATCH):
        count = min(_BATCH, seed + files - first)
        with tempfile.TemporaryDirectory(prefix="algid-fuzz-") as place:
            logs, out = Path(place, "logs"), Path(place, "out")
            logs.mkdir()
            names = {path.name for path, _ in corpus(logs, count, first)}
            command = [
                sys.executable,
                "-m",
                "algid",
                "batch",
                str(logs),
                "-o",
                str(out),
                "--no-report",
                "-q",
                *_QUICK,
            ]
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=_BATCH * _SECONDS, check=False
            )
            jobs = (
                pl.read_parquet(out / "jobs.parquet")
                if (out / "jobs.parquet").exists()
                else pl.DataFrame()
            )
            wrong = (
                done.returncode not in (0, 1, 3)
                or "Traceback" in done.stderr
                or jobs.height != len(names)
            )
            failed += wrong
            if wrong:
                print(
                    f"batch over hostile, seed {first}: exit {done.returncode}, {jobs.height} of "
                    f"{len(names)} jobs"
                )
                print(done.stderr[-2000:], flush=True)
            total.update(jobs["status"].to_list() if jobs.height else [])
    print(f"algid batch over {files} hostile files: {dict(total)}", flush=True)
    return failed


def batch(source: str, seed: int, files: int) -> int:
    """Read so many files and print what came of them."""
    counts: Counter[str] = Counter()
    slowest = 0.0
    folder = Path(tempfile.mkdtemp(prefix="algid-fuzz-"))
    try:
        for name, path, log, rows in (
            _damaged(folder, seed, files) if source == "damaged" else _hostile(folder, seed, files)
        ):
            # a busy machine is no hang; one that waits is ended with its batch
            start = time.process_time()
            kind, text = outcome(path, log, rows)
            seconds = time.process_time() - start
            slowest = max(slowest, seconds)
            kind = "hang" if seconds > _SECONDS else kind
            counts[kind] += 1
            if kind in FAILURES:
                print(f"{kind}\t{name}: {text} ({seconds:.1f} s)", flush=True)
    finally:
        shutil.rmtree(folder)
    for kind, count in counts.items():
        print(f"count {kind}\t{count}")
    print(
        f"slowest\t{slowest}\nmemory\t{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}"
    )
    return 0


_Case = tuple[str, Path, Log | None, int]
"""A file's name for the report, its path, and what `outcome` is told of it."""


def _damaged(folder: Path, seed: int, files: int) -> Iterator[_Case]:
    clean: list[tuple[Path, bytes, Log | None, int]] = []
    clean += [(path, path.read_bytes(), read_log(path), 0) for path in clean_files(folder)]
    other = clean_log(150)
    clean += [(path, path.read_bytes(), None, len(other)) for path in other_files(folder, other)]
    for number in range(files):
        path, content, log, rows = clean[number % len(clean)]
        path.write_bytes(damage(content, random.Random(seed + number)))
        yield f"{path.name} seed {seed + number} of batch {seed}", path, log, rows


def _hostile(folder: Path, seed: int, files: int) -> Iterator[_Case]:
    for path, one in corpus(folder, files, seed):
        yield path.name, path, one.log, 0
        path.unlink()


def outcome(path: Path, log: Log | None, rows: int = 0) -> tuple[str, str]:
    """What comes of a file: "same", "told", "refused", or one of `FAILURES`; and more of it.

    `log` is what stands in the file unless it is said otherwise; None where any answer is right
    that is one. Fewer samples than `rows` must be called a loss even there, but for those that
    stand in the file twice and are the same.
    """
    try:
        found = read_log(path)
    except LogError as error:
        return ("refused", "") if "\n" not in str(error) else ("traceback", "more than one line")
    except BaseException as error:
        return "traceback", f"{type(error).__name__}: {error}"[:400]
    if log is None:
        if path.suffix == ".jsonl":  # where nothing tells of lines that are gone
            rows = sum(1 for line in path.read_bytes().split(b"\n") if line.strip())
        twice = [one for one in found.notices if one.code == "UNEVEN_STAMPS"]
        kept = len(found) + sum(int(one.text.split()[0].replace(",", "")) for one in twice)
        lost = kept < rows and not any(notice.lossy for notice in found.notices)
        return ("silent", f"{len(found)} samples of {rows}") if lost else ("read", "")
    return _compared(found, log)


def _compared(found: Log, log: Log) -> tuple[str, str]:
    """A log that lacks samples must call that a loss; other values must be noticed."""
    names = ("stamp_ns", "theta", "tau", "omega")
    same = all(_equal(getattr(found, name), getattr(log, name)) for name in names)
    if same and found.origin.truth == log.origin.truth:
        return "same", ""
    if len(found) < len(log) and np.isin(found.stamp_ns, log.stamp_ns).all():
        noticed = any(notice.lossy for notice in found.notices)
    else:
        noticed = bool(found.notices)
    return (
        ("told", "")
        if noticed
        else ("silent", f"{len(found)} samples of {len(log)}, truth {found.origin.truth}")
    )


def _equal(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    return one is other or (
        one is not None and other is not None and one.tobytes() == other.tobytes()
    )


if __name__ == "__main__":
    if len(sys.argv) > 3:
        sys.exit(batch(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
    sys.exit(main())
