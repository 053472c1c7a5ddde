"""How a text table is written: separator, decimal comma, header, comments, found in its first lines."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

from algid.errors import LogError

COMMENTS = ("#", "%", "//")
_SEPARATORS = (";", "\t", ",", "|")
_NUMBER = re.compile(r"^[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?$|^[+-]?(nan|inf|infinity)$", re.IGNORECASE)
_WHOLE = re.compile(r"^[+-]?\d{1,19}$")
_LONGEST_LINE = 1 << 16
_MOST_COLUMNS = 4096


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
    """

    columns: tuple[str, ...]
    separator: str
    decimal_comma: bool
    skip: int
    comment: str | None
    whole: frozenset[str]
    padded: bool


def detect(path: Path, head: bytes) -> Dialect:
    """The dialect of the table whose first bytes are `head`.

    Raises
    ------
    LogError
        If there is no header, no data under it, or the text is not UTF-8.
    """
    lines = _lines(path, head)
    comment = next((sign for sign in COMMENTS if any(line.startswith(sign) for line in lines)), None)
    data = [(number, line) for number, line in enumerate(lines) if line.strip() and not _comment(line, comment)]
    if not data:
        raise LogError(f"{path}: no table in the text; expected a header and rows of numbers")
    number, header = data[0]
    separator = _separator(path, header, [line for _, line in data[1:20]])
    first_row = 1
    if all(_NUMBER.match(cell) for cell in split(header, separator) if cell):
        header, first_row = (
            _commented_header(path, lines[:number], comment, split(header, separator), separator),
            0,
        )
    columns = tuple(split(header, separator))
    if len(data) <= first_row:
        raise LogError(f"{path}: a header and no rows below it; expected rows of numbers")
    number, row = data[first_row]
    return _checked(path, columns, separator, number, comment, [line for _, line in data[first_row:]], row)


def kinds(path: Path, head: bytes, found: Dialect) -> dict[str, str]:
    """By column "Int64", "Float64" or "String", as far as the first lines tell."""
    lines = _lines(path, head)[found.skip :]
    rows = [split(line, found.separator) for line in lines if line.strip() and not _comment(line, found.comment)]
    table = zip(*(cells for cells in rows if len(cells) == len(found.columns)), strict=True)
    numbers = [all(not cell or _NUMBER.match(cell) for cell in cells) for cells in table]
    return {
        column: "Int64" if column in found.whole else "Float64" if number else "String"
        for column, number in zip(found.columns, numbers, strict=True)
    }


def split(line: str, separator: str) -> list[str]:
    """Cells of a line, blanks and quotes stripped."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)] if separator else line.split()
    cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), []) if separator else line.split()
    return [cell.strip().strip('"').strip() for cell in cells]


def _lines(path: Path, head: bytes) -> list[str]:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise LogError(f"{path}: the text is UTF-16; save it as UTF-8")
    text = head.decode("utf-8-sig", errors="replace")
    lines = re.split("\r\n|\n", text)
    if max(map(len, lines[:-1] or lines)) >= _LONGEST_LINE - 4 or (len(lines) == 1 and len(head) >= _LONGEST_LINE):
        raise LogError(f"{path}: a line of more than 65,000 characters; expected a table of a few columns")
    if len(lines) == 1 and "\r" in text:
        raise LogError(f"{path}: lines end in carriage returns alone; save it with line feeds")
    return lines if len(head) < _LONGEST_LINE else lines[:-1]


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
    raise LogError(f"{path}: {header[:60]!r} has one column; expected columns split by , ; | tab or blanks")


def _commented_header(path: Path, before: list[str], comment: str | None, cells: list[str], separator: str) -> str:
    for line in reversed(before):
        text = line.removeprefix(comment or "").strip()
        names = split(text, separator)
        if len(names) == len(cells) and not any(_NUMBER.match(name) for name in names):
            return text
    raise LogError(
        f"{path}: the table has no header, its first line is {', '.join(cells)[:60]!r}; "
        "put a line with the columns' names above it: t,theta1,theta2,tau1,tau2"
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
    if len(columns) > _MOST_COLUMNS:
        raise LogError(f"{path}: {len(columns)} columns; expected {_MOST_COLUMNS} at most")
    cells = split(first, separator)
    if len(cells) != len(columns):
        raise LogError(
            f"{path}: line {skip + 1} has {len(cells)} cells under a header of {len(columns)}; mend the header"
        )
    repeated = sorted({name for name in columns if name and columns.count(name) > 1})
    if repeated:
        raise LogError(f"{path}: the column {repeated[0]!r} stands in the header twice; rename one")
    comma = separator != "," and any(
        "," in cell and _NUMBER.match(cell) for row in rows for cell in split(row, separator)
    )
    padded = bool(separator) and any(re.search(rf"[ \t]{re.escape(separator)}|[ ]$", row.rstrip("\r")) for row in rows)
    table = [cells for cells in (split(row, separator) for row in rows) if len(cells) == len(columns)]
    whole = frozenset(column for column, *cells in zip(columns, *table, strict=True) if all(map(_WHOLE.match, cells)))
    return Dialect(columns, separator, comma, skip, comment, whole, padded)
