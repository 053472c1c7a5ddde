"""Logs that are read as a whole: NumPy archives, MATLAB files."""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.limits import LIMITS
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign
from algid.readers.frames import flat_reader, number, of_numbers
from algid.readers.names import TIMES
from algid.readers.natives import natively
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile


def open_arrays(path: Path, kind: str, profile: Profile) -> TableReader:
    """Open a log of the kind "npz", "npy" or "mat".

    Raises
    ------
    LogError
        If the file is damaged, too large to be read as a whole, or lacks a channel.
    """
    import polars as pl

    frame = frame_of(path, kind)
    columns = assign(str(path), frame.columns, profile, {})
    columns = of_numbers(str(path), columns, frame.schema)

    def frames(columns: Columns, rows: int, most: int | None) -> Iterator[pl.DataFrame]:
        chosen = frame if most is None else frame.head(most)
        numbers = [number(name, pl.col(source), frame.schema[source]) for name, source in columns.sources.items()]
        yield from chosen.select(numbers).iter_slices(rows)

    return flat_reader(str(path), kind, columns, frames, profile, frame.height)


def frame_of(path: Path, kind: str) -> pl.DataFrame:
    """The file as one frame of flat columns: a matrix or a list gives one a joint, ``q[0]``, ``q[1]``.

    Raises
    ------
    LogError
        If the file is damaged, too large, or holds no arrays of one length.
    """
    import polars as pl

    if path.stat().st_size > LIMITS.whole_bytes:
        raise LogError(f"{path}: a {kind} file of more than 1 GiB is not read as a whole; save it as Parquet")
    with natively(path, kind):
        flat = pl.DataFrame(_columns(path, {"npy": _npy, "npz": _npz, "mat": _matlab}[kind](path)))
    if flat.width > LIMITS.columns:
        raise LogError(f"{path}: {counted(flat.width, 'column')}; expected {LIMITS.columns} at most")
    return flat


def _npy(path: Path) -> dict[str, NDArray[Any]]:
    array = np.load(path, allow_pickle=False)
    if array.dtype.names is None:
        raise LogError(f"{path}: an array without names; save it with np.savez(FILE, t=…, q=…, tau=…)")
    return {name: array[name] for name in array.dtype.names}


def _npz(path: Path) -> dict[str, NDArray[Any]]:
    with zipfile.ZipFile(path) as archive:
        claimed = sum(entry.file_size for entry in archive.infolist())
    if claimed > LIMITS.whole_bytes:
        raise LogError(f"{path}: the archive claims {counted(claimed, 'byte')} unpacked; save it as Parquet")
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


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
    last = {name: name.rpartition(".")[2] for name in numbers}
    short = Counter(last.values())
    numbers = {last[name] if short[last[name]] == 1 else name: array for name, array in numbers.items()}
    clocks = [array.size for name, array in numbers.items() if name.lower() in TIMES and array.ndim == 1]
    rows = max(clocks or [max(array.shape, default=0) for array in numbers.values()], default=0)
    if rows < 2:
        raise LogError(f"{path}: no arrays of two samples or more; found {', '.join(arrays) or 'nothing'}")
    columns: dict[str, NDArray[Any]] = {}
    for name, array in numbers.items():
        if array.shape == (rows,):
            columns[name] = _native(array)
        elif array.ndim == 2 and rows in array.shape and min(array.shape) <= LIMITS.list_cells:
            upright = array if array.shape[0] == rows else array.T
            columns |= {f"{name}[{place}]": _native(upright[:, place]) for place in range(upright.shape[1])}
    return columns


def _native(array: NDArray[Any]) -> NDArray[Any]:
    """In this machine's byte order and in one piece; halves as float32."""
    kind = np.float32 if array.dtype == np.float16 else array.dtype.newbyteorder("=")
    return np.ascontiguousarray(array, kind)
