"""Logs given in memory, as a frame of columns or a dict of arrays, read as if from a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard, cast

import numpy as np

from algid.errors import LogError
from algid.limits import LIMITS
from algid.readers.arrays import Content, columns_of, open_content
from algid.readers.frames import cells
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile
    from algid.readers.assemble import TableReader

NAME = "log"
"""What a log in memory is called, as by `algid.Log.from_arrays`."""

Columns = Any
"""A pandas or polars frame, a pyarrow table, or a mapping of names to arrays."""


def is_columns(given: object) -> TypeGuard[Columns]:
    """Whether columns are given: a mapping, or an object that exports Arrow, as frames do."""
    return isinstance(given, Mapping) or any(
        hasattr(given, name) for name in ("__arrow_c_stream__", "__dataframe__")
    )


def refuse_others(given: object) -> None:
    """Raises `LogError` for what is neither a path nor columns, as an array without a name."""
    if isinstance(given, str | Path) or is_columns(given):
        return
    raise LogError(
        f"{NAME}: expected a path, a Log, a frame or a dict of arrays, found "
        f"{type(given).__name__}; arrays become a log by algid.Log.from_arrays(t, theta, tau)"
    )


def open_columns(given: Columns, profile: Profile) -> TableReader:
    """Open a log of columns in memory.

    Parameters
    ----------
    given : frame, table or mapping
        A mapping may hold matrices too, (N, 2) or (2, N); an index of a pandas frame counts as a
        column if it has a name.
    profile : Profile

    Raises
    ------
    LogError
        If the columns cannot be taken over, a channel is missing, or one is not of numbers.
    """
    kind, content, others, units = _taken(given)
    return open_content(NAME, kind, content, profile, units=units, others=others)


def content_of(given: Columns) -> tuple[str, Content]:
    """What columns in memory are called, and what they hold; raises as `open_columns`."""
    return _taken(given)[:2]


def _taken(given: Columns) -> tuple[str, Content, Any, dict[str, str]]:
    """Kind, content, arrays of another length, and the units that are stated."""
    refuse_others(given)
    if isinstance(given, Mapping):
        columns, others = columns_of(
            NAME, {str(name): _array(name, values) for name, values in given.items()}
        )
        content = Content(columns, len(next(iter(columns.values()), ())))
        return "arrays", _checked(content), others, {}
    frame, units = _frame(given)
    return "frame", _checked(Content(frame, frame.height)), (), units


def _array(name: object, values: object) -> np.ndarray[Any, Any]:
    try:
        return np.asarray(values)
    except Exception as error:  # whatever the values' own library raises
        raise LogError(
            f"{NAME}: {name!r} is no array ({error}); give numbers of one shape"
        ) from error


def _checked(content: Content) -> Content:
    width = len(content.schema)
    if width > LIMITS.columns:
        raise LogError(f"{NAME}: {counted(width, 'column')}; expected {LIMITS.columns} at most")
    return content


def _frame(given: Columns) -> tuple[pl.DataFrame, dict[str, str]]:
    """The columns as a frame, a list's cells as columns, and the units that its metadata state."""
    import polars as pl
    import pyarrow as pa

    from algid.readers.parquet import units_of_schema

    units: dict[str, str] = {}
    if isinstance(given, pl.DataFrame):
        frame = given
    else:
        try:
            table = pa.table(given)
            frame = cast("pl.DataFrame", pl.from_arrow(table))
        except Exception as error:  # whatever the frame's own library raises
            reason = str(error).split("\n", maxsplit=1)[0][:200]
            raise LogError(
                f"{NAME}: the frame cannot be taken over ({reason}); give columns of numbers"
            ) from error
        units = units_of_schema(table.schema)

    def width(column: str) -> int:
        first = frame[column].drop_nulls().head(1)
        return len(first.item()) if first.len() else 0

    flat = {name: cell.alias(name) for name, (cell, _) in cells(frame.schema, width).items()}
    return frame.select(*flat.values()), units
