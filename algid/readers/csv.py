"""CSV logs, plain or compressed, through polars: only needed columns, a block at a time."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.files import read_whole
from algid.log import Companion, loads
from algid.notices import Notice
from algid.readers.dialect import Dialect, detect
from algid.readers.table_cells import TableFile
from algid.readers.text import NUL_AMONG_ROWS, head_of, pieces

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa

_EXCESS, _SPLIT = "excess", "split"
_FRAME_ROWS = 1 << 16


def sidecar(path: Path) -> Path:
    """Where the truth of a CSV log stands: ``LOG.csv.truth.json``."""
    return path.with_name(path.name + ".truth.json")


def open_csv(path: Path, kind: str, names: Sequence[str] | None = None) -> TableFile:
    """Open a CSV log.

    Parameters
    ----------
    path : Path
    kind : str
        "csv", "csv.zst" or "csv.gz".
    names : sequence of str, optional
        Of the columns, in place of those that a header tells.

    Raises
    ------
    LogError
        If the text is no table.
    """
    import pyarrow as pa

    head = head_of(path, kind)
    dialect = detect(path, head, names)
    beside, companion = sidecar(path), Companion(None, {})
    try:
        if beside.is_file():
            companion = loads(read_whole(beside))
    except (OSError, ValueError) as error:
        raise LogError(
            f"{beside}: the truth beside the log cannot be read ({error}); remove it"
        ) from error
    fields = []
    for column in dialect.columns:
        kind_of = pa.float64()
        if column in dialect.dates:
            kind_of = pa.timestamp("ns")
        elif column in dialect.whole:
            kind_of = pa.int64()
        elif column in dialect.texts:
            kind_of = pa.string()
        unit = dialect.units.get(column)
        fields.append(pa.field(column, kind_of, metadata={"unit": unit} if unit else None))
    # rows to expect of plain text: from the length of its first lines, and a tenth more
    expected, whole = 0, False
    source: Path | bytes = path
    notices: tuple[Notice, ...] = ()
    if kind == "csv":
        expected = int(1.1 * path.stat().st_size * head.count(b"\n") / len(head)) + 16
        with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as text:
            whole, quoted = text[-1:] == b"\n", text.find(b'"') >= 0
    if not (whole and dialect.separator):
        source = b"".join(pieces(path, kind))
        quoted = b'"' in source
        if not source.endswith(b"\n"):  # its last number may lack digits
            source = source[: source.rfind(b"\n") + 1]
            notices = (Notice("CUT_OFF", numbers={"case": "cell"}),)
        if not dialect.separator:  # runs of blanks become one tab
            source = re.sub(rb"[ \t]+", b"\t", source)
            source = re.sub(rb"(?m)^\t|\t(?=\r?$)", b"", source)

    def batches(columns: Sequence[str], most: int | None) -> Iterator[pa.RecordBatch]:
        for frame in _frames(path, source, dialect, columns, most, quoted=quoted):
            yield from frame.to_arrow().to_batches()

    return TableFile(
        str(path),
        "csv",
        pa.schema(fields),
        0,
        batches,
        companion,
        notices,
        expected=expected,
        said=dialect.said,
    )


def _frames(
    path: Path,
    source: Path | bytes,
    dialect: Dialect,
    columns: Sequence[str],
    most: int | None,
    *,
    quoted: bool,
) -> Iterator[pl.DataFrame]:
    """The columns' numbers; empty lines are no rows."""
    import polars as pl

    done, counted = 0, most is not None
    scan = _scan(source, dialect, columns, most, quoted=quoted)
    try:
        for frame in scan.collect_batches(chunk_size=_FRAME_ROWS):
            for name, wrong in (
                (_EXCESS, f"has more cells than the header's {len(dialect.columns)}"),
                (_SPLIT, "goes on behind its line, for its quotes stay open"),
            ):
                # in place: `drop` would queue behind the parsing of the next rows
                if (found := frame.drop_in_place(name)).any():
                    row = done + (found.arg_max() or 0) + 1
                    raise LogError(f"{path}: row {row} {wrong}; mend that row")
            done += frame.height
            if any(frame.null_count().row(0)):
                valueless = pl.all_horizontal(pl.all().is_null())
                if not counted and frame.select(valueless.any()).item():
                    # rows with cells and no value are told of at once, those to come too
                    counted = True
                    every = pl.all_horizontal(pl.col(*columns).is_null())
                    lost = scan.select(every.sum()).collect().item()
                    yield frame.clear(lost - _empty_lines(source, dialect))
                frame = frame.filter(~valueless)
            yield frame
    except pl.exceptions.PolarsError as error:
        reason = str(error).partition("\n")[0][:200]
        wrong_cell = re.search(
            r"could not parse `(.*?)` as dtype `(\w+)` at column '(\d+)'", str(error), re.DOTALL
        )
        if wrong_cell is None:
            raise LogError(f"{path}: the table cannot be read past row {done}: {reason}") from error
        cell, kind, place = wrong_cell.groups()
        if kind == "str":
            raise LogError(
                f"{path}: past row {done}: quotes stay open; close them, or save the table "
                "without quotes"
            ) from error
        if "\0" in cell:
            raise LogError(f"{path}: past row {done}: {NUL_AMONG_ROWS}") from error
        raise LogError(
            f"{path}: column {dialect.columns[int(place)]!r}, past row {done}: expected a number, "
            f"found {cell[:40]!r}; mend the file or name another column"
        ) from error


def _empty_lines(source: Path | bytes, dialect: Dialect) -> int:
    """Lines under the header without a cell."""
    text = source if isinstance(source, bytes) else source.read_bytes()
    blanks = rb"[ \r]" if dialect.separator == "\t" else rb"[ \t\r]"
    return len(re.findall(rb"(?m)^" + blanks + rb"*\n", text.split(b"\n", dialect.skip)[-1]))


def _scan(
    source: Path | bytes,
    dialect: Dialect,
    columns: Sequence[str],
    most: int | None,
    *,
    quoted: bool,
) -> pl.LazyFrame:
    """The columns' numbers; whether a row has more cells than the header, or goes on behind it."""
    import polars as pl

    schema: dict[str, type[pl.DataType]] = {}
    for place, column in enumerate(dialect.columns):
        kind: type[pl.DataType] = pl.String
        plain = not (dialect.padded or column in dialect.dates | dialect.texts)
        if column in columns and plain:
            exact = column == columns[0] and column in dialect.whole
            kind = pl.Int64 if exact else pl.Float64
        schema[str(place)] = kind
    # polars drops cells past the last column without a word: one more column catches them
    schema[_EXCESS] = pl.String
    frame = pl.scan_csv(
        source,
        has_header=False,
        separator=dialect.separator or "\t",
        decimal_comma=dialect.decimal_comma,
        comment_prefix=dialect.comment,
        skip_lines=dialect.skip,
        quote_char='"' if quoted else None,
        n_rows=most,
        schema=schema,
        missing_columns="insert",
        glob=False,
    )
    split = pl.lit(value=False)
    if quoted:
        # a cell that holds the cells of another row has taken in that row
        row = rf"\n([^\n]*{re.escape(dialect.separator)}){{{len(dialect.columns) - 1}}}"
        texts = [name for name, kind in schema.items() if kind is pl.String]
        split = pl.any_horizontal(pl.col(*texts).str.contains(row)).fill_null(value=False)
    numbers = [_number(dialect, column).alias(column) for column in columns]
    return frame.select(*numbers, pl.col(_EXCESS).is_not_null(), split.alias(_SPLIT))


def _number(dialect: Dialect, column: str) -> pl.Expr:
    """The number in a cell; of a date its time, in UTC where it names no zone."""
    import polars as pl

    cell = pl.col(str(dialect.columns.index(column)))
    if column in dialect.texts:
        return cell.str.strip_chars()
    if column in dialect.dates:
        text = (
            cell.str.strip_chars().str.replace(" ", "T", literal=True).str.replace(r"Z$", "+00:00")
        )
        zoned = (
            pl.when(text.str.contains(r"[+-]\d{2}:?\d{2}$")).then(text).otherwise(text + "+00:00")
        )
        stamps = zoned.str.to_datetime("%Y-%m-%dT%H:%M:%S%.f%z", time_unit="ns", strict=True)
        # others wrap round: the last moment of int64 is refused as a time
        within = text.str.slice(0, 4).is_between(pl.lit("1678"), pl.lit("2261"))
        last = pl.when(text.is_not_null()).then(pl.lit((1 << 63) - 1, pl.Int64))
        ticks = pl.when(within).then(stamps.dt.timestamp("ns")).otherwise(last)
        return ticks.cast(pl.Datetime("ns"))
    if not dialect.padded:
        return cell
    text = cell.str.strip_chars(' \t"')
    text = pl.when(text != "").then(text)
    if dialect.decimal_comma:
        text = text.str.replace(",", ".", literal=True)
    return text.cast(pl.Float64)
