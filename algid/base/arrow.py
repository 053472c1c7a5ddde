"""Numbers of Arrow's columns as arrays, and arrays as columns, without pandas.

`pyarrow.Array.to_numpy`, `pyarrow.array` and `pyarrow.table` import pandas where it is installed:
that takes longer than all else that a short log needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow


def whole_column(column: Any) -> NDArray[Any]:
    """Integers or floats (N,) of an Arrow array in which none is missing, of its own type."""
    return np.from_dlpack(column)


def numbers_of(column: Any) -> NDArray[np.float64]:
    """Numbers (N,) of any Arrow array of them as float64; NaN where one is missing."""
    import pyarrow

    types, kind = pyarrow.types, column.type
    if column.null_count or not (types.is_integer(kind) or types.is_floating(kind)):
        column = column.cast(pyarrow.float64()).fill_null(np.nan)
    return np.asarray(np.from_dlpack(column), dtype=np.float64)


def table_of_columns(columns: Mapping[str, object]) -> pyarrow.Table:
    """A table of columns by name: arrays of numbers, sequences of strings, or what Arrow takes."""
    import pyarrow

    arrays = [column_of(values) for values in columns.values()]
    return pyarrow.Table.from_arrays(arrays, names=list(columns))


def column_of(values: Any) -> pyarrow.Array:
    """A column of an array of numbers, of strings, or of what Arrow takes."""
    import pyarrow

    if isinstance(values, np.ndarray) and values.dtype.kind in "iuf":
        data = pyarrow.py_buffer(np.ascontiguousarray(values))
        kind = pyarrow.from_numpy_dtype(values.dtype)
        return pyarrow.Array.from_buffers(kind, len(values), [None, data])
    if len(values) and all(isinstance(value, str) for value in values):
        texts = [value.encode() for value in values]
        ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
        buffers = [None, pyarrow.py_buffer(ends), pyarrow.py_buffer(b"".join(texts))]
        return pyarrow.Array.from_buffers(pyarrow.string(), len(texts), buffers)
    return pyarrow.array(values)
