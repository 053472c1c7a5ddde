"""A folder's Parquet files in blocks of bounded memory, whatever the size of the log.

Long series made short for drawing, block by block, so that no spike is lost.

=======  ==================================  ======
symbol   name                                shape
=======  ==================================  ======
x        where each sample lies, increasing  (N,)
y        the samples                         (N,)
=======  ==================================  ======
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.arrow import numbers_of
from algid.blocks import rows_of
from algid.errors import ResultError

ROWS = 1 << 18

LARGEST = 1e20
"""Beyond this nothing of an arm is a number: squares would overflow."""

Block = dict[str, FloatArray]


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Raises `ResultError` for what is no Parquet file that can be read."""
    import pyarrow.lib

    try:
        yield
    except (OSError, pyarrow.lib.ArrowException) as error:
        reason = str(error).partition("\n")[0]
        text = f"{path}: cannot read it as Parquet ({reason}); identify again with this version"
        raise ResultError(text) from error


def columns_of(path: Path) -> list[str]:
    """Names of the columns of `path`; raises `ResultError` where it cannot be read."""
    import pyarrow.parquet

    with _reading(path):
        return list(pyarrow.parquet.read_schema(path).names)


PLACES = frozenset({"log", "t", "x"})
"""Columns that say where a row lies: each has a number in every row."""


def blocks(
    path: Path, names: Sequence[str], rows: int = ROWS, *, finite: Collection[str] = PLACES
) -> Iterator[Block]:
    """Yield columns `names` of `path`, `rows` samples at a time; missing ones are NaN.

    Values beyond `LARGEST` are NaN too. Columns that are `finite` may have none of these.

    Raises
    ------
    ResultError
        If the file cannot be read, lacks a column, or a number in a `finite` one.
    """
    import pyarrow.parquet

    _check_columns(path, names, numbers=names)
    # without pre_buffer=False the file is kept in memory as it is read
    with _reading(path), pyarrow.parquet.ParquetFile(path, pre_buffer=False) as file:
        for batch in file.iter_batches(batch_size=rows, columns=list(names)):
            block = {}
            for name in names:
                values = numbers_of(batch.column(name))
                beyond = np.isfinite(values) & (np.abs(values) > LARGEST)
                block[name] = np.where(beyond, np.nan, values) if beyond.any() else values
            for name in names:
                if name in finite and not np.all(np.isfinite(block[name])):
                    raise ResultError(
                        f"{path}: column {name!r}: expected a number in every row; identify again "
                        "with this version"
                    )
            yield block


def table_of(
    path: Path, names: Sequence[str], *, numbers: Collection[str] = ()
) -> dict[str, list[Any]]:
    """The columns `names` of a small file, of which some hold `numbers` and the others anything.

    Raises
    ------
    ResultError
        If the file cannot be read, lacks a column, or one holds no numbers that should.
    """
    import pyarrow.parquet

    _check_columns(path, names, numbers=numbers)
    # `pyarrow.parquet.read_table` would import all that reads sets of files.
    with _reading(path), pyarrow.parquet.ParquetFile(path) as file:
        columns: dict[str, list[Any]] = file.read(columns=list(names)).to_pydict()
        return columns


def _check_columns(path: Path, names: Sequence[str], *, numbers: Collection[str]) -> None:
    import pyarrow.parquet
    from pyarrow import types

    with _reading(path):
        kinds = {field.name: field.type for field in pyarrow.parquet.read_schema(path)}
    present = list(kinds)
    absent = [name for name in names if name not in present]
    if absent:
        raise ResultError(
            f"{path}: expected a column {absent[0]!r}, found none; identify again with this version"
        )
    of_numbers = (types.is_integer, types.is_floating, types.is_null, types.is_boolean)
    for name in numbers:
        if not any(fits(kinds[name]) for fits in of_numbers):
            raise ResultError(
                f"{path}: column {name!r}: expected numbers, found {kinds[name]}; identify again "
                "with this version"
            )


def between(
    path: Path, names: Sequence[str], log: int, low: float, high: float
) -> tuple[FloatArray, ...]:
    """The columns `names` of a log's rows with t in [low, high]; NaN where one has no number.

    Only the row groups that may hold such rows are read. Raises `ResultError` where the file
    cannot be read, or lacks a column.
    """
    import pyarrow.parquet

    wanted = tuple(dict.fromkeys(("log", "t", *names)))
    _check_columns(path, wanted, numbers=wanted)
    with _reading(path), pyarrow.parquet.ParquetFile(path) as file:
        groups = []
        for place in range(file.num_row_groups):
            group = file.metadata.row_group(place)
            if _overlaps(group, "log", log, log) and _overlaps(group, "t", low, high):
                groups.append(place)
        table = file.read_row_groups(groups, columns=list(wanted))
        columns = {name: numbers_of(table.column(name).combine_chunks()) for name in wanted}
    near = (columns["log"] == log) & (columns["t"] >= low) & (columns["t"] <= high)
    return tuple(columns[name][near] for name in names)


def _overlaps(group: Any, name: str, low: float, high: float) -> bool:
    """Whether a row group may hold values of the column `name` in [low, high]."""
    for place in range(group.num_columns):
        column = group.column(place)
        sums = column.statistics
        if column.path_in_schema == name and sums is not None and sums.has_min_max:
            return bool(sums.min <= high and sums.max >= low)
    return True


def metadata_of(path: Path, key: bytes) -> bytes | None:
    """What `path` tells under `key`; raises `ResultError` where it cannot be read."""
    import pyarrow.parquet

    with _reading(path):
        value: bytes | None = (pyarrow.parquet.read_schema(path).metadata or {}).get(key)
        return value


def row_count(path: Path) -> int:
    """Rows of `path`, from its footer; raises `ResultError` where it cannot be read."""
    import pyarrow.parquet

    with _reading(path):
        return int(pyarrow.parquet.read_metadata(path).num_rows)


def by_log(found: Iterator[Block]) -> Iterator[tuple[int, Block]]:
    """Split blocks that hold a column ``log`` where it changes: pairs of log and its stretch."""
    for block in found:
        log = block["log"]
        edges = [0, *(np.flatnonzero(np.diff(log)) + 1).tolist(), log.size]
        for first, last in pairwise(edges):
            if last > first:
                yield int(log[first]), rows_of(block, slice(first, last))


GOLDEN = 0.6180339887498949


class MinMax:
    """Keeps the smallest and the largest sample of every `size` ones, each where it lies.

    Blocks are fed in order; the outcome does not depend on how the series is cut into blocks. A
    stretch without any finite sample keeps one NaN, so that the line breaks there.
    """

    def __init__(self, size: int) -> None:
        if size < 1:
            raise ValueError(f"size must be at least 1, got {size}")
        self._size = size
        self._rest: tuple[FloatArray, FloatArray] = (np.empty(0), np.empty(0))
        self._kept: list[tuple[FloatArray, FloatArray]] = []

    def feed(self, x: FloatArray, y: FloatArray) -> None:
        """Take the next block: `x` and `y` (n,)."""
        if self._size <= 2:
            self._kept.append((x.copy(), y.copy()))
            return
        if self._rest[0].size:
            x, y = np.concatenate([self._rest[0], x]), np.concatenate([self._rest[1], y])
        whole = x.size - x.size % self._size
        self._rest = x[whole:].copy(), y[whole:].copy()
        if whole:
            self._kept.append(
                _extremes(x[:whole].reshape(-1, self._size), y[:whole].reshape(-1, self._size))
            )

    def result(self) -> tuple[FloatArray, FloatArray]:
        """The reduced `x` and `y`, at most two samples for every `size`."""
        kept = list(self._kept)
        if self._rest[0].size:
            kept.append(_extremes(self._rest[0][None], self._rest[1][None]))
        if not kept:
            return np.empty(0), np.empty(0)
        x, y = zip(*kept, strict=True)
        return np.concatenate(x), np.concatenate(y)


def _extremes(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest of each row of `y` (rows, size), in the order they lie in."""
    rows = np.arange(y.shape[0])
    if np.isnan(y.sum()):
        lowest = np.where(np.isnan(y), np.inf, y).argmin(axis=1)
        highest = np.where(np.isnan(y), -np.inf, y).argmax(axis=1)
    else:
        lowest, highest = y.argmin(axis=1), y.argmax(axis=1)
    first, last = np.minimum(lowest, highest), np.maximum(lowest, highest)
    index = np.stack([first, last], axis=1)
    twice = (first == last)[:, None] & np.array([False, True])
    keep = ~twice
    return x[rows[:, None], index][keep], y[rows[:, None], index][keep]


class Share:
    """Share, 0 to 1, of each `size` samples for which a condition holds, with its start."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._x: list[FloatArray] = []
        self._held: list[FloatArray] = []
        self._rest: tuple[FloatArray, FloatArray] = (np.empty(0), np.empty(0))

    def feed(self, x: FloatArray, holds: NDArray[np.bool_]) -> None:
        """Take the next block: `x` and `holds` (n,)."""
        x, held = np.concatenate([self._rest[0], x]), np.concatenate([self._rest[1], holds])
        whole = x.size - x.size % self._size
        self._rest = x[whole:], held[whole:]
        self._x.append(x[: whole : self._size].copy())  # a view would keep the whole block
        self._held.append(held[:whole].reshape(-1, self._size).mean(axis=1))

    def result(self) -> tuple[FloatArray, FloatArray]:
        """The start of each stretch and the share in it."""
        x, held = list(self._x), list(self._held)
        if self._rest[0].size:
            x.append(self._rest[0][:1])
            held.append(self._rest[1].mean(keepdims=True))
        return (np.concatenate(x), np.concatenate(held)) if x else (np.empty(0), np.empty(0))


class Thinned:
    """One sample of every `step` ones of several series (rows, n), counted across blocks.

    Which one moves by the golden ratio from stretch to stretch: spread evenly, and never in step
    with a periodic motion.
    """

    def __init__(self, step: int) -> None:
        self._step = max(step, 1)
        self._seen = 0
        self._kept: list[FloatArray] = []

    def feed(self, block: FloatArray) -> None:
        """Take the next block (rows, n)."""
        last = self._seen + block.shape[-1]
        stretch = np.arange(self._seen // self._step, -(-last // self._step))
        place = stretch * self._step + np.floor(np.mod(stretch * GOLDEN, 1.0) * self._step).astype(
            np.int64
        )
        inside = place[(place >= self._seen) & (place < last)]
        self._kept.append(block[:, inside - self._seen])
        self._seen = last

    def result(self, rows: int) -> FloatArray:
        """The samples kept (rows, m)."""
        return np.concatenate(self._kept, axis=1) if self._kept else np.empty((rows, 0))


def bucket_size(samples: int, points: int) -> int:
    """Samples a bucket so that `MinMax` leaves at most about `points`."""
    return 1 if samples <= points else int(np.ceil(2 * samples / points))


def broken_at_gaps(x: FloatArray, y: FloatArray, gap: float) -> tuple[FloatArray, FloatArray]:
    """The series with a NaN where two samples lie over `gap` apart, to break the line."""
    after = np.flatnonzero(np.diff(x) > gap) + 1
    return np.insert(x, after, x[after]), np.insert(y, after, np.nan)
