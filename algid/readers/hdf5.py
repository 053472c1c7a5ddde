"""HDF5 files, read by a process of their own: the library behind h5py breaks on damaged ones.

This module is that process as well, run as a program with the file and the bounds. It then imports
nothing of algid. It writes the names of the arrays as a line of JSON, and behind it each array as
NumPy writes them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

_SECONDS = 120
"""Of processor that reading may take: a gigabyte takes ten."""
_MEMORY = 4
"""Of addresses, times the bytes that arrays may claim, and as much again as NumPy takes."""
_NUMPY_BYTES = 4 << 30
_REFUSED = 3
"""The exit code for a file that cannot be read; its reason is the last line."""


def arrays_of(path: Path, *, most_bytes: int, most_arrays: int) -> Mapping[str, NDArray[Any]]:
    """The datasets of numbers in a file, by their paths with dots.

    Nothing that lies in another file.

    Raises
    ------
    LogError
        If h5py is missing, the file is damaged, or it claims more than it may.
    """
    from algid.errors import LogError

    if sys.modules.get("h5py", path) is None or find_spec("h5py") is None:
        mend = "pip install 'algid[hdf5]', or in MATLAB save(FILE, '-v7')"
        raise LogError(f"{path}: an HDF5 file, for which h5py is needed: {mend}")
    # -P: the modules beside this file have names of the standard library's
    command = [sys.executable, "-P", __file__, str(path), str(most_bytes), str(most_arrays)]
    places = {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, **places}
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        try:
            arrays = _received(running.stdout)
        except (ValueError, EOFError):  # it ended before
            arrays = {}
        message = running.stderr.read().decode(errors="replace").strip()
    if running.returncode == _REFUSED:
        raise LogError(f"{path}: {message.rpartition(chr(10))[2]}")
    if running.returncode != 0:
        raise LogError(
            f"{path}: the HDF5 file is damaged: the library that reads it broke on it "
            f"(exit {running.returncode}); record or save it again"
        )
    return arrays


class _Pipe:
    """A pipe as a file that only reads: NumPy would seek in any other."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.read = stream.read


def _received(stream: IO[bytes]) -> dict[str, NDArray[Any]]:
    names = json.loads(stream.readline())
    pipe = cast("IO[bytes]", _Pipe(stream))
    return {name: np.lib.format.read_array(pipe, allow_pickle=False) for name in names}


def _read(path: str, most_bytes: int, most_arrays: int) -> dict[str, NDArray[Any]]:
    """Raises ValueError with a line for the user."""
    import h5py

    by_path: dict[str, Any] = {}

    def keep(name: str, one: Any) -> None:
        if (
            isinstance(one, h5py.Dataset)
            and not (one.is_virtual or one.external)
            and not name.startswith("#")
        ):
            kinds = [one.dtype[field] for field in one.dtype.names or ()] or [one.dtype]
            if one.ndim <= 2 and all(kind.kind in "iuf" for kind in kinds):
                by_path[name] = one

    with h5py.File(path, "r") as file:
        file.visititems(keep)
        claimed = sum(one.nbytes for one in by_path.values())
        if claimed > most_bytes or len(by_path) > most_arrays:
            raise ValueError(
                f"more than a log has (arrays: {len(by_path)} of {claimed} B); save it as Parquet"
            )
        arrays: dict[str, NDArray[Any]] = {}
        for name, one in by_path.items():
            _check_stored(name, one)
            values = one[()]
            plain = name.replace("/", ".")
            if not values.dtype.names:
                arrays[plain] = np.atleast_1d(values)
                continue
            for field in values.dtype.names:
                arrays[f"{plain}.{field}"] = values[field]
    return arrays


def _check_stored(name: str, one: Any) -> None:
    """Refuse a dataset stored with more or less than its shape: HDF5 fills up what is missing.

    Raises
    ------
    ValueError
        If bytes or chunks are missing or too many.
    """
    if one.chunks is None:
        stored, expected, unit = one.id.get_storage_size(), one.nbytes, "bytes"
    else:
        stored, unit = one.id.get_num_chunks(), "chunks"
        counts = -(-np.array(one.shape) // np.array(one.chunks))
        expected = int(np.prod(counts)) if one.size else stored
    if stored != expected:
        raise ValueError(
            f"the array {name!r} has {stored} of {expected} {unit}; the file was cut off or "
            "damaged, save it again"
        )


def main() -> int:
    """Write a file's arrays to stdout."""
    path, most_bytes, most_arrays = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    _bound(_MEMORY * most_bytes + _NUMPY_BYTES)
    try:
        arrays = _read(path, most_bytes, most_arrays)
    except ImportError:
        raise
    except Exception as error:
        reason = str(error).partition("\n")[0][:200]
        known = reason if type(error) is ValueError and ";" in reason else ""
        print(
            known or f"the HDF5 file cannot be read ({type(error).__name__}: {reason})",
            file=sys.stderr,
        )
        return _REFUSED
    out = sys.stdout.buffer
    out.write(json.dumps(list(arrays)).encode() + b"\n")
    for values in arrays.values():
        np.lib.format.write_array(out, np.ascontiguousarray(values), allow_pickle=False)
    out.flush()
    return 0


def _bound(memory: int) -> None:
    """Bound what a damaged file may make the library take, where the system can."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    sys.exit(main())
