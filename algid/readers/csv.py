"""CSV logs, plain or compressed, through polars: only the columns that are needed, a block at a time."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from algid.errors import LogError
from algid.log import Companion, loads
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign, check_written, tables
from algid.readers.dialect import Dialect, detect
from algid.readers.sniff import head_of, whole_lines
from algid.readers.table import SampleTable

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile

_HEAD = 1 << 16
_EXCESS = "excess"


def sidecar(path: Path) -> Path:
    """Where the truth of a CSV log stands: ``LOG.csv.truth.json``."""
    return path.with_name(path.name + ".truth.json")


def open_csv(path: Path, profile: Profile | None = None, kind: str = "csv") -> TableReader:
    """Open a CSV log; `kind` is "csv", "csv.zst" or "csv.gz".

    Raises
    ------
    LogError
        If the text is no table, or columns are missing.
    """
    head = head_bytes(path, kind)
    dialect = detect(path, head)
    companion = _companion(path)
    check_written(str(path), dialect.columns, companion.sums if companion else {})
    columns = assign(str(path), dialect.columns, profile, dialect.units)
    if columns.sources["t"] in dialect.dates:
        columns = replace(columns, time_unit="ns", time_told=True)
    sums = companion.sums if companion else {}
    truth = companion.truth if companion else None
    rows = _rows(path, kind, head)
    return columns.reader(
        str(path), "csv", truth, lambda chosen: _Text(path, kind, dialect, chosen, sums).tables, profile, rows
    )


def head_bytes(path: Path, kind: str) -> bytes:
    """The first bytes of the text, unpacked, 64 KiB at most."""
    if kind != "csv":
        return head_of(path, kind)
    with path.open("rb") as stream:
        return stream.read(_HEAD)


def _rows(path: Path, kind: str, head: bytes) -> int:
    """Rows to expect of plain text, from the length of its first lines and a tenth more."""
    return 0 if kind != "csv" else int(1.1 * path.stat().st_size * head.count(b"\n") / len(head)) + 16


def counted_rows(path: Path, kind: str, dialect: Dialect) -> int:
    """Lines of the table under its header that are neither empty nor comments.

    Raises
    ------
    LogError
        If compressed text is damaged, or a line is no table's.
    """
    comment = dialect.comment.encode() if dialect.comment else b"\n"  # which no line begins with
    rows, skip = 0, dialect.skip
    for text in whole_lines(path, kind):
        lines = text.split(b"\n")
        rows += sum(1 for line in lines[skip:] if line.strip() and not line.startswith(comment))
        skip = max(0, skip - len(lines))
    return rows


def _companion(path: Path) -> Companion | None:
    beside = sidecar(path)
    try:
        return loads(beside.read_bytes()) if beside.is_file() else None
    except (OSError, ValueError) as error:
        raise LogError(f"{beside}: the truth beside the log cannot be read ({error}); remove it") from error


@dataclass(frozen=True)
class _Text:
    """A text table and the columns to take from it."""

    path: Path
    kind: str
    dialect: Dialect
    columns: Columns
    sums: Mapping[str, int]

    def tables(self, rows: int) -> Iterator[SampleTable]:
        """Tables of about `rows` rows."""
        return tables(str(self.path), self._frames(rows), self.columns, self.sums)

    def _frames(self, rows: int) -> Iterator[pl.DataFrame]:
        import polars as pl

        done = 0
        try:
            for frame in self._parsed(rows):
                yield self._whole(frame, done)
                done += frame.height
        except pl.exceptions.PolarsError as error:
            raise LogError(self._reason(done, error)) from error

    def _parsed(self, rows: int) -> Iterator[pl.DataFrame]:
        if self.kind == "csv" and self.dialect.separator:
            yield from self._scan(self.path, self.dialect.skip).collect_batches(chunk_size=rows)
            return
        skip = self.dialect.skip
        for text in whole_lines(self.path, self.kind):
            yield self._scan(io.BytesIO(self._plain(text)), skip).collect()
            skip = 0

    def _plain(self, text: bytes) -> bytes:
        """Runs of blanks become one tab where they separate."""
        if self.dialect.separator:
            return text
        return re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+|[ \t]+$|[ \t]+(?=\r$)", b"", text))

    def _scan(self, source: Path | io.BytesIO, skip: int) -> pl.LazyFrame:
        import polars as pl

        dialect = self.dialect
        schema = {str(place): self._type(place) for place in range(len(dialect.columns))}
        # polars drops cells past the last column without a word: one more column catches them
        schema[_EXCESS] = pl.String
        wanted = {name: str(dialect.columns.index(column)) for name, column in self.columns.sources.items()}
        frame = pl.scan_csv(
            source,
            has_header=False,
            separator=dialect.separator or "\t",
            decimal_comma=dialect.decimal_comma,
            comment_prefix=dialect.comment,
            skip_lines=skip,
            schema=schema,
            missing_columns="insert",
            glob=False,
        )
        numbers = [self._number(name, pl.col(place)).alias(name) for name, place in wanted.items()]
        return frame.select(*numbers, pl.col(_EXCESS).is_not_null())

    def _type(self, place: int) -> type[pl.DataType]:
        import polars as pl

        column = self.dialect.columns[place]
        if column not in self.columns.sources.values() or self.dialect.padded or column in self.dialect.dates:
            return pl.String
        whole = column == self.columns.sources["t"] and column in self.dialect.whole
        return pl.Int64 if whole else pl.Float64

    def _number(self, name: str, cell: pl.Expr) -> pl.Expr:
        import polars as pl

        if self.columns.sources[name] in self.dialect.dates:
            return _nanoseconds(cell.str.strip_chars()) if name == "t" else pl.lit(None, pl.Float64)
        if not self.dialect.padded:
            return cell
        text = cell.str.strip_chars()
        text = pl.when(text != "").then(text)
        return (text.str.replace(",", ".", literal=True) if self.dialect.decimal_comma else text).cast(pl.Float64)

    def _whole(self, frame: pl.DataFrame, done: int) -> pl.DataFrame:
        import polars as pl

        if frame[_EXCESS].any():
            row = done + (frame[_EXCESS].arg_max() or 0) + 1
            raise LogError(
                f"{self.path}: row {row} has more cells than the header's {len(self.dialect.columns)}; mend that row"
            )
        frame.drop_in_place(_EXCESS)  # in place: `drop` would queue behind the parsing of the next rows
        if any(frame.null_count().row(0)):  # an empty line is no row
            frame = frame.filter(~pl.all_horizontal(pl.all().is_null()))
        return frame

    def _reason(self, done: int, error: Exception) -> str:
        told = str(error).split("\n", maxsplit=1)[0]
        found = re.search(r"could not parse `(.*?)` as dtype `\w+` at column '(\d+)'", told, re.DOTALL)
        if found:
            column = self.dialect.columns[int(found[2])]
            return (
                f"{self.path}: column {column!r}, past row {done}: expected a number, found "
                f"{found[1][:40]!r}; mend the file or name another column"
            )
        return f"{self.path}: the table cannot be read past row {done}: {told[:200]}"


def _nanoseconds(text: pl.Expr) -> pl.Expr:
    """Dates with times of day as ns since 1970; UTC where they name no zone."""
    import polars as pl

    zoned = text.str.replace(" ", "T", literal=True).str.replace(r"Z$", "+00:00")
    zoned = pl.when(zoned.str.contains(r"[+-]\d{2}:?\d{2}$")).then(zoned).otherwise(zoned + "+00:00")
    return zoned.str.to_datetime("%Y-%m-%dT%H:%M:%S%.f%z", time_unit="ns", strict=True).dt.timestamp("ns")
