"""CSV logs, plain or compressed, through polars: only needed columns, a block at a time."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.errors import LogError
from algid.files import read_whole
from algid.limits import LIMITS
from algid.log import loads
from algid.notices import Notice
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign
from algid.readers.dialect import Dialect, detect
from algid.readers.frames import NO_COMPANION, WholeRows, beyond, flat_reader
from algid.readers.last_row import LastRow, ends_with_a_line, judged
from algid.readers.text import (
    NUL_AMONG_ROWS,
    end_of_lines,
    ending_with_lines,
    head_of,
    pieces,
    whole_lines,
)

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile
    from algid.readers.frames import Frame

_EXCESS = "excess"

_SPLIT = 1 << 16
_LINE_END = ord("\n")


def sidecar(path: Path) -> Path:
    """Where the truth of a CSV log stands: ``LOG.csv.truth.json``."""
    return path.with_name(path.name + ".truth.json")


def open_csv(path: Path, profile: Profile, kind: str = "csv") -> TableReader:
    """Open a CSV log; `kind` is "csv", "csv.zst" or "csv.gz".

    Raises
    ------
    LogError
        If the text is no table, or columns are missing.
    """
    head = head_of(path, kind)
    dialect = detect(path, head, profile.columns)
    beside = sidecar(path)
    try:
        companion = loads(read_whole(beside)) if beside.is_file() else NO_COMPANION
    except (OSError, ValueError) as error:
        raise LogError(
            f"{beside}: the truth beside the log cannot be read ({error}); remove it"
        ) from error
    columns = assign(str(path), dialect.columns, profile, dialect.units, companion.sums)
    if columns.rate is None and columns.sources["t"] in dialect.dates:
        columns = columns.dated()
    size = path.stat().st_size
    end = end_of_lines(path) if kind == "csv" else None
    # rows to expect of plain text: from the length of its first lines, and a tenth more
    length = size if end is None else end
    rows = int(1.1 * length * head.count(b"\n") / len(head)) + 16 if kind == "csv" else 0
    frames = partial(_frames, path, kind, dialect)
    reader = flat_reader(str(path), "csv", columns, frames, profile, rows, companion)
    if end is None:
        return reader
    numbers = {"case": "lines", "bytes": size - end}
    lost = Notice("CUT_OFF", numbers=numbers, lossy=True)
    return replace(reader, notices=(lost, *reader.notices))


def counted_rows(path: Path, kind: str, dialect: Dialect) -> int:
    """Lines of the table under its header that are neither empty nor comments.

    Raises
    ------
    LogError
        If compressed text is damaged, or a line is no table's.
    """
    return sum(_rows_in(text, dialect.comment) for text in _table(path, kind, dialect))


def _table(path: Path, kind: str, dialect: Dialect) -> Iterator[bytes]:
    """The text under the header, in pieces that end with a line, but for the last.

    Raises
    ------
    LogError
        If compressed text is damaged, or a line is no table's.
    """
    skip = dialect.skip
    for text in ending_with_lines(path, _small(pieces(path, kind, _SPLIT))):
        while skip and text:
            text = text.partition(b"\n")[2]
            skip -= 1
        yield text


def _rows_in(text: bytes, comment: str | None) -> int:
    """Lines of a text that are neither blank nor comments."""
    letters = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(letters == _LINE_END)
    starts = ends[:-1] + 1 if text.endswith(b"\n") else ends + 1
    odd = b" \t\r\v\f\n" + (comment or "").encode()[:1]
    # only a line that begins oddly may be blank or a comment
    if text[:1] not in odd and not np.isin(letters[starts], list(odd)).any():
        return starts.size + 1
    marks = (comment.encode(),) if comment else ()
    return sum(1 for line in text.split(b"\n") if line.strip() and not line.startswith(marks))


def _frames(
    path: Path, kind: str, dialect: Dialect, columns: Columns, rows: int, most: int | None
) -> Iterator[Frame]:
    """Frames of about `rows` rows, over the first `most` rows where that is given."""
    import polars as pl

    done = 0
    # of rows without a value, and of quotes that are left open, the whole pass tells
    counted_before = most is not None
    if not counted_before and len(dialect.columns) > len(columns.sources):
        _check_quotes(path, kind, dialect)
    try:
        for frame in _parsed(path, kind, dialect, columns, rows, most):
            if isinstance(frame, WholeRows):
                yield frame
                return
            if frame[_EXCESS].any():
                row = done + (frame[_EXCESS].arg_max() or 0) + 1
                raise LogError(
                    f"{path}: row {row} has more cells than the header's {len(dialect.columns)}; "
                    "mend that row"
                )
            done += frame.height
            # in place: `drop` would queue behind the parsing of the next rows
            frame.drop_in_place(_EXCESS)
            # empty lines, which are no rows, or rows without a value
            if any(frame.null_count().row(0)):
                if not counted_before and (lost := _without_values(path, kind, dialect, columns)):
                    yield frame.clear(lost)
                counted_before = True
                frame = frame.filter(~pl.all_horizontal(pl.all().is_null()))
            yield frame
            if most is not None and done >= most:
                return
    except pl.exceptions.PolarsError as error:
        reason = str(error).split("\n", maxsplit=1)[0]
        wrong = re.search(
            r"could not parse `(.*?)` as dtype `\w+` at column '(\d+)'", reason, re.DOTALL
        )
        if wrong is None:
            raise LogError(
                f"{path}: the table cannot be read past row {done}: {reason[:200]}"
            ) from error
        if "\0" in wrong[1]:
            raise LogError(f"{path}: past row {done}: {NUL_AMONG_ROWS}") from error
        raise LogError(
            f"{path}: column {dialect.columns[int(wrong[2])]!r}, past row {done}: expected a "
            f"number, found {wrong[1][:40]!r}; mend the file or name another column"
        ) from error


def _lines(path: Path, kind: str, dialect: Dialect) -> Iterator[tuple[int, bytes]]:
    """The lines under the header that are no comments, with their numbers.

    Those between quotes are lines too. Long runs of lines without cells and quotes are passed over.

    Raises
    ------
    LogError
        If a line is no table's.
    """
    comment = dialect.comment.encode() if dialect.comment else b"\n"
    separator = dialect.separator.encode()
    rest, number = b"", 0
    for piece in chain(_small(pieces(path, kind)), [b"\n"]):
        text = rest + piece
        if separator not in text and b'"' not in text:
            number += text.count(b"\n")
            lines, rest = [], text[text.rfind(b"\n") + 1 :]
        else:
            *lines, rest = text.split(b"\n")
        if len(rest) > LIMITS.line_bytes:
            raise LogError(
                f"{path}: a line of more than 65,000 characters; expected rows of numbers"
            )
        for line in lines:
            number += 1
            if number > dialect.skip and not line.startswith(comment):
                yield number, line


def _small(found: Iterator[bytes]) -> Iterator[bytes]:
    """The same bytes, at most `_SPLIT` at once: a list of empty lines takes 8 times the memory."""
    for piece in found:
        for start in range(0, len(piece), _SPLIT):
            yield piece[start : start + _SPLIT]


def _without_values(path: Path, kind: str, dialect: Dialect, columns: Columns) -> int:
    """Rows that have cells, and in the columns that are needed only empty ones."""
    separator = dialect.separator.encode()
    if not separator:
        return 0
    comment = dialect.comment.encode() if dialect.comment else b"\n"
    needed = _places(dialect, columns)
    suspects = _lines_without(min(needed), separator)
    lost = 0
    for text in _table(path, kind, dialect):
        for line in suspects.findall(text):
            if separator in line and not line.startswith(comment):
                lost += _is_empty(line.split(separator), needed)
    return lost


def _is_empty(cells: list[bytes], places: Sequence[int]) -> bool:
    """Whether the cells at some places of a row hold nothing."""
    held = [cells[place].strip(b' \t\r"') for place in places if place < len(cells)]
    return not any(held)


def _places(dialect: Dialect, columns: Columns) -> list[int]:
    """Where the cells of the channels stand in a row."""
    return [dialect.columns.index(column) for column in columns.sources.values()]


def _lines_without(place: int, separator: bytes) -> re.Pattern[bytes]:
    """Lines whose cell at `place` is empty, or that have no such cell."""
    mark = re.escape(separator)
    cell = rb"[^\n%s]*" % mark
    before = rb"(?:%s%s)" % (cell, mark)
    empty = rb"%s{%d}[ \t\r\"]*(?:%s[^\n]*)?$" % (before, place, mark)
    short = rb"%s{0,%d}%s$" % (before, place - 1, cell)
    return re.compile(rb"^(?:%s)" % (empty if place == 0 else empty + b"|" + short), re.MULTILINE)


def _leaves_quotes_open(text: bytes) -> bool:
    """Whether some line of a text, which ends with a line, holds an odd number of quotes."""
    if b'"' not in text:
        return False
    letters = np.frombuffer(text, np.uint8)
    quotes = np.flatnonzero(letters == ord('"'))
    lines = np.searchsorted(np.flatnonzero(letters == _LINE_END), quotes)
    return bool(np.any(np.bincount(lines) % 2))


def _check_quotes(path: Path, kind: str, dialect: Dialect) -> None:
    """Refuse rows that lie between quotes, where polars would take them for the text of a cell.

    Raises
    ------
    LogError
        If a line that begins between quotes has the cells of a row.
    """
    if not dialect.separator or not any(map(_leaves_quotes_open, _table(path, kind, dialect))):
        return
    inside = 0
    separators = len(dialect.columns) - 1
    for number, line in _lines(path, kind, dialect):
        if inside and line.count(dialect.separator.encode()) >= separators:
            raise LogError(
                f"{path}: line {number} lies between quotes, of which the first stands in line "
                f"{inside}; close the "
                "quotes of that line, or save the table without quotes"
            )
        if line.count(b'"') % 2:
            inside = 0 if inside else number


def _parsed(
    path: Path, kind: str, dialect: Dialect, columns: Columns, rows: int, most: int | None
) -> Iterator[Frame]:
    """Frames with the column of excess; at the end a row that is left out, if it may break off."""
    scan = partial(_scan, dialect, columns, most)
    if kind == "csv" and dialect.separator and ends_with_a_line(path):
        yield from scan(path, dialect.skip).collect_batches(chunk_size=rows)
        return
    last = max(_places(dialect, columns))
    skip, before = dialect.skip, b""
    for text in whole_lines(path, kind):
        if not text.endswith(b"\n"):
            row = judged(text, before, dialect, last)
            if row is not LastRow.WHOLE:
                yield WholeRows.left_out(columns, lost=row is LastRow.CUT)
                return
        if not dialect.separator:  # runs of blanks become one tab
            text = re.sub(rb"(?m)^\t|\t(?=\r?$)", b"", re.sub(rb"[ \t]+", b"\t", text))
        yield scan(io.BytesIO(text), skip).collect()
        skip, before = 0, text


def _scan(
    dialect: Dialect, columns: Columns, most: int | None, source: Path | io.BytesIO, skip: int
) -> pl.LazyFrame:
    """The columns' numbers, and whether a row has cells beyond the header's."""
    import polars as pl

    whole = dialect.whole & {columns.sources["t"]}
    plain = set() if dialect.padded else set(columns.sources.values()) - dialect.dates
    schema: dict[str, type[pl.DataType]] = {}
    for place, column in enumerate(dialect.columns):
        kind: type[pl.DataType] = pl.String
        if column in plain:
            kind = pl.Int64 if column in whole else pl.Float64
        schema[str(place)] = kind
    # polars drops cells past the last column without a word: one more column catches them
    schema[_EXCESS] = pl.String
    frame = pl.scan_csv(
        source,
        has_header=False,
        separator=dialect.separator or "\t",
        decimal_comma=dialect.decimal_comma,
        comment_prefix=dialect.comment,
        skip_lines=skip,
        n_rows=most,
        schema=schema,
        missing_columns="insert",
        glob=False,
    )
    numbers = [_number(dialect, columns, name).alias(name) for name in columns.sources]
    return frame.select(*numbers, pl.col(_EXCESS).is_not_null())


def _number(dialect: Dialect, columns: Columns, name: str) -> pl.Expr:
    """The cell of a channel as a number; a date as ns since 1970, in UTC where it names no zone."""
    import polars as pl

    column = columns.sources[name]
    cell = pl.col(str(dialect.columns.index(column)))
    if column in dialect.dates and name != "t":
        return pl.lit(None, pl.Float64)
    if column in dialect.dates:
        text = (
            cell.str.strip_chars().str.replace(" ", "T", literal=True).str.replace(r"Z$", "+00:00")
        )
        zoned = (
            pl.when(text.str.contains(r"[+-]\d{2}:?\d{2}$")).then(text).otherwise(text + "+00:00")
        )
        ns = zoned.str.to_datetime(
            "%Y-%m-%dT%H:%M:%S%.f%z", time_unit="ns", strict=True
        ).dt.timestamp("ns")
        # others wrap round
        within = text.str.slice(0, 4).is_between(pl.lit("1678"), pl.lit("2261"))
        return pl.when(within).then(ns).otherwise(beyond(text))
    if not dialect.padded:
        return cell
    text = cell.str.strip_chars()
    text = pl.when(text != "").then(text)
    return (text.str.replace(",", ".", literal=True) if dialect.decimal_comma else text).cast(
        pl.Float64
    )
