"""The last row of a text without a line end: whole, or cut off in the middle by a crash."""

from __future__ import annotations

import re
from enum import Enum, auto
from pathlib import Path

from algid.readers.dialect import Dialect, split

_LOOKED = 1 << 16
"""Bytes before the last row in which the form of its last number is looked for."""
_ENOUGH = 10
"""Rows that must write a column alike before its form is taken as fixed."""
_NUMBER = re.compile(r"[+-]?\d+(\D.*)?")


class LastRow(Enum):
    """Whether the numbers of a last row can be used."""

    WHOLE = auto()
    CUT = auto()
    DOUBTFUL = auto()


def ends_with_a_line(path: Path) -> bool:
    """Whether the last byte of a file is a line end."""
    with path.open("rb") as stream:
        stream.seek(-1, 2)
        return stream.read(1) == b"\n"


def judged(line: bytes, before: bytes, dialect: Dialect, last: int) -> LastRow:
    """What is known of a row that has no line end.

    Its last number may lack digits: ``0.4`` may have been 0.4711 or, as ``1.2``, 1.2e-05. Where
    the rows before write that column in one form, such as six decimals, the form tells. Elsewhere
    nothing does.

    Parameters
    ----------
    line : bytes
        The row.
    before : bytes
        The text before it, which ends with a line.
    dialect : Dialect
    last : int
        Place of the last column that is needed.

    Returns
    -------
    LastRow
    """
    if not line.strip() or (dialect.comment and line.startswith(dialect.comment.encode())):
        return LastRow.WHOLE
    cells = _cells(line, dialect)
    if len(cells) <= last or not cells[last]:
        return LastRow.CUT
    if len(cells) > last + 1 or line.endswith((b" ", b"\t", b"\r", b'"')):
        return LastRow.WHOLE
    forms = _forms(before, dialect, last)
    if len(forms) >= _ENOUGH and len(set(forms)) == 1:
        return LastRow.WHOLE if _form(cells[last]) == forms[0] else LastRow.CUT
    return LastRow.DOUBTFUL if len(cells) == len(dialect.columns) else LastRow.CUT


def _cells(line: bytes, dialect: Dialect) -> list[str]:
    return split(line.decode("utf-8", errors="replace"), dialect.separator)


def _forms(before: bytes, dialect: Dialect, place: int) -> list[str]:
    """How the numbers of a column are written behind their whole digits, in the last rows."""
    forms = []
    for line in before[-_LOOKED:].split(b"\n")[1:]:
        cells = _cells(line, dialect)
        if len(cells) > place and (form := _form(cells[place])):
            forms.append(form)
    return forms


def _form(cell: str) -> str:
    """What stands behind a number's whole digits, each digit as 0: ``.000``, ``.00e-00``."""
    number = _NUMBER.fullmatch(cell)
    if number is None or not number[1]:
        return ""
    return re.sub(r"\d", "0", number[1]).replace("+", "-")
