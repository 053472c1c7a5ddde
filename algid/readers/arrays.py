"""Files that are read as a whole: NumPy, MATLAB, HDF5, JSON lines.

A JSON object a line: ``{"motor_state": [{"q": 1}]}`` has ``motor_state[0].q``.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.base.arrow import column_of
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.text import repeated
from algid.notices import Notice
from algid.readers.column_names import TIMES
from algid.readers.table import as_log_error
from algid.readers.table_cells import ATTRIBUTES, BATCH_ROWS, TableFile

if TYPE_CHECKING:
    import pyarrow as pa


Arrays = dict[str, NDArray[Any]]
Read = tuple[Arrays, dict[str, dict[str, str]], dict[str, str]]
"""Arrays, the attributes of each, and the file's."""


def open_arrays(path: Path, kind: str) -> TableFile:
    """Open arrays of NumPy ("npz"), MATLAB ("mat") or HDF5 ("hdf5").

    Raises
    ------
    LogError
        If the file is damaged or too large, or h5py is missing.
    """
    readers = {"npz": ("NumPy", _of_npz), "mat": ("MATLAB", _of_mat), "hdf5": ("HDF5", _of_hdf5)}
    title, read = readers[kind]
    _refuse_large(path.stat().st_size)
    with as_log_error(title):
        return of_arrays(kind, *read(path))


def _refuse_large(size: int) -> None:
    if size > LIMITS.whole_bytes:
        raise LogError(
            "what is more than 1 GiB, packed or not, is not read as a whole; save it as Parquet"
        )


def _of_npz(path: Path) -> Read:
    arrays: Arrays = {}
    with zipfile.ZipFile(path) as archive:
        _refuse_large(sum(entry.file_size for entry in archive.infolist()))
        twice = repeated(archive.namelist())
        if twice:
            raise LogError(f"the array {twice[0]!r} stands in the archive twice; save it again")
        for name in archive.namelist():
            with archive.open(name) as stream:
                arrays[name.removesuffix(".npy")] = np.lib.format.read_array(
                    stream, allow_pickle=False
                )
                if stream.read(1):
                    raise LogError(
                        f"the array {name!r} is longer than its head says; save it again"
                    )
    return arrays, {}, {}


def _of_mat(path: Path) -> Read:
    from scipy.io import loadmat, whosmat

    arrays: Arrays = {}

    def take(content: Mapping[str, Any], prefix: str) -> None:
        for name, value in content.items():
            if isinstance(value, dict):
                take(value, f"{prefix}{name}.")
            elif not name.startswith("__"):
                arrays[f"{prefix}{name}"] = np.asarray(value)

    try:
        take(loadmat(path, simplify_cells=True), "")
    except NotImplementedError:  # version 7.3 is HDF5
        return _of_hdf5(path)
    for name, _, kind in whosmat(path):
        if kind == "logical" and name in arrays:  # which SciPy reads as whole numbers
            arrays[name] = arrays[name].astype(np.bool_)
    return arrays, {}, {}


def _of_hdf5(path: Path) -> Read:
    """Datasets by their paths with dots, none of another file."""
    try:
        import h5py
    except ImportError as error:
        mend = "pip install 'algid[hdf5]', or in MATLAB save(FILE, '-v7')"
        raise LogError(f"an HDF5 file, for which h5py is needed: {mend}") from error
    arrays: Arrays = {}
    attributes: dict[str, dict[str, str]] = {}
    of_groups: dict[str, dict[str, str]] = {}

    def take(name: str, one: Any) -> None:
        if isinstance(one, h5py.Group):  # before what it holds
            stated = {
                key: text_of(value) for key, value in one.attrs.items() if "unit" in key.lower()
            }
            own = {key: stated.pop(key) for key in ("unit", "units") if key in stated}
            of_groups[name] = of_groups.get(name.rpartition("/")[0], {}) | own
            for key, value in stated.items():
                if metadata.setdefault(key, value) != value:
                    raise LogError(
                        f"its groups state {key} as {metadata[key]!r:.40} and as "
                        f"{value!r:.40}; state the unit of each dataset by its own attribute"
                    )
            return
        if not isinstance(one, h5py.Dataset) or one.is_virtual or one.external or one.ndim > 2:
            return
        kinds = {kind.kind for kind, *_ in (one.dtype.fields or {"": (one.dtype,)}).values()}
        if name.startswith("#") or not kinds <= set("iufbSO"):
            return
        _refuse_large(one.nbytes)
        # HDF5 fills up with zeros what was never written; texts lie apart
        stored, expected, unit = one.id.get_storage_size(), one.nbytes, "bytes"
        if one.chunks is not None:
            stored, unit = one.id.get_num_chunks(), "chunks"
            counts = -(-np.array(one.shape) // np.array(one.chunks))
            expected = int(np.prod(counts)) if one.size else stored
        if stored != expected and "O" not in kinds:
            raise LogError(
                f"the array {name!r} has {stored} of {expected} {unit}; the file was cut "
                "off or damaged, save it again"
            )
        plain, values = name.replace("/", "."), np.asarray(one[()])
        inherited = of_groups.get(name.rpartition("/")[0], {})
        attributes[plain] = inherited | {key: text_of(value) for key, value in one.attrs.items()}
        if values.dtype.names:
            arrays.update({f"{plain}.{each}": values[each] for each in values.dtype.names})
        else:
            arrays[plain] = np.atleast_1d(values)

    with h5py.File(path, "r") as file:
        metadata = {key: text_of(value) for key, value in file.attrs.items()}
        file.visititems(take)
    return arrays, attributes, metadata


def of_arrays(
    kind: str,
    arrays: Mapping[str, NDArray[Any]],
    attributes: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
    metadata: Mapping[str, str] = MappingProxyType({}),
) -> TableFile:
    """Columns as long as the time, or as the longest array; a matrix has ``q[0]``, ``q[1]``.

    A nested name's last part stands for it where that is unique. Texts and single numbers are
    metadata; those named as an attribute, ``units``, are of the columns in their order, or of the
    column behind a dot.

    Raises
    ------
    LogError
        If no array has two samples.
    """
    import pyarrow as pa

    last = {name: name.rpartition(".")[2] for name in arrays}
    twice = repeated(last.values())
    short = {name: name if last[name] in twice else last[name] for name in arrays}
    signals = [name for name, one in arrays.items() if one.dtype.kind in "iufbmM" and one.size > 1]
    said = {short[name]: dict(attributes.get(name, {})) for name in arrays}
    found, texts, others = {}, dict(metadata), list[str]()
    timed = longest = 0
    for name, array in arrays.items():
        key, _, column = name.partition(".")
        if column and key.lower() in ATTRIBUTES and array.size == 1:
            said.setdefault(column, {})[key] = text_of(array)
        elif name.lower() in ATTRIBUTES and array.shape == (len(signals),):
            for signal, value in zip(signals, map(text_of, array), strict=True):
                said[short[signal]] |= {name: value} if value else {}
        elif array.dtype.kind in "iufbmMOUS":
            array = found[short[name]] = np.squeeze(array)
            if array.ndim and array.dtype.kind not in "OUS":
                longest = max(longest, *array.shape)
            if array.ndim == 1 and short[name].lower() in TIMES:
                timed = max(timed, array.size)
    rows = timed or longest
    if rows < 2:
        raise LogError(f"no arrays of two samples or more; found {', '.join(arrays) or 'nothing'}")
    columns: list[pa.Array] = []
    fields: list[pa.Field] = []
    for name, array in found.items():
        if array.shape == (rows,):
            parts = {name: array}
        elif array.ndim == 2 and rows in array.shape and min(array.shape) <= LIMITS.list_cells:
            across = array.T if array.shape[0] == rows else array
            parts = {f"{name}[{place}]": part for place, part in enumerate(across)}
        elif array.dtype.kind in "OUS" or not array.ndim:
            texts[name] = text_of(array)
            continue
        else:
            others.append(f"{name} ({' × '.join(map(str, array.shape))})")
            continue
        try:
            made = [_column(part) for part in parts.values()]
        except (pa.ArrowException, TypeError, ValueError):
            others.append(f"{name} (no numbers)")
            continue
        columns += made
        fields += [pa.field(part, made[0].type, metadata=said.get(name)) for part in parts]
    table = pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=texts or None))
    return of_arrow(kind, table, others=tuple(others))


def _column(values: NDArray[Any]) -> pa.Array:
    """A column of Arrow, which knows this machine's byte order alone."""
    import pyarrow as pa

    kind = values.dtype.kind
    if kind in "iuf":
        values = values.astype(values.dtype.newbyteorder("="), copy=False)
    if np.ma.isMaskedArray(values):
        return pa.array(values.data, mask=np.ma.getmaskarray(values))
    if kind == "S":
        values = np.char.decode(values, "utf-8")
    return column_of(values.tolist() if kind in "OUS" else values)


def text_of(value: Any) -> str:
    """An attribute as text; lists as JSON."""
    if isinstance(value, np.ndarray | np.generic):
        value = np.squeeze(value).tolist()
    if isinstance(value, list | tuple):
        return json.dumps([text_of(one) for one in value])
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def of_arrow(kind: str, table: pa.Table, **more: Any) -> TableFile:
    """A table in memory, with `more` of what a `TableFile` has."""

    def batches(names: Sequence[str]) -> Iterator[pa.RecordBatch]:
        yield from table.select(list(names)).to_batches(BATCH_ROWS)

    return TableFile(kind, table.schema, table.num_rows, batches, **more)


def is_json_lines(head: bytes) -> bool:
    """Whether the first line of a text is a JSON object, with another behind it."""
    first, _, rest = head.lstrip(b"\xef\xbb\xbf \t\r\n").partition(b"\n")
    return first.startswith(b"{") and rest.lstrip().startswith(b"{") and _is_object(first)


def _is_object(line: bytes) -> bool:
    """Whether a line is a JSON object, or blank; NaN is no JSON."""
    try:
        return not line.strip() or isinstance(json.loads(line, parse_constant=int), dict)
    except (ValueError, RecursionError):
        return False


def open_json_lines(path: Path) -> TableFile:
    """Open JSON lines; a last line that breaks off is left out and told.

    Raises
    ------
    LogError
        If another line is no JSON object, or the file is too large.
    """
    import polars as pl

    _refuse_large(path.stat().st_size)
    text = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    notices: tuple[Notice, ...] = ()
    whole = text.rfind(b"\n") + 1
    if not _is_object(text[whole:]):
        numbers = {"case": "row", "row": text.count(b"\n") + 1}
        text, notices = text[:whole], (Notice("CUT_OFF", numbers=numbers),)
    # polars takes the cube of the depth of lists and objects
    if re.search(rb"(?:[\[{][^\[\]{}]*){%d}" % LIMITS.json_depth, text):
        raise LogError(
            f"lists and objects within one another, more than {LIMITS.json_depth} deep; "
            "expected a sample of an arm in every line"
        )
    with as_log_error("JSON lines"):
        try:
            frame = pl.read_ndjson(io.BytesIO(text), infer_schema_length=None)
        except pl.exceptions.PolarsError as error:
            reason = str(error).partition("\n")[0][:200]
            wrong = (place for place, line in enumerate(text.split(b"\n")) if not _is_object(line))
            raise LogError(
                f"line {next(wrong, 0) + 1}: expected a JSON object in every line "
                f"({reason}); mend or cut it"
            ) from error
        # whole numbers that Arrow has not
        frame = frame.with_columns(pl.col(pl.Int128).cast(pl.Float64))
        return of_arrow("jsonl", frame.to_arrow(), notices=notices)
