"""JSON lines, one object each: ``{"motor_state": [{"q": 1}]}`` has ``motor_state[0].q``."""

from __future__ import annotations

import io
import json
import math
from codecs import BOM_UTF8
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, cast

from algid.errors import LogError
from algid.limits import LIMITS
from algid.readers.text import end_of_lines

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
        If another line is no JSON object, or one lies too deep within itself.
    """
    import polars as pl

    _refuse_depth(path)
    end = _end_of_whole_lines(path)
    try:
        with path.open("rb") as stream:
            marked = stream.read(len(BOM_UTF8)) == BOM_UTF8
            start = stream.seek(len(BOM_UTF8) if marked else 0)
            whole = end is None and not marked
            source = (
                stream if whole else io.BytesIO(stream.read(-1 if end is None else end - start))
            )
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
    flat = frame.select(cells)
    return flat if end is None else pl.concat([flat, flat.clear(1)])


_OTHER_THAN_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_AS_ONE_KIND = bytes.maketrans(b"{}", b"[]")


def _refuse_depth(path: Path) -> None:
    """Raises `LogError` where lists and objects lie deep: polars takes the cube of their depth."""
    with path.open("rb") as stream:
        for number, line in enumerate(stream, start=1):
            if line.count(b"[") + line.count(b"{") > LIMITS.json_depth and _is_deep(line):
                raise LogError(
                    f"{path}: line {number}: lists and objects within one another, more than "
                    f"{LIMITS.json_depth} deep; expected a sample of an arm in every line"
                )


def _is_deep(line: bytes) -> bool:
    """Whether something stays of the brackets once the innermost ones are gone so many times."""
    brackets = line.translate(_AS_ONE_KIND, _OTHER_THAN_BRACKETS)
    for _ in range(LIMITS.json_depth):
        brackets = brackets.replace(b"[]", b"")
    return bool(brackets) and _depth_of(line) > LIMITS.json_depth


def _depth_of(line: bytes) -> float:
    """How deep lists and objects lie in a line; 0 where it is no JSON."""
    try:
        level, deepest = [json.loads(line)], 0
    except RecursionError:
        return math.inf
    except ValueError:
        return 0
    while level := [one for one in level if isinstance(one, list | dict)]:
        deepest += 1
        inner: list[object] = []
        for one in level:
            inner += one.values() if isinstance(one, dict) else one
        level = inner
    return deepest


def _end_of_whole_lines(path: Path) -> int | None:
    """Where the last line begins if it breaks off: it has no line end, and is no JSON object."""
    before_nul = end_of_lines(path)
    if before_nul is not None:
        return before_nul
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
        return not line.strip() or isinstance(json.loads(line, parse_constant=_no_number), dict)
    except (ValueError, RecursionError):
        return False


def _no_number(word: str) -> NoReturn:
    """JSON has no NaN and no Infinity, and polars reads none."""
    raise ValueError(f"{word} is no JSON")


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
