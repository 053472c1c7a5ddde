"""Dialect of a text table from its first lines: separator, decimal comma, header, comments."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from algid.errors import LogError
from algid.limits import LIMITS
from algid.notices import Remedy
from algid.options import flag
from algid.readers.stated import in_text
from algid.units import is_foreign, unit_of
from algid.words import counted

COMMENTS = ("#", "%", "//")
_SEPARATORS = (";", "\t", ",", "|")
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
        By column the unit that a row under the header states, else a line above it.
    dates : frozenset of str
        Columns whose cells are dates and times of day (ISO 8601).
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


def detect(path: Path, head: bytes, names: Sequence[str] | None = None) -> Dialect:
    """The dialect of the table with first bytes `head` and, if given, column names `names`.

    Raises
    ------
    LogError
        If there is no header, no data under it, there are not so many columns as names, or the text
        is not UTF-8.
    """
    lines = _lines(path, head)
    comment = next(
        (sign for sign in COMMENTS if any(line.startswith(sign) for line in lines)), None
    )
    data = [
        (number, line)
        for number, line in enumerate(lines)
        if line.strip() and not _comment(line, comment)
    ]
    if not data:
        raise LogError(f"{path}: no table in the text; expected a header and rows of numbers")
    data = _below_titles(data)
    number, header = data[0]
    above = [line.removeprefix(comment or "").strip() for line in lines[:number]]
    separator = _separator(path, header, [line for _, line in data[1:20]])
    first_row = 1
    if all(_is_number(cell) for cell in split(header, separator) if cell):
        cells, first_row = split(header, separator), 0
        if names is None:
            header = _commented_header(path, lines[:number], comment, cells, separator)
    columns = _named(path, split(header, separator), names)
    units = _units(columns, split(data[first_row][1], separator)) if len(data) > first_row else {}
    first_row += bool(units)
    if len(data) <= first_row:
        raise LogError(f"{path}: a header and no rows below it; expected rows of numbers")
    number, row = data[first_row]
    dialect = _checked(
        path, columns, separator, number, comment, [line for _, line in data[first_row:]], row
    )
    return replace(dialect, units={**in_text(above, columns), **units})


def described(path: Path, head: bytes) -> Dialect:
    """The dialect of a table to look at: columns without a name are numbered.

    Raises as `detect`.
    """
    try:
        return detect(path, head)
    except NoHeaderError as error:
        return detect(path, head, [f"column {place + 1}" for place in range(error.columns)])


def _below_titles(data: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Numbered lines from the header on, which has as many cells as the numbers below it."""
    for first in range(min(len(data), LIMITS.title_lines)):
        for separator in (*_SEPARATORS, ""):
            table = [split(line, separator) for _, line in data[first : first + 5]]
            rows = table[2:] if len(table) > 2 and _units(table[0], table[1]) else table[1:]
            # the last line may break off
            same = len(table[0]) > 1 and all(
                len(row) == len(table[0]) for row in table[: max(2, len(table) - 1)]
            )
            if same and rows and _numeric(rows[0]) and not _numeric(table[0]):
                return data[first:]
    return data


def _numeric(cells: Sequence[str]) -> bool:
    """Whether half of the cells hold numbers, dates or nothing, and one a number."""
    numbers = sum(map(_is_number, cells))
    return numbers > 0 and 2 * (
        numbers + sum(not cell or bool(_DATE.match(cell)) for cell in cells)
    ) >= len(cells)


def _is_number(cell: str) -> bool:
    """Whether a cell holds a number; long cells hold none, as the pattern takes quadratic time."""
    return len(cell) <= LIMITS.number_letters and _NUMBER.match(cell) is not None


def _units(columns: Sequence[str], cells: Sequence[str]) -> dict[str, str]:
    """By column its unit, if every cell of a row names one or is empty; else nothing."""
    texts = [cell.strip("[]() ") for cell in cells]
    known = [bool(text) and (unit_of(text) is not None or is_foreign(text)) for text in texts]
    if len(cells) != len(columns) or not any(known):
        return {}
    if not all(one or text in ("", "-", "1") for one, text in zip(known, texts, strict=True)):
        return {}
    return {column: text for column, text, one in zip(columns, texts, known, strict=True) if one}


def kinds(path: Path, head: bytes, found: Dialect) -> dict[str, str]:
    """By column "Int64", "Float64" or "String", as far as the first lines tell."""
    lines = _lines(path, head)[found.skip :]
    lines = lines[:-1] or lines  # the last may break off in the middle of a number
    rows = [
        split(line, found.separator)
        for line in lines
        if line.strip() and not _comment(line, found.comment)
    ]
    table = zip(*(cells for cells in rows if len(cells) == len(found.columns)), strict=True)
    numbers = [all(not cell or _is_number(cell) for cell in cells) for cells in table]
    return {
        column: "Int64" if column in found.whole else "Float64" if number else "String"
        for column, number in zip(found.columns, numbers, strict=True)
    }


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, blanks and quotes stripped."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)] if separator else line.split()
    cells = (
        next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
        if separator
        else line.split()
    )
    return [cell.strip().strip('"').strip() for cell in cells]


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
    lone = next(
        (number for number, line in enumerate(lines, start=1) if "\r" in line.rstrip("\r")), None
    )
    if lone is not None:
        raise LogError(
            f"{path}: line {lone} holds carriage returns alone, without line feeds; save it with "
            "line feeds"
        )
    return lines if len(head) < LIMITS.line_bytes else lines[:-1]


def _comment(line: str, comment: str | None) -> bool:
    return comment is not None and line.startswith(comment)


def _separator(path: Path, header: str, rows: list[str]) -> str:
    for separator in (*_SEPARATORS, ""):
        wanted = len(split(header, separator))
        if wanted > 1 and all(len(split(row, separator)) == wanted for row in rows[:-1]):
            return separator
    for separator in (*_SEPARATORS, ""):
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


def _commented_header(
    path: Path, before: list[str], comment: str | None, cells: list[str], separator: str
) -> str:
    for line in reversed(before):
        text = line.removeprefix(comment or "").strip()
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
    skip: int,
    comment: str | None,
    rows: list[str],
    first: str,
) -> Dialect:
    if len(columns) > LIMITS.columns:
        raise LogError(
            f"{path}: {counted(len(columns), 'column')}; expected {LIMITS.columns} at most"
        )
    cells = split(first, separator)
    if len(cells) != len(columns):
        raise LogError(
            f"{path}: line {skip + 1} has {counted(len(cells), 'cell')} under a header "
            f"of {len(columns)}; mend the header"
        )
    repeated = sorted(name for name, count in Counter(columns).items() if name and count > 1)
    if repeated:
        raise LogError(f"{path}: the column {repeated[0]!r} stands in the header twice; rename one")
    comma = separator != "," and any(
        "," in cell and _is_number(cell) for row in rows for cell in split(row, separator)
    )
    padded = bool(separator) and any(
        re.search(rf"[ \t]{re.escape(separator)}|[ ]$", row.rstrip("\r")) for row in rows
    )
    table = [
        cells for cells in (split(row, separator) for row in rows) if len(cells) == len(columns)
    ]
    whole = frozenset(
        column
        for column, *cells in zip(columns, *table, strict=True)
        if all(map(_WHOLE.match, cells))
    )
    dates = frozenset(
        column
        for column, *cells in zip(columns, *table, strict=True)
        if all(map(_DATE.match, cells))
    )
    return Dialect(columns, separator, comma, skip, comment, whole, padded, dates=dates)
