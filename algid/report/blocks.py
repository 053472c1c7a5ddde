"""A folder's Parquet files in blocks of bounded memory, whatever the size of the log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.errors import ResultError

ROWS = 1 << 18

LARGEST = 1e100
"""Beyond this nothing of an arm is a number: squares would overflow."""

Block = dict[str, FloatArray]


def columns_of(path: Path) -> list[str]:
    """Names of the columns of `path`; raises `ResultError` where it cannot be read."""
    import pyarrow.lib
    import pyarrow.parquet

    try:
        return list(pyarrow.parquet.read_schema(path).names)
    except (OSError, pyarrow.lib.ArrowException) as error:
        raise _unreadable(path, error) from error


def blocks(path: Path, names: Sequence[str], rows: int = ROWS) -> Iterator[Block]:
    """Yield the columns `names` of `path`, `rows` samples at a time, missing values and those beyond `LARGEST` as NaN.

    Raises
    ------
    ResultError
        If the file cannot be read or lacks a column.
    """
    import pyarrow.lib
    import pyarrow.parquet

    absent = [name for name in names if name not in columns_of(path)]
    if absent:
        raise ResultError(f"{path}: expected a column {absent[0]!r}, found none; identify again with this version")
    try:
        # without pre_buffer=False the file is kept in memory as it is read
        with pyarrow.parquet.ParquetFile(path, pre_buffer=False) as file:
            for batch in file.iter_batches(batch_size=rows, columns=list(names)):
                yield {name: _array(batch.column(name)) for name in names}
    except (OSError, pyarrow.lib.ArrowException) as error:
        raise _unreadable(path, error) from error


def row_count(path: Path) -> int:
    """Rows of `path`, from its footer; raises `ResultError` where it cannot be read."""
    import pyarrow.lib
    import pyarrow.parquet

    try:
        return int(pyarrow.parquet.read_metadata(path).num_rows)
    except (OSError, pyarrow.lib.ArrowException) as error:
        raise _unreadable(path, error) from error


def by_log(found: Iterator[Block]) -> Iterator[tuple[int, Block]]:
    """Split blocks that hold a column ``log`` where it changes: pairs of log and its stretch."""
    for block in found:
        log = block["log"]
        edges = [0, *(np.flatnonzero(np.diff(log)) + 1).tolist(), log.size]
        for first, last in pairwise(edges):
            if last > first:
                yield int(log[first]), {name: column[first:last] for name, column in block.items()}


def _array(column: object) -> FloatArray:
    values = np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)  # type: ignore[attr-defined]
    beyond = np.isfinite(values) & (np.abs(values) > LARGEST)
    return np.where(beyond, np.nan, values) if beyond.any() else values


def _unreadable(path: Path, error: Exception) -> ResultError:
    reason = str(error).partition("\n")[0]
    return ResultError(f"{path}: cannot read it as Parquet ({reason}); identify again with this version")
