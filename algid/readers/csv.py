"""CSV logs, plain or compressed, through polars: only needed columns, a block at a time."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.files import read_whole
from algid.base.text import visible
from algid.log import Companion, loads
from algid.notices import Notice
from algid.readers.dialect import Dialect, detect, head_of, pieces
from algid.readers.table import as_log_error
from algid.readers.table_cells import TableFile

if TYPE_CHECKING:
    import pyarrow as pa

_EXCESS = "excess"
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
    head = head_of(path, kind)
    dialect = detect(head, names)
    beside, companion = sidecar(path), Companion(None, {})
    if beside.is_file():
        with as_log_error(beside.name, "remove it"):
            companion = loads(read_whole(beside))
    # rows to expect of plain text: from the length of its first lines, and a tenth more
    expected, whole = 0, False
    source: Path | bytes = path
    notices: tuple[Notice, ...] = ()
    if kind == "csv":
        expected = int(1.1 * path.stat().st_size * head.count(b"\n") / len(head)) + 16
        with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as text:
            whole, quoted = text[-1:] == b"\n", text.find(b'"') >= 0
    if dialect.padded or not whole:
        source = b"".join(pieces(path, kind))
        quoted = b'"' in source
        if not source.endswith(b"\n"):  # its last number may lack digits
            source = source[: source.rfind(b"\n") + 1]
            notices = (Notice("CUT_OFF", numbers={"case": "cell"}),)
    if dialect.padded and isinstance(source, bytes):
        mark = dialect.separator.encode() or None
        rows = (line.split(mark) for line in source.split(b"\n"))
        source = b"\n".join((mark or b"\t").join(map(bytes.strip, cells)) for cells in rows)
    return TableFile(
        "csv",
        dialect.schema,
        0,
        partial(_batches, source, dialect, quoted),
        companion,
        notices,
        expected=expected,
        said=dialect.said,
    )


def _batches(
    source: Path | bytes,
    dialect: Dialect,
    quoted: bool,
    columns: Sequence[str],
) -> Iterator[pa.RecordBatch]:
    """The columns' numbers; empty lines are no rows."""
    import polars as pl
    import pyarrow as pa
    import pyarrow.compute as pc

    schema: dict[str, type[pl.DataType]] = {}
    taken = {}
    for place, column in enumerate(dialect.schema, start=1):
        own = f"{place}: {column.name}"  # several may have no name
        schema[own] = pl.String
        if column.name in columns:
            taken[column.name] = pl.col(own).alias(column.name)
            if pa.types.is_floating(column.type) or pa.types.is_integer(column.type):
                exact = column.name == columns[0] and pa.types.is_integer(column.type)
                schema[own] = pl.Int64 if exact else pl.Float64
    # polars drops cells past the last column without a word: one more column catches them
    schema[_EXCESS] = pl.String
    wrong = pl.col(_EXCESS).is_not_null()
    if quoted:
        # a cell that holds the cells of another row has taken in that row
        line = rf"\n([^\n]*{re.escape(dialect.separator)}){{{len(dialect.schema) - 1}}}"
        texts = [name for name, kind in schema.items() if kind is pl.String]
        split = pl.any_horizontal(pl.col(*texts).str.contains(line))
        wrong |= split.fill_null(value=False)
    done = 0
    empty: int | None = None
    try:
        scan = pl.scan_csv(
            source,
            has_header=False,
            separator=dialect.separator or "\t",
            decimal_comma=dialect.decimal_comma,
            comment_prefix=dialect.comment,
            skip_lines=dialect.skip,
            quote_char='"' if quoted else None,
            schema=schema,
            missing_columns="insert",
            glob=False,
        ).select(*(taken[name] for name in columns), wrong.alias(_EXCESS))
        for frame in scan.collect_batches(chunk_size=_FRAME_ROWS):
            # in place: `drop` would queue behind the parsing of the next rows
            if (found := frame.drop_in_place(_EXCESS)).any():
                raise LogError(
                    f"row {done + (found.arg_max() or 0) + 1} has more cells than the header's "
                    f"{len(dialect.schema)}, or quotes that stay open; mend that row"
                )
            done += frame.height
            valued = ~pl.all_horizontal(pl.all().is_null())
            if lost := frame.height - frame.select(valued.sum()).item():
                # rows of cells without a value are lost, as far as they are more than empty lines
                empty = _empty_lines(source, dialect) if empty is None else empty
                lines = min(lost, empty)
                empty -= lines
                frame = pl.concat([frame.clear(lost - lines), frame.filter(valued)])
            table = frame.to_arrow()
            for place, name in enumerate(columns):
                kind = dialect.schema.field(name).type
                if pa.types.is_timestamp(kind):
                    texts = pc.utf8_trim_whitespace(table.column(place).cast(pa.string()))
                    dates = texts.cast(kind)
                    table = table.set_column(place, name, dates)
            yield from table.to_batches()
    except pa.ArrowInvalid as error:
        raise LogError(
            f"past row {done - frame.height}: {error}; expected dates of 1678 to 2261"
        ) from error
    except pl.exceptions.PolarsError as error:
        reason = visible(str(error).partition("\n")[0], 200)
        raise LogError(
            f"past row {done}: {reason}; mend that row, quotes too, or name other columns"
        ) from error


def _empty_lines(source: Path | bytes, dialect: Dialect) -> int:
    """Lines under the header without a cell."""
    text = source if isinstance(source, bytes) else source.read_bytes()
    blanks = rb"[ \r]" if dialect.separator == "\t" else rb"[ \t\r]"
    return len(re.findall(rb"(?m)^" + blanks + rb"*\n", text.split(b"\n", dialect.skip)[-1]))
