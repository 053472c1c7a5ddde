"""Damaged and hostile logs, read one by one and by a batch: sources of `pipelines.fuzz`."""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl

from algid.base.errors import LogError
from algid.log import Log
from algid.readers import read_log
from pipelines.hostile import corpus
from pipelines.mutations import damage
from tests.golden.files import sounds

FILES = 500  # of a folder
# it is the batch that is tried, not the choice of a model
QUICK = ("--estimator", "weak", "--model", "plain", "--no-report", "-q")


def sound_files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Every kind of sound file that is one file and needs no settings, by what it is."""
    for number, one in enumerate(sounds()):
        place = folder / str(number)
        place.mkdir(parents=True)
        made = one.make(place)
        if isinstance(made, Path) and made.is_file():
            yield one.name, made


def damaged(folder: Path, seeds: range) -> Iterator[Callable[[], tuple[str, str]]]:
    """Logs of every format with damaged bytes."""
    clean: list[tuple[Path, bytes, Log | None, int]] = []
    with tempfile.TemporaryDirectory(dir=folder) as place:
        for kind, path in sound_files(Path(place)):
            log, content = read_log(path), path.read_bytes()
            if "truth" in kind:  # with a sum of all its values: a quarter of the cases
                clean += [(path, content, log, 0)] * 8
            else:
                told = log.origin.format in ("feather", "npz", "mat", "hdf5", "jsonl", "bag")
                clean.append((path, content, None, len(log) * told))
        for seed in seeds:
            path, content, known, rows = clean[seed % len(clean)]
            path.write_bytes(damage(content, random.Random(seed)))
            yield partial(outcome, path, known, rows)


def hostile(folder: Path, seeds: range) -> Iterator[Callable[[], tuple[str, str]]]:
    """Logs that lie by their structure."""
    for path, one in corpus(folder, len(seeds), seeds.start):
        yield partial(outcome, path, one.log)
        path.unlink()


def folders(folder: Path, seeds: range) -> Iterator[Callable[[], tuple[str, str]]]:
    """Folders of hostile logs that a batch goes over."""
    for seed in seeds:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            yield partial(_batch, Path(place), seed)


def _batch(place: Path, seed: int) -> tuple[str, str]:
    """A batch ends with a result or a reason for each log."""
    logs, out = place / "logs", place / "out"
    logs.mkdir()
    names = {path.name for path, _ in corpus(logs, FILES, FILES * seed)}
    command = [sys.executable, "-m", "algid", "batch", str(logs), "-o", str(out), *QUICK]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    table = out / "jobs.parquet"
    jobs = pl.read_parquet(table).height if table.exists() else 0
    if done.returncode not in (0, 1, 3) or "Traceback" in done.stderr or jobs != len(names):
        why = f"exit {done.returncode}, {jobs} of {len(names)} jobs: {done.stderr[-2000:]}"
        return "lost", why
    return "done", ""


def outcome(path: Path, log: Log | None, rows: int = 0) -> tuple[str, str]:
    """What comes of a file: "same", "told", "refused", "read", or what is no good; and more of it.

    `log` is what stands in the file unless it is said otherwise; None where any answer is right
    that is one. Fewer samples than `rows` must be called a loss even there, but for those that
    stand in the file twice and are the same.
    """
    try:
        found = read_log(path)
    except LogError as error:
        return ("refused", "") if "\n" not in str(error) else ("lines", str(error))
    except Exception as error:
        return "traceback", f"{path.name}: {type(error).__name__}: {error}"[:400]
    lossy = any(notice.lossy for notice in found.notices)
    if log is None:
        if path.suffix == ".jsonl":  # where nothing tells of lines that are gone
            rows = sum(1 for line in path.read_bytes().split(b"\n") if line.strip())
        twice = [one for one in found.notices if one.code == "UNEVEN_STAMPS"]
        kept = len(found) + sum(int(one.text.split()[0].replace(",", "")) for one in twice)
        silent = kept < rows and not lossy
        return ("silent", f"{path.name}: {len(found)} of {rows}") if silent else ("read", "")
    names = ("stamp_ns", "theta", "tau", "omega")
    pairs = [(getattr(found, name), getattr(log, name)) for name in names]
    if found.origin.truth == log.origin.truth and all(_equal(*pair) for pair in pairs):
        return "same", ""
    # a log that lacks samples must call that a loss; other values must be noticed
    lacks = len(found) < len(log) and np.isin(found.stamp_ns, log.stamp_ns).all()
    if lossy if lacks else found.notices:
        return "told", ""
    return "silent", f"{path.name}: {len(found)} of {len(log)}, truth {found.origin.truth}"


def _equal(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    if one is None or other is None:
        return one is other
    return one.tobytes() == other.tobytes()
