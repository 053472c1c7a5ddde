"""Logs that are read as a whole: NumPy archives, MATLAB files, Feather (Arrow IPC)."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign, tables
from algid.readers.names import TIMES
from algid.readers.parquet import units_of_schema
from algid.readers.table import SampleTable
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile

_LARGEST = 1 << 30
_MOST_COLUMNS = 4096
_WIDEST = 64


def open_arrays(path: Path, kind: str, profile: Profile | None = None) -> TableReader:
    """Open a log of the kind "npz", "npy", "mat" or "feather".

    Raises
    ------
    LogError
        If the file is damaged, too large to be read as a whole, or lacks a channel.
    """
    frame = frame_of(path, kind)
    columns = assign(str(path), frame.columns, profile, _units(path, frame.columns) if kind == "feather" else None)
    for name, source in columns.sources.items():
        if not (frame.schema[source].is_numeric() or (name == "t" and frame.schema[source].is_temporal())):
            raise LogError(f"{path}: {source!r} for {name} holds {frame.schema[source]}; expected numbers")
    if frame.schema[columns.sources["t"]].is_temporal():
        columns = replace(columns, time_unit="ns", time_told=True)
    numbers = {joint: name for joint, name in columns.others.items() if frame.schema[name].is_numeric()}
    columns = replace(columns, others=numbers)
    return columns.reader(
        str(path), kind, None, lambda chosen: _Whole(path, frame, chosen).tables, profile, frame.height
    )


def _units(path: Path, columns: Sequence[str]) -> dict[str, str]:
    """Units that a Feather file's schema states; nothing for one of the first version, which has none."""
    import pyarrow as pa

    try:
        with pa.ipc.open_file(path) as file:
            schema = file.schema
    except (pa.ArrowException, OSError, ValueError):
        return {}
    roots = {name: root for name in columns if (root := name.partition("[")[0] if name not in schema.names else name)}
    return units_of_schema(schema, {name: root for name, root in roots.items() if root in schema.names})


def frame_of(path: Path, kind: str) -> pl.DataFrame:
    """The file as one frame of flat columns: a matrix or a list gives one a joint, ``q[0]``, ``q[1]``.

    Raises
    ------
    LogError
        If the file is damaged, too large, or holds no arrays of one length.
    """
    import polars as pl

    if path.stat().st_size > _LARGEST:
        raise LogError(f"{path}: a {kind} file of more than 1 GiB is not read as a whole; save it as Parquet")
    try:
        if kind == "feather":
            return _flat(pl.read_ipc(path))
        arrays = _matlab(path) if kind == "mat" else _numpy(path, kind)
    except LogError:
        raise
    except Exception as error:  # whatever a damaged file makes of NumPy, SciPy or polars
        told = str(error).split("\n", maxsplit=1)[0][:200]
        raise LogError(f"{path}: the {kind} file cannot be read ({type(error).__name__}: {told})") from error
    columns = _columns(path, arrays)
    return pl.DataFrame(columns)


def _numpy(path: Path, kind: str) -> dict[str, NDArray[Any]]:
    if kind == "npy":
        array = np.load(path, allow_pickle=False)
        if array.dtype.names is None:
            raise LogError(f"{path}: an array without names; save it with np.savez(FILE, t=…, q=…, tau=…)")
        return {name: array[name] for name in array.dtype.names}
    with zipfile.ZipFile(path) as archive:
        claimed = sum(entry.file_size for entry in archive.infolist())
    if claimed > _LARGEST:
        raise LogError(f"{path}: the archive claims {counted(claimed, 'byte')} unpacked; save it as Parquet")
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _matlab(path: Path) -> dict[str, NDArray[Any]]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError as error:
        raise LogError(f"{path}: a MATLAB 7.3 file (HDF5); save it with save(FILE, '-v7')") from error
    return dict(_leaves(content, ""))


def _leaves(content: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray):
            yield f"{prefix}{name}", value


def _columns(path: Path, arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Columns as long as the time, or as the longest array; the last part of a nested name where that is unique."""
    numbers = {name: np.squeeze(array) for name, array in arrays.items() if array.dtype.kind in "iuf"}
    short = [name.rpartition(".")[2] for name in numbers]
    numbers = {
        (last if short.count(last) == 1 else name): array
        for (name, array), last in zip(numbers.items(), short, strict=True)
    }
    clocks = [array.size for name, array in numbers.items() if name.lower() in TIMES and array.ndim == 1]
    rows = max(clocks or [max(array.shape, default=0) for array in numbers.values()], default=0)
    if rows < 2:
        raise LogError(f"{path}: no arrays of two samples or more; found {', '.join(arrays) or 'nothing'}")
    columns: dict[str, NDArray[Any]] = {}
    for name, array in numbers.items():
        if array.shape == (rows,):
            columns[name] = _native(array)
        elif array.ndim == 2 and rows in array.shape and min(array.shape) <= _WIDEST:
            upright = array if array.shape[0] == rows else array.T
            columns |= {f"{name}[{place}]": _native(upright[:, place]) for place in range(upright.shape[1])}
    if len(columns) > _MOST_COLUMNS:
        raise LogError(f"{path}: {counted(len(columns), 'column')}; expected {_MOST_COLUMNS} at most")
    return columns


def _native(array: NDArray[Any]) -> NDArray[Any]:
    """In this machine's byte order and in one piece; halves as float32."""
    kind = np.float32 if array.dtype == np.float16 else array.dtype.newbyteorder("=")
    return np.ascontiguousarray(array, kind)


def _flat(frame: pl.DataFrame) -> pl.DataFrame:
    import polars as pl

    columns = []
    for name, kind in frame.schema.items():
        if not isinstance(kind, (pl.List, pl.Array)):
            columns.append(pl.col(name))
            continue
        lists = pl.col(name) if isinstance(kind, pl.List) else pl.col(name).arr.to_list()
        widest = frame.select(lists.list.len().max()).item() or 0
        columns += [
            lists.list.get(place, null_on_oob=True).alias(f"{name}[{place}]") for place in range(min(widest, _WIDEST))
        ]
    return frame.select(columns[:_MOST_COLUMNS])


@dataclass(frozen=True)
class _Whole:
    """A frame in memory and the columns to take from it."""

    path: Path
    frame: pl.DataFrame
    columns: Columns

    def tables(self, rows: int) -> Iterator[SampleTable]:
        """Tables of `rows` rows."""
        return tables(str(self.path), self._frames(rows), self.columns, {})

    def _frames(self, rows: int) -> Iterator[pl.DataFrame]:
        import polars as pl

        numbers = []
        for name, source in self.columns.sources.items():
            cell, kind = pl.col(source), self.frame.schema[source]
            if name != "t":
                cell = cell.cast(pl.Float64)
            elif isinstance(kind, pl.Datetime):
                cell = cell.dt.timestamp("ns")
            elif isinstance(kind, pl.Duration):
                cell = cell.dt.total_nanoseconds()
            else:
                cell = cell.cast(pl.Int64) if kind.is_integer() else cell.cast(pl.Float64)
            numbers.append(cell.alias(name))
        chosen = self.frame.select(numbers)
        for first in range(0, max(chosen.height, 1), rows):
            yield chosen.slice(first, rows)
