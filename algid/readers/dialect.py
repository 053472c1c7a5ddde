"""Tables of text: recognised, unpacked, and their dialect from the first lines."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.text import counted
from algid.base.units import is_foreign, unit_of
from algid.options import flag

if TYPE_CHECKING:
    import pyarrow as pa

COMMENTS = ("#", "%", "//")
_SEPARATORS = (";", "\t", ",", "|", "")
"""In the order in which they are tried; the last stands for runs of blanks."""
_NUMBER = re.compile(
    r"^[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?$|^[+-]?(nan|inf|infinity)$", re.IGNORECASE
)
_WHOLE = re.compile(r"^[+-]?\d{1,19}$")
_DATE = re.compile(r"^\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}:\d{2}")
_ZONED = re.compile(r"(?:Z|[+-]\d{2}:?\d{2})$")

_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_CODECS = {"csv.gz": "gzip", "csv.zst": "zstd"}


def looks_like_text(head: bytes) -> bool:
    """Whether bytes are UTF-8 text, with tabs and line ends as only controls, or UTF-16."""
    if head.startswith(_UTF16):
        return True
    if any(byte < 32 and byte not in b"\t\n\r\f" for byte in set(head)):
        return False
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start > len(head) - 4
    return True


def pieces(path: Path, kind: str) -> Iterator[bytes]:
    """The text of a "csv", "csv.gz" or "csv.zst" file, 64 KiB or more at a time.

    Raises
    ------
    LogError
        If compressed data are damaged, cut off, or unpack to more than any table.
    """
    import pyarrow as pa

    most = LIMITS.free_text_bytes + LIMITS.text_a_byte * path.stat().st_size
    size, total = LIMITS.head_bytes, 0
    try:
        with pa.input_stream(str(path), compression=_CODECS.get(kind)) as stream:
            while piece := stream.read(size):
                total += len(piece)
                if total > most:
                    raise LogError(
                        f"the compressed data unpack to more than {counted(most, 'byte')}, "
                        "as no table of their size does; if it is one, unpack it first"
                    )
                yield piece
                size = 1 << 24
    except (OSError, ValueError) as error:
        raise LogError(
            f"the compressed data are damaged or cut off ({error}); copy it again"
        ) from error


def head_of(path: Path, kind: str) -> bytes:
    """The first unpacked bytes, 64 KiB at most."""
    return next(pieces(path, kind), b"")


@dataclass(frozen=True, eq=False)
class Dialect:
    """Dialect of one table.

    Parameters
    ----------
    schema : pyarrow.Schema
        The header's cells, blanks stripped, numbered where there is no header; integers, dates (ISO
        8601), texts or numbers by what the first lines hold; units of a row under the header.
    separator : str
        One character, or "" for runs of blanks.
    decimal_comma : bool
    skip : int
        Lines before the first row of data.
    comment : str or None
        What lines begin with that are no data.
    padded : bool
        Whether blanks stand behind cells.
    said : tuple of str
        Titles and comments among the first lines.
    """

    schema: pa.Schema
    separator: str
    decimal_comma: bool
    skip: int
    comment: str | None
    padded: bool
    said: tuple[str, ...] = ()


def detect(head: bytes, names: Sequence[str] | None = None) -> Dialect:
    """The dialect of the table with first bytes `head` and, if given, column names `names`.

    Raises
    ------
    LogError
        If there are no data, not so many columns as names, or the text is not UTF-8.
    """
    import pyarrow as pa

    if head.startswith(_UTF16):
        raise LogError("the text is UTF-16; save it as UTF-8")
    lines = re.split("\r\n|\n", head.decode("utf-8-sig", errors="replace"))
    if len(head) >= LIMITS.head_bytes:
        lines.pop()  # it may break off
    signs = (sign for sign in COMMENTS if any(line.startswith(sign) for line in lines))
    comment = next(signs, None)
    data = []
    for number, line in enumerate(lines):
        if line.strip() and not (comment and line.startswith(comment)):
            data.append((number, line))
    # above the header titles may stand
    for first in range(min(len(data), LIMITS.title_lines)):
        begin = [line for _, line in data[first : first + 5]]
        if any(_begins_table(begin, separator) for separator in _SEPARATORS):
            data = data[first:]
            break
    if not data:
        raise LogError("no table in the text; expected a header and rows, a line feed behind each")
    number, header = data[0]
    rows = [line for _, line in data[1:]]
    separator = _separator(header, rows[:19])
    columns, skip = split(header, separator), 1
    above = [line.removeprefix(comment or "").strip() for line in lines[:number]]
    if all(_is_number(cell) for cell in columns if cell):
        skip, rows = 0, [header, *rows]
        if names and len(names) != len(columns):
            raise LogError(
                f"{counted(len(columns), 'column')}, and {counted(len(names), 'name')} for "
                f"them: {', '.join(names)[:200]}; name each: {flag('columns')}"
            )
        # the header may be one of the comments above
        texts = (split(text, separator) for text in reversed(above))
        fitting = [one for one in texts if len(one) == len(columns)]
        numbered = [f"column {place}" for place in range(1, len(columns) + 1)]
        found_above = next((one for one in fitting if not any(map(_is_number, one))), numbered)
        columns = list(names or found_above)
    units = _units(columns, split(rows[0], separator)) if rows else {}
    if units:
        skip, rows = skip + 1, rows[1:]
    if not rows:
        raise LogError(
            "a header and no rows below it; expected rows of numbers, a line feed behind each"
        )
    found = [split(row, separator) for row in rows]
    if len(found[0]) != len(columns):
        raise LogError(
            f"line {data[skip][0] + 1} has {counted(len(found[0]), 'cell')} under a header "
            f"of {len(columns)}; mend the header"
        )
    fields = []
    whole_rows = [one for one in found if len(one) == len(columns)]
    for column, values in zip(columns, zip(*whole_rows, strict=True), strict=True):
        kind = pa.float64()
        if all(map(_DATE.match, values)):
            kind = pa.timestamp("ns", "UTC" if _ZONED.search(values[0]) else None)
        elif values[0] and not _is_number(values[0]):
            kind = pa.string()
        elif all(map(_WHOLE.match, values)):
            kind = pa.int64()
        fields.append(
            pa.field(column, kind, metadata=units.get(column) and {"unit": units[column]})
        )
    behind = re.compile(rf"[ \t]{re.escape(separator)}|[ ]$")
    comments = [line for line in lines[number:] if comment and line.startswith(comment)]
    return Dialect(
        pa.schema(fields),
        separator,
        decimal_comma=separator != ","
        and any("," in cell and _is_number(cell) for one in found for cell in one),
        skip=data[skip][0],
        comment=comment,
        padded=not separator or any(behind.search(row.rstrip("\r")) for row in rows),
        said=(*filter(None, above), *(line.removeprefix(comment or "") for line in comments)),
    )


def _begins_table(lines: Sequence[str], separator: str) -> bool:
    """Whether the first line is a header, for it has as many cells as the numbers below it."""
    header, *rows = (split(line, separator) for line in lines)
    whole = rows if len(rows) < 2 else rows[:-1]  # the last line may break off
    if len(header) < 2 or set(map(len, whole)) - {len(header)}:
        return False
    if len(rows) > 1 and _units(header, rows[0]):
        rows = rows[1:]
    return bool(rows) and _numeric(rows[0]) and not _numeric(header)


def _numeric(cells: Sequence[str]) -> bool:
    """Whether half of the cells hold numbers, dates or nothing, and one a number."""
    numbers = sum(map(_is_number, cells))
    others = sum(not cell or bool(_DATE.match(cell)) for cell in cells)
    return numbers > 0 and 2 * (numbers + others) >= len(cells)


def _is_number(cell: str) -> bool:
    """Whether a cell holds a number; long cells hold none, as the pattern takes quadratic time."""
    return len(cell) <= LIMITS.number_letters and _NUMBER.match(cell) is not None


def _units(columns: Sequence[str], cells: Sequence[str]) -> dict[str, str]:
    """By column its unit, if every cell of a row names one or is empty; else nothing."""
    if len(cells) != len(columns):
        return {}
    units = {}
    for column, cell in zip(columns, cells, strict=True):
        text = cell.strip("[]() ")
        if text and (unit_of(text) is not None or is_foreign(text)):
            units[column] = text
        elif text not in ("", "-", "1"):
            return {}
    return units


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, blanks and quotes stripped."""
    if not separator:
        cells = line.split()
    elif '"' in line:
        whole = line.replace("\r", " ")  # csv takes one for the end of a line
        cells = next(csv.reader([whole], delimiter=separator, skipinitialspace=True), [])
    else:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip().strip('"').strip() for cell in cells]


def _separator(header: str, rows: list[str]) -> str:
    for separator in _SEPARATORS:
        wanted = len(split(header, separator))
        if wanted > 1 and all(len(split(row, separator)) == wanted for row in rows[:-1]):
            return separator
    for separator in _SEPARATORS:
        if len(split(header, separator)) > 4:
            return separator
    raise LogError(f"{header[:60]!r} has one column; expected columns split by , ; | tab or blanks")
