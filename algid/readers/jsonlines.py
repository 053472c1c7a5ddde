"""JSON lines, one object each: ``{"motor_state": [{"q": 1}]}`` has ``motor_state[0].q``."""

from __future__ import annotations

import io
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

    A last line that breaks off is a row of nulls.

    Raises
    ------
    LogError
        If another line is no JSON object.
    """
    import polars as pl

    end = _end_of_whole_lines(path)
    try:
        with path.open("rb") as stream:
            source = stream if end is None else io.BytesIO(stream.read(end))
            frame = pl.read_ndjson(source, infer_schema_length=None)
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
    found = frame.select(cells)
    return found if end is None else pl.concat([found, found.clear(1)])


def _end_of_whole_lines(path: Path) -> int | None:
    """Where the last line begins if it breaks off: it has no line end, and is no JSON object."""
    with path.open("rb") as stream:
        size = stream.seek(0, io.SEEK_END)
        start = stream.seek(max(0, size - LIMITS.json_bytes))
        tail = stream.read()
    end = tail.rfind(b"\n") + 1
    if not end or _is_object(tail[end:]):
        return None
    return start + end


def _is_object(line: bytes) -> bool:
    """Whether a line is a JSON object, or nothing."""
    try:
        return not line.strip() or isinstance(json.loads(line), dict)
    except (ValueError, RecursionError):
        return False


def _wrong_line(path: Path) -> str:
    """Which line is no JSON object, in words; nothing where all are."""
    with path.open("rb") as stream:
        for number, line in enumerate(
            iter(lambda: stream.readline(LIMITS.json_bytes), b""), start=1
        ):
            if not _is_object(line):
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
