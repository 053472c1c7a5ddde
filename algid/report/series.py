"""Series of a result's folder in blocks of bounded memory, and short enough to draw.

A bucket of samples leaves its smallest and its largest value; buckets end where a block or a log
does.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.arrow import numbers_of
from algid.base.criteria import CUT
from algid.base.errors import ResultError
from algid.base.names import concatenated, rows_of
from algid.base.progress import Progress
from algid.base.quantiles import median

Block = dict[str, FloatArray]
AGAIN = "identify again with this version"
ROWS = 1 << 18
POINTS = 2_400
"""Of a series: twice what a page is wide."""
SAMPLES = 2_000
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
        raise ResultError(f"{path}: cannot read it as Parquet ({reason}); {AGAIN}") from error


def stretches(
    path: Path, stage: str, progress: Progress | None = None, rows: int = ROWS
) -> Iterator[tuple[int, Block]]:
    """Pairs of a log and its stretch of a block, with what a prediction leaves of the torque.

    What is missing is NaN. `progress` hears how many samples have been used. Raises `ResultError`.
    """
    done = 0
    with _parquet(path) as file:
        for batch in file.iter_batches(batch_size=rows):
            block = {name: numbers_of(batch.column(name)) for name in batch.schema.names}
            for joint in (1, 2):
                if f"tau{joint}_predicted" in block:
                    left = block[f"tau{joint}"] - block[f"tau{joint}_predicted"]
                    block[f"residual{joint}"] = left
            logs = block.setdefault("log", np.zeros(block["t"].size))
            firsts = np.flatnonzero(np.diff(logs, prepend=-1)).tolist()
            for first, last in pairwise([*firsts, logs.size]):
                yield int(logs[first]), rows_of(block, slice(first, last))
            done += logs.size
            if progress is not None:
                progress(stage, done, file.metadata.num_rows)


def table(path: Path) -> dict[str, NDArray[Any]]:
    """Texts and numbers of a small file by column, none where it is not there.

    Raises `ResultError`.
    """
    if not path.is_file():
        return {}
    with _parquet(path) as file:
        columns = file.read().to_pydict().items()
    return {name: np.array(of, None if str in map(type, of) else float) for name, of in columns}


def facts_of(path: Path) -> tuple[int, dict[bytes, bytes]]:
    """How many rows `path` has, and its metadata. Raises `ResultError`."""
    with _parquet(path) as file:
        return file.metadata.num_rows, file.schema_arrow.metadata or {}


@dataclass(frozen=True, eq=False)
class Drawn:
    """Every column in few rows, the smallest and the largest value of each bucket in turn.

    Parameters
    ----------
    columns : with `x`, the time that runs on from log to log, s, and NaN rows where a line breaks
    starts : where each log begins on the axis `x`
    samples : whole rows spread evenly over the logs
    """

    columns: Block
    starts: dict[int, float]
    samples: Block

    def __getitem__(self, name: str) -> FloatArray:
        return self.columns[name]


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
    total, _ = facts_of(path)
    bucket, step = max(1, -(-2 * total // points)), max(1, total // SAMPLES)
    parts, samples = list[Block](), list[Block]()
    period, starts = 0.0, dict[int, float]()
    for log, part in stretches(path, "report", progress):
        t = part["t"]
        if log not in starts:  # a hundredth is left between logs
            starts[log] = 1.01 * float(parts[-1]["x"][-1]) if parts else float(t[0])
            shift = starts[log] - t[0]
        part["x"] = t + shift
        period = max(period, median(np.diff(t)))  # NaN, of one sample, is not larger
        # which sample of a stretch moves by the golden ratio: never in step with the motion
        at = np.arange(-(-t.size // step))
        at = np.minimum((step * (at + np.mod(at * GOLDEN, 1))).astype(int), t.size - 1)
        samples.append(rows_of(part, at))
        parts.append(reduced(part, bucket))
    if not parts:
        raise ResultError(f"{path}: it holds no rows; {AGAIN}")
    columns = concatenated(parts)
    apart = np.diff(columns["t"]) > CUT * bucket * period
    broken = np.flatnonzero(apart | (np.diff(columns["log"]) > 0)) + 1
    for name, values in columns.items():
        nothing = values[broken - 1] if name in ("log", "x") else np.nan
        columns[name] = np.insert(values, broken, nothing)
    return Drawn(columns, starts, concatenated(samples))


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
