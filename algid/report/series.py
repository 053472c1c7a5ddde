"""Series of a result's folder in blocks of bounded memory, and short enough to draw.

A bucket of samples leaves its smallest and its largest value; buckets end where a block or a log
does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.arrow import numbers_of
from algid.base.blocks import concatenated, rows_of
from algid.base.criteria import CUT
from algid.base.errors import ResultError
from algid.base.progress import Progress
from algid.base.quantiles import median

Block = dict[str, FloatArray]
ROWS = 1 << 18
POINTS = 2_400
"""Of a series: twice what a page is wide."""
SAMPLES = 2_000
MOTION = ("t", "theta1", "theta2", "omega1", "omega2")
GOLDEN = 0.6180339887498949


@contextmanager
def _parquet(path: Path) -> Iterator[Any]:
    """The file, open; raises `ResultError` for what is no Parquet file that can be read."""
    import pyarrow.lib
    import pyarrow.parquet

    try:
        # without pre_buffer=False the file is kept in memory as it is read
        with pyarrow.parquet.ParquetFile(path, pre_buffer=False) as file:
            yield file
    except (OSError, pyarrow.lib.ArrowException) as error:
        reason = str(error).partition("\n")[0]
        text = f"{path}: cannot read it as Parquet ({reason}); identify again with this version"
        raise ResultError(text) from error


def blocks(path: Path, names: Sequence[str] = (), rows: int = ROWS) -> Iterator[Block]:
    """Yield columns `names` of `path`, by default all, `rows` samples at a time.

    What is missing is NaN.

    Raises
    ------
    ResultError
        If the file cannot be read, or lacks a column.
    """
    with _parquet(path) as file:
        missing = [name for name in names if name not in file.schema_arrow.names]
        if missing:
            again = "identify again with this version"
            raise ResultError(f"{path}: it has no column {missing[0]!r}; {again}")
        for batch in file.iter_batches(batch_size=rows, columns=list(names) or None):
            yield {name: numbers_of(batch.column(name)) for name in batch.schema.names}


def by_log(found: Iterator[Block]) -> Iterator[tuple[int, Block]]:
    """Split blocks where their column ``log`` changes: pairs of log and its stretch."""
    for block in found:
        log = block.get("log", np.zeros(block["t"].size))
        edges = [0, *(np.flatnonzero(np.diff(log)) + 1).tolist(), log.size]
        for first, last in pairwise(edges):
            if last > first:
                yield int(log[first]), rows_of(block, slice(first, last))


def table(path: Path) -> dict[str, NDArray[Any]]:
    """The columns of a small file, none where it is not there. Raises `ResultError`."""
    if not path.is_file():
        return {}
    with _parquet(path) as file:
        return {name: np.array(values) for name, values in file.read().to_pydict().items()}


def facts_of(path: Path) -> tuple[list[str], int, dict[bytes, bytes]]:
    """Names of the columns, rows, and metadata of `path`. Raises `ResultError`."""
    with _parquet(path) as file:
        return file.schema_arrow.names, file.metadata.num_rows, file.schema_arrow.metadata or {}


@dataclass(frozen=True, eq=False)
class Drawn:
    """Every column in few rows, the smallest and the largest value of each bucket in turn.

    Parameters
    ----------
    columns : with `x`, the time that runs on from log to log, s, and NaN rows where a line breaks
    samples : of angles and velocities, whole rows spread evenly over the logs
    worst : of either joint the largest residual, when in s, and in which log
    """

    columns: Block
    samples: Block
    worst: tuple[tuple[float, float, int], ...]

    def __getitem__(self, name: str) -> FloatArray:
        return self.columns[name]

    @property
    def starts(self) -> dict[int, float]:
        """Where each log begins on the axis `x`."""
        places = np.flatnonzero(np.diff(self["log"], prepend=-1))
        return {int(self["log"][place]): float(self["x"][place]) for place in places}


def drawn(path: Path, points: int = POINTS, progress: Progress | None = None) -> Drawn | None:
    """Every column of `path` in at most about `points` rows, broken at gaps and between logs.

    None where there is no such file. `progress` hears how many samples have been read.

    Raises
    ------
    ResultError
        If the file cannot be read, or holds no rows.
    """
    if not path.is_file():
        return None
    total = facts_of(path)[1]
    bucket = max(1, -(-2 * total // points))
    step = max(1, total // SAMPLES)
    parts, samples, periods, done = list[Block](), list[Block](), [0.0], 0
    worst = [(0.0, 0.0, 0)] * 2
    for log, part in by_log(blocks(path)):
        with_residuals(part)
        t = part["t"]
        part["log"] = np.full(t.size, float(log))
        if t.size > 1:
            periods.append(median(np.diff(t)))
        for joint, before in enumerate(worst, start=1):
            size = np.abs(np.nan_to_num(part.get(f"residual{joint}", np.zeros(1))))
            place = int(size.argmax())
            worst[joint - 1] = max(before, (float(size[place]), float(t[place]), log))
        # which sample of a stretch moves by the golden ratio: never in step with the motion
        at = np.arange(0, t.size, step)
        at = np.minimum(at + (step * np.mod(at / step * GOLDEN, 1)).astype(int), t.size - 1)
        samples.append({name: part[name][at] for name in ("log", *MOTION) if name in part})
        parts.append(reduced(part, bucket))
        done += t.size
        if progress is not None:
            progress("report", done, total)
    if not parts:
        raise ResultError(f"{path}: it holds no rows; identify again with this version")
    columns = concatenated(parts)
    columns["x"], end = columns["t"].copy(), None
    for log in np.unique(columns["log"]):
        own = columns["log"] == log
        if end is not None:
            columns["x"][own] += 1.01 * end - columns["t"][own][0]
        end = columns["x"][own].max()
    apart = np.diff(columns["t"]) > CUT * bucket * max(periods)
    broken = np.flatnonzero(apart | (np.diff(columns["log"]) > 0)) + 1
    for name, values in columns.items():
        nothing = values[broken - 1] if name in ("log", "x") else np.nan
        columns[name] = np.insert(values, broken, nothing)
    return Drawn(columns, concatenated(samples), tuple(worst))


def reduced(part: Block, size: int) -> Block:
    """Smallest and largest of each `size` samples, in turn."""
    if size <= 2:
        return part
    at = np.arange(0, part["t"].size, size)
    short = {}
    for name, values in part.items():
        low, high = np.fmin.reduceat(values, at), np.fmax.reduceat(values, at)
        short[name] = np.stack([low, high], axis=1).ravel()
    return short


def between(path: Path, log: int, low: float, high: float) -> Block:
    """Every sample of a log with t in [low, high]; row groups elsewhere are not read."""
    with _parquet(path) as file:  # a filter would import datasets, and pandas where it is found
        names, wanted = file.schema_arrow.names, []
        for group in range(file.num_row_groups):
            columns = file.metadata.row_group(group)
            logs, times = (columns.column(names.index(of)).statistics for of in ("log", "t"))
            if logs.min <= log <= logs.max and times.min <= high and times.max >= low:
                wanted.append(group)
        rows = file.read_row_groups(wanted)
        block = {name: numbers_of(rows[name].combine_chunks()) for name in rows.column_names}
    near = (block["log"] == log) & (block["t"] >= low) & (block["t"] <= high)
    return with_residuals(rows_of(block, near))


def with_residuals(part: Block) -> Block:
    """The block with what the prediction leaves of each torque, where it holds one."""
    for joint in (1, 2):
        if f"tau{joint}_predicted" in part:
            part[f"residual{joint}"] = part[f"tau{joint}"] - part[f"tau{joint}_predicted"]
    return part
