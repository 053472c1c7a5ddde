"""Logs that are read as a whole: NumPy archives, MATLAB files."""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.limits import LIMITS
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign
from algid.readers.frames import flat_reader, number, of_numbers, timed_by_index
from algid.readers.hdf5 import arrays_of
from algid.readers.jsonlines import frame_of_lines
from algid.readers.matfile import check_elements
from algid.readers.names import TIMES
from algid.readers.natives import natively
from algid.words import counted, repeated

_MOST_TOLD = 12
"""Arrays that fit nothing and are listed."""

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile


def open_arrays(path: Path, kind: str, profile: Profile) -> TableReader:
    """Open a log of the kind "npz", "npy", "mat", "hdf5" or "jsonl".

    Raises
    ------
    LogError
        If the file is damaged, too large to be read as a whole, or lacks a channel.
    """
    content, others = contents_of(path, kind)
    return open_content(str(path), kind, content, profile, others=others)


def open_content(
    path: str,
    kind: str,
    content: Content,
    profile: Profile,
    *,
    units: Mapping[str, str] | None = None,
    others: tuple[str, ...] = (),
) -> TableReader:
    """Open a log of columns that are in memory, under the name `path`.

    Parameters
    ----------
    path, kind : str
    content : Content
    profile : Profile
    units : mapping
        Units by column that are stated elsewhere than in the columns' names.
    others : tuple of str
        What else the log holds, for the error of a channel that is missing.

    Raises
    ------
    LogError
        If a channel is missing, or is not of numbers.
    """
    import polars as pl

    schema = content.schema
    profile = timed_by_index(profile, schema)
    try:
        columns = assign(path, schema.names(), profile, units or {})
    except LogError as error:
        if not others:
            raise
        raise LogError(
            f"{error}; the log also holds, of another length: {', '.join(others[:_MOST_TOLD])}"
        ) from error
    columns = of_numbers(path, columns, schema)

    def frames(columns: Columns, rows: int, most: int | None) -> Iterator[pl.DataFrame]:
        numbers = [
            number(name, pl.col(source), schema[source]) for name, source in columns.sources.items()
        ]
        end = content.rows if most is None else min(most, content.rows)
        for first in range(0, end, rows):
            yield content.part(first, min(first + rows, end), set(columns.sources.values())).select(
                numbers
            )

    return flat_reader(path, kind, columns, frames, profile, content.rows)


@dataclass(frozen=True, eq=False)
class Content:
    """The flat columns of a file, of so many rows: arrays or a frame."""

    columns: Mapping[str, NDArray[Any]] | pl.DataFrame
    rows: int

    @property
    def schema(self) -> pl.Schema:
        """The types of the columns as frames have them."""
        return self.part(0, 1).schema

    def part(self, first: int, last: int, names: Collection[str] | None = None) -> pl.DataFrame:
        """Some rows of all columns, or of `names` only, since a frame holds each array twice."""
        import polars as pl

        if isinstance(self.columns, pl.DataFrame):
            return self.columns[first:last]
        part = {}
        for name, column in self.columns.items():
            if names is None or name in names:
                part[name] = _native(column[first:last])
        return pl.DataFrame(part)


def contents_of(path: Path, kind: str) -> tuple[Content, tuple[str, ...]]:
    """The file's flat columns, and its arrays that fit in none, each with its shape.

    A matrix or a list gives a column a joint, ``q[0]``, ``q[1]``.

    Raises
    ------
    LogError
        If the file is damaged, too large, or holds no arrays of one length.
    """
    if path.stat().st_size > LIMITS.whole_bytes:
        raise LogError(
            f"{path}: a {kind} file of more than 1 GiB is not read as a whole; save it as Parquet"
        )
    others: tuple[str, ...] = ()
    with natively(path, kind):
        if kind == "jsonl":
            frame = frame_of_lines(path)
            content = Content(frame, frame.height)
        else:
            columns, others = columns_of(str(path), _LOADERS[kind](path))
            content = Content(columns, len(next(iter(columns.values()), ())))
        width = len(content.schema)  # of types that polars does not take it tells here
    if width > LIMITS.columns:
        raise LogError(f"{path}: {counted(width, 'column')}; expected {LIMITS.columns} at most")
    return content, others


def _npy(path: Path) -> dict[str, NDArray[Any]]:
    with path.open("rb") as stream:
        array = np.lib.format.read_array(stream, allow_pickle=False)
        if stream.read(1):
            raise LogError(
                f"{path}: its head says {counted(len(array), 'row')}, and there is more behind "
                "them; the file was "
                "damaged, save it again"
            )
    if array.dtype.names is None:
        raise LogError(
            f"{path}: an array without names; save it with np.savez(FILE, t=…, q=…, tau=…)"
        )
    return {name: array[name] for name in array.dtype.names}


def _npz(path: Path) -> dict[str, NDArray[Any]]:
    with zipfile.ZipFile(path) as archive:
        claimed = sum(entry.file_size for entry in archive.infolist())
        twice = repeated(archive.namelist())
    if twice:
        raise LogError(f"{path}: the array {twice[0]!r} stands in the archive twice; save it again")
    if claimed > LIMITS.whole_bytes:
        raise LogError(
            f"{path}: the archive claims {counted(claimed, 'byte')} unpacked; save it as Parquet"
        )
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


def _matlab(path: Path) -> Mapping[str, NDArray[Any]]:
    from scipy.io import loadmat

    check_elements(path)
    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:  # version 7.3 is HDF5
        return _hdf5(path)
    return dict(_leaves(content, ""))


def _hdf5(path: Path) -> Mapping[str, NDArray[Any]]:
    return arrays_of(path, most_bytes=LIMITS.whole_bytes, most_arrays=LIMITS.columns)


_LOADERS = {"npy": _npy, "npz": _npz, "mat": _matlab, "hdf5": _hdf5}


def _leaves(content: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray):
            yield f"{prefix}{name}", value


def columns_of(
    path: str, arrays: Mapping[str, NDArray[Any]]
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """Columns as long as the time, or as the longest array, and the other arrays with their shapes.

    A nested name's last part stands for it where that is unique.

    Raises
    ------
    LogError
        If no array has two samples.
    """
    numbers = {}
    for name, array in arrays.items():
        if array.dtype.kind in "iuf":
            numbers[name] = np.squeeze(array)
    numbers = _by_short_names(numbers)
    rows = _rows_of(numbers)
    if rows < 2:
        raise LogError(
            f"{path}: no arrays of two samples or more; found {', '.join(arrays) or 'nothing'}"
        )
    columns: dict[str, NDArray[Any]] = {}
    others: list[str] = []
    for name, array in numbers.items():
        if array.shape == (rows,):
            columns[name] = array
        elif array.ndim == 2 and rows in array.shape and min(array.shape) <= LIMITS.list_cells:
            upright = array if array.shape[0] == rows else array.T
            for place, column in enumerate(upright.T):
                columns[f"{name}[{place}]"] = column
        else:
            others.append(f"{name} ({' × '.join(map(str, array.shape)) or 'one number'})")
    return columns, tuple(others)


def _by_short_names(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Arrays by the last part of their nested names, where that is unique."""
    last = {name: name.rpartition(".")[2] for name in arrays}
    twice = repeated(last.values())
    named = {}
    for name, array in arrays.items():
        named[name if last[name] in twice else last[name]] = array
    return named


def _rows_of(arrays: Mapping[str, NDArray[Any]]) -> int:
    """As many rows as the longest time has; without a time, as the longest array."""
    longest = 0
    clocks = []
    for name, array in arrays.items():
        longest = max(longest, *array.shape, 0)
        if name.lower() in TIMES and array.ndim == 1:
            clocks.append(array.size)
    return max(clocks, default=longest)


def _native(array: NDArray[Any]) -> NDArray[Any]:
    """In this machine's byte order and in one piece; halves as float32."""
    kind = np.float32 if array.dtype == np.float16 else array.dtype.newbyteorder("=")
    return np.ascontiguousarray(array, kind)
