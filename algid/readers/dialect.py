"""Dialect of a text table from its first lines: separator, decimal comma, header, comments."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.units import is_foreign, unit_of
from algid.base.words import counted
from algid.notices import Remedy
from algid.options import flag

COMMENTS = ("#", "%", "//")
_SEPARATORS = (";", "\t", ",", "|", "")
"""In the order in which they are tried; the last stands for runs of blanks."""
_NUMBER = re.compile(
    r"^[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?$|^[+-]?(nan|inf|infinity)$", re.IGNORECASE
)
_WHOLE = re.compile(r"^[+-]?\d{1,19}$")
_DATE = re.compile(r"^\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}:\d{2}")


class NoHeaderError(LogError):
    """A table without a header, of so many columns."""

    def __init__(self, columns: int, message: str) -> None:
        super().__init__(message)
        self.columns = columns


@dataclass(frozen=True)
class Dialect:
    """Dialect of one table.

    Parameters
    ----------
    columns : tuple of str
        The header's cells, blanks stripped.
    separator : str
        One character, or "" for runs of blanks.
    decimal_comma : bool
    skip : int
        Lines before the first row of data.
    comment : str or None
        What lines begin with that are no data.
    whole : frozenset of str
        Columns whose cells are all integers, as far as the first lines tell.
    padded : bool
        Whether blanks stand behind cells.
    units : mapping
        By column the unit that a row under the header states.
    dates : frozenset of str
        Columns whose cells are dates and times of day (ISO 8601).
    texts : frozenset of str
        Columns whose first cell is neither a number nor a date.
    """

    columns: tuple[str, ...]
    separator: str
    decimal_comma: bool
    skip: int
    comment: str | None
    whole: frozenset[str]
    padded: bool
    units: Mapping[str, str] = field(default_factory=dict)
    dates: frozenset[str] = frozenset()
    texts: frozenset[str] = frozenset()
    said: tuple[str, ...] = ()
    """Titles and comments among the first lines."""


def detect(path: Path, head: bytes, names: Sequence[str] | None = None) -> Dialect:
    """The dialect of the table with first bytes `head` and, if given, column names `names`.

    Raises
    ------
    LogError
        If there is no header, no data under it, there are not so many columns as names, or the text
        is not UTF-8.
    """
    lines = _lines(path, head)
    comment = _comment_sign(lines)
    data = _below_titles(list(_numbered(lines, comment)))
    if not data:
        raise LogError(f"{path}: no table in the text; expected a header and rows of numbers")
    number, header = data[0]
    above = [line.removeprefix(comment or "").strip() for line in lines[:number]]
    separator = _separator(path, header, _texts(data[1:20]))
    first_row = 1
    if all(_is_number(cell) for cell in split(header, separator) if cell):
        cells, first_row = split(header, separator), 0
        if names is None:
            header = _commented_header(path, above, cells, separator)
    columns = _named(path, split(header, separator), None if first_row else names)
    units: dict[str, str] = {}
    if len(data) > first_row:
        units = _units(columns, split(data[first_row][1], separator))
    if units:
        first_row += 1
    if len(data) <= first_row:
        raise LogError(f"{path}: a header and no rows below it; expected rows of numbers")
    dialect = _checked(path, columns, separator, comment, data[first_row:])
    comments = [line for line in lines[number:] if comment and line.startswith(comment)]
    said = (*filter(None, above), *(line.removeprefix(comment or "") for line in comments))
    return replace(dialect, units=units, said=said)


def _below_titles(data: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Numbered lines from the header on, which has as many cells as the numbers below it."""
    for first in range(min(len(data), LIMITS.title_lines)):
        lines = _texts(data[first : first + 5])
        if any(_begins_table(lines, separator) for separator in _SEPARATORS):
            return data[first:]
    return data


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
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    else:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip().strip('"').strip() for cell in cells]


def _cells_by_column(
    columns: Sequence[str], lines: Iterable[str], separator: str
) -> dict[str, list[str]]:
    """The cells under each column, of the lines that have one for each."""
    by_column: dict[str, list[str]] = {column: [] for column in columns}
    for line in lines:
        cells = split(line, separator)
        if len(cells) == len(columns):
            for column, cell in zip(columns, cells, strict=True):
                by_column[column].append(cell)
    return by_column


def _lines(path: Path, head: bytes) -> list[str]:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise LogError(f"{path}: the text is UTF-16; save it as UTF-8")
    text = head.decode("utf-8-sig", errors="replace")
    lines = re.split("\r\n|\n", text)
    if max(map(len, lines[:-1] or lines)) >= LIMITS.line_bytes - 4 or (
        len(lines) == 1 and len(head) >= LIMITS.line_bytes
    ):
        raise LogError(
            f"{path}: a line of more than 65,000 characters; expected a table of a few columns"
        )
    for number, line in enumerate(lines, start=1):
        if "\r" in line.rstrip("\r"):
            raise LogError(
                f"{path}: line {number} holds carriage returns alone, without line feeds; save it "
                "with line feeds"
            )
    if len(head) >= LIMITS.line_bytes:  # the last line may break off
        return lines[:-1]
    return lines


def _comment_sign(lines: Sequence[str]) -> str | None:
    """What the lines of comments begin with; None where there is none."""
    for sign in COMMENTS:
        if any(line.startswith(sign) for line in lines):
            return sign
    return None


def _numbered(lines: Sequence[str], comment: str | None) -> Iterator[tuple[int, str]]:
    """The lines that hold something and are no comments, with their numbers from 0."""
    for number, line in enumerate(lines):
        if line.strip() and (comment is None or not line.startswith(comment)):
            yield number, line


def _texts(numbered: Iterable[tuple[int, str]]) -> list[str]:
    """Lines without their numbers."""
    return [line for _, line in numbered]


def _separator(path: Path, header: str, rows: list[str]) -> str:
    for separator in _SEPARATORS:
        wanted = len(split(header, separator))
        if wanted > 1 and all(len(split(row, separator)) == wanted for row in rows[:-1]):
            return separator
    for separator in _SEPARATORS:
        if len(split(header, separator)) > 4:
            return separator
    raise LogError(
        f"{path}: {header[:60]!r} has one column; expected columns split by , ; | tab or blanks"
    )


def _named(path: Path, cells: list[str], names: Sequence[str] | None) -> tuple[str, ...]:
    """The header's cells, or the names that a user gives the columns."""
    if names is None:
        return tuple(cells)
    if len(names) != len(cells):
        raise LogError(
            f"{path}: {counted(len(cells), 'column')}, and {counted(len(names), 'name')} for them: "
            f"{', '.join(names)[:200]}; name each: {flag('columns')}"
        )
    return tuple(names)


def _commented_header(path: Path, above: list[str], cells: list[str], separator: str) -> str:
    """The header among the comments `above` the table."""
    for text in reversed(above):
        names = split(text, separator)
        if len(names) == len(cells) and not any(map(_is_number, names)):
            return text
    named = Remedy({"columns": ["t", "theta1", "theta2", "tau1", "tau2"]}, "name its columns")
    raise NoHeaderError(
        len(cells),
        f"{path}: the table has no header, its first line is {', '.join(cells)[:60]!r}; "
        f"put a line with the columns' names above it, or {named}",
    )


def _checked(
    path: Path,
    columns: tuple[str, ...],
    separator: str,
    comment: str | None,
    data: Sequence[tuple[int, str]],
) -> Dialect:
    """The dialect of a table with such columns and numbered rows."""
    skip, first = data[0]
    rows = _texts(data)
    cells = split(first, separator)
    if len(cells) != len(columns):
        raise LogError(
            f"{path}: line {skip + 1} has {counted(len(cells), 'cell')} under a header "
            f"of {len(columns)}; mend the header"
        )
    comma = padded = False
    if separator != ",":
        comma = any(_has_decimal_comma(row, separator) for row in rows)
    if separator:
        behind = re.compile(rf"[ \t]{re.escape(separator)}|[ ]$")
        padded = any(behind.search(row.rstrip("\r")) for row in rows)
    whole, dates, texts = set(), set(), set()
    for column, cells in _cells_by_column(columns, rows, separator).items():
        if all(map(_WHOLE.match, cells)):
            whole.add(column)
        if all(map(_DATE.match, cells)):
            dates.add(column)
        elif cells and cells[0] and not _is_number(cells[0]):
            texts.add(column)
    return Dialect(
        columns,
        separator,
        comma,
        skip,
        comment,
        frozenset(whole),
        padded,
        dates=frozenset(dates),
        texts=frozenset(texts),
    )


def _has_decimal_comma(row: str, separator: str) -> bool:
    return any("," in cell and _is_number(cell) for cell in split(row, separator))
