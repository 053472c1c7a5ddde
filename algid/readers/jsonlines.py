"""JSON lines, an object a line: ``{"motor_state": [{"q": 1}]}`` has the column ``motor_state[0].q``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, cast

from algid.errors import LogError
from algid.limits import LIMITS

if TYPE_CHECKING:
    import polars as pl


def is_lines(head: bytes) -> bool:
    """Whether the first line of a text is a JSON object, with another behind it."""
    first, _, rest = head.lstrip(b"\xef\xbb\xbf \t\r\n").partition(b"\n")
    if not (first.startswith(b"{") and rest.lstrip().startswith(b"{")):
        return False
    try:
        return isinstance(json.loads(first), dict)
    except (ValueError, RecursionError):
        return False


def frame_of_lines(path: Path) -> pl.DataFrame:
    """The lines as one frame of flat columns; what a line lacks is null.

    Raises
    ------
    LogError
        If a line is no JSON object.
    """
    import polars as pl

    try:
        with path.open("rb") as stream:
            frame = pl.read_ndjson(stream, infer_schema_length=None)
    except pl.exceptions.PolarsError as error:
        reason = str(error).split("\n", maxsplit=1)[0][:200]
        place = _wrong_line(path)
        raise LogError(
            f"{path}: {place}expected a JSON object in every line ({reason}); mend or cut it"
        ) from error
    cells = []
    for name, kind in frame.schema.items():
        for path_of, cell in _numbers(name, pl.col(name), kind, frame):
            cells.append(cell.alias(path_of))
            if len(cells) > LIMITS.columns:
                raise LogError(
                    f"{path}: more than {LIMITS.columns} columns; expected a log of an arm"
                )
    return frame.select(cells)


def _wrong_line(path: Path) -> str:
    """Which line is no JSON object, in words; nothing where all are."""
    with path.open("rb") as stream:
        for number, line in enumerate(
            iter(lambda: stream.readline(LIMITS.json_bytes), b""), start=1
        ):
            try:
                if line.strip() and not isinstance(json.loads(line), dict):
                    return f"line {number}: "
            except (ValueError, RecursionError):
                return f"line {number}: "
    return ""


def _numbers(
    name: str, cell: pl.Expr, kind: pl.DataType, frame: pl.DataFrame
) -> Iterator[tuple[str, pl.Expr]]:
    """Every cell below a column, with its path."""
    import polars as pl

    if isinstance(kind, pl.Struct):
        for field in kind.fields:
            inner = cast("pl.DataType", field.dtype)
            yield from _numbers(f"{name}.{field.name}", cell.struct.field(field.name), inner, frame)
    elif isinstance(kind, pl.List):
        size = frame.select(cell.list.len().max()).item() or 0
        for place in range(min(size, LIMITS.list_cells)):
            inner = cast("pl.DataType", kind.inner)
            yield from _numbers(
                f"{name}[{place}]", cell.list.get(place, null_on_oob=True), inner, frame
            )
    else:
        yield name, cell
