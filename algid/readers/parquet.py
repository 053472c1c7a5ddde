"""Parquet logs, a row group at a time: flat columns, or list columns as robots' drivers write them."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from algid.errors import LogError
from algid.log import CANONICAL_COLUMNS, KEY, Companion, Notice, loads
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign, check_written, tables
from algid.readers.footer import Footer, FooterError, page_header, parsed
from algid.readers.stated import in_metadata
from algid.readers.table import SampleTable
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa

    from algid.profile import Profile

_MOST_COLUMNS = 4096
_LARGEST_FOOTER = 1 << 26
_NO_UNIT, _LONGEST_UNIT = ("", "-", "1", "none", "null", "unknown", "dimensionless"), 40
_LARGEST_HEADER = 1 << 14
_NO_SUMS = Notice("NO_CHECKSUM", "the file has no sums of its values, as algid's have: changes would go unseen")


def open_parquet(path: Path, profile: Profile | None = None) -> TableReader:
    """Open a Parquet log.

    Raises
    ------
    LogError
        If the file is damaged, or columns are missing or hold no numbers.
    """
    import polars as pl

    schema = schema_of(path)
    try:
        companion = _companion(path)
        available = _flat_names(path, schema)
        rows = counted_rows(path)
    except (pl.exceptions.PolarsError, OSError, pl.exceptions.PanicException) as error:
        raise _damaged(path, error) from error
    check_written(str(path), list(available), companion.sums if companion else {})
    columns = assign(str(path), list(available), profile, _units(path, available))
    if companion is None and "stamp_ns" in schema and set(CANONICAL_COLUMNS) <= schema.keys():
        columns = replace(columns, notices=(*columns.notices, _NO_SUMS))
    _check_types(path, columns, available, schema)
    sums = companion.sums if companion else {}
    truth = companion.truth if companion else None
    return columns.reader(
        str(path), "parquet", truth, lambda chosen: _Groups(path, chosen, available, schema, sums).tables, profile, rows
    )


def schema_of(path: Path) -> dict[str, pl.DataType]:
    """Columns and their types.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    import polars as pl

    _check_footer(path)
    try:
        return dict(pl.scan_parquet(path, glob=False).collect_schema())
    except (pl.exceptions.PolarsError, OSError, pl.exceptions.PanicException) as error:
        raise _damaged(path, error) from error


def _check_footer(path: Path) -> None:
    if _footer(path).encrypted:
        raise LogError(f"{path}: the Parquet file holds encrypted columns; write it anew without encryption")


def _footer(path: Path) -> Footer:
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 8))
        tail = stream.read(8)
        length = int.from_bytes(tail[:4], "little")
        stream.seek(max(0, size - 8 - length))
        footer = stream.read(min(length, _LARGEST_FOOTER))
    if tail[4:] != b"PAR1":
        raise LogError(f"{path}: the Parquet file is cut off: its footer is missing, so nothing can be read of it")
    if length + 12 > size or length > _LARGEST_FOOTER:
        raise LogError(
            f"{path}: the Parquet footer claims {counted(length, 'byte')} of a file of {size}; copy the file again"
        )
    try:
        return parsed(footer)
    except FooterError as error:
        raise LogError(f"{path}: the Parquet footer is damaged ({error}); copy the file again") from error


def counted_rows(path: Path) -> int:
    """Rows of the file, once its footer, its row groups and their columns agree on them.

    Raises
    ------
    LogError
        If they do not: polars would believe one of them without a word.
    """
    footer = _footer(path)
    columns = [(pages, group.rows) for group in footer.groups for pages in group.columns]
    # a list column has more values than rows, a flat one just as many
    flat = all(len(pages.path) == 1 for pages, _ in columns)
    agree = sum(group.rows for group in footer.groups) == footer.rows and all(
        pages.values == rows if flat else pages.values >= rows for pages, rows in columns
    )
    size = path.stat().st_size
    inside = all(0 < pages.first <= pages.end <= size for pages, _ in columns)
    if not inside:  # polars panics at these, which takes it seconds
        raise LogError(f"{path}: the Parquet footer claims pages beyond the end of the file; copy the file again")
    if not agree:
        raise LogError(f"{path}: the Parquet footer contradicts itself about its rows; copy the file again")
    return footer.rows


def _flat_names(path: Path, schema: Mapping[str, pl.DataType]) -> dict[str, tuple[str, int | None]]:
    """By the name to choose from, the column and, in a list column, the place in the list."""
    import polars as pl

    if len(schema) > _MOST_COLUMNS:
        raise LogError(f"{path}: {counted(len(schema), 'column')}; expected {_MOST_COLUMNS} at most")
    names: dict[str, tuple[str, int | None]] = {}
    for column, kind in schema.items():
        if isinstance(kind, (pl.List, pl.Array)):
            _check_pages(path, {column})
            first = pl.scan_parquet(path, glob=False).select(pl.col(column)).head(1).collect()
            width = len(first.item()) if first.height and first.item() is not None else 0
            names |= {f"{column}[{place}]": (column, place) for place in range(min(width, 64))}
        else:
            names[column] = (column, None)
    return names


def _units(path: Path, available: Mapping[str, tuple[str, int | None]]) -> dict[str, str]:
    """By column the unit that the metadata of its field, or of the schema, state."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        schema = pq.read_schema(path)
    except (pa.ArrowException, OSError, ValueError):  # types that polars reads and pyarrow does not
        return {}
    return units_of_schema(schema, {name: column for name, (column, _) in available.items()})


def units_of_schema(schema: pa.Schema, roots: Mapping[str, str]) -> dict[str, str]:
    """By name the unit that an Arrow schema's metadata state; `roots` are the fields that the names belong to."""
    found = in_metadata(_decoded(schema.metadata), list(roots))
    for name, root in roots.items():
        own = _decoded(schema.field(root).metadata) if schema.names.count(root) == 1 else {}
        unit = next((value for key, value in own.items() if key.lower() in ("unit", "units")), "").strip()
        if unit.lower() not in _NO_UNIT:
            found[name] = unit[:_LONGEST_UNIT]
    return found


def _decoded(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    return {key.decode(errors="replace"): value.decode(errors="replace") for key, value in (metadata or {}).items()}


def _companion(path: Path) -> Companion | None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        text = (pq.read_metadata(path).metadata or {}).get(KEY.encode())
        return None if text is None else loads(text)
    except pa.ArrowException as error:
        raise _damaged(path, error) from error
    except ValueError as error:
        raise LogError(f"{path}: the truth in the file's metadata cannot be read ({error})") from error


def _check_types(
    path: Path,
    columns: Columns,
    available: Mapping[str, tuple[str, int | None]],
    schema: Mapping[str, pl.DataType],
) -> None:
    import polars as pl

    for name, source in columns.sources.items():
        column, place = available[source]
        kind = schema[column]
        inner = getattr(kind, "inner", kind) if place is not None else kind
        stamp = name == "t" and isinstance(inner, (pl.Datetime, pl.Duration))
        if not (inner.is_numeric() or stamp):
            raise LogError(f"{path}: column {source!r} for {name} holds {inner}; expected numbers")


@dataclass
class _Groups:
    """A Parquet file's row groups and the columns to take from them; their pages are `checked` by the first pass."""

    path: Path
    columns: Columns
    available: Mapping[str, tuple[str, int | None]]
    schema: Mapping[str, pl.DataType]
    sums: Mapping[str, int]
    checked: bool = False

    def tables(self, rows: int) -> Iterator[SampleTable]:
        """Tables of about `rows` rows."""
        return tables(str(self.path), self._frames(rows), self._columns(), self.sums)

    def _frames(self, rows: int) -> Iterator[pl.DataFrame]:
        """Frames of `rows` rows, the last of fewer. Columns come in two lots, since one lot takes one core."""
        import polars as pl

        if not self.checked:
            _check_pages(self.path, self._roots, summed=self.sums)
            self.checked = True
        frame = pl.scan_parquet(self.path, glob=False)
        numbers = [self._number(name, source) for name, source in self.columns.sources.items()]
        middle = (len(numbers) // 2 + 1) // 2 * 2  # both joints in one lot: they may share a list column
        try:
            # both begin here and run while the frames are being used
            lots = [frame.select(lot).collect_batches(chunk_size=rows) for lot in (numbers[:middle], numbers[middle:])]
            for first, second in zip(*lots, strict=True):
                yield first.hstack(second)
        except (pl.exceptions.PolarsError, OSError, ValueError, pl.exceptions.PanicException) as error:
            raise _damaged(self.path, error) from error

    @property
    def _roots(self) -> set[str]:
        return {self.available[source][0] for source in self.columns.sources.values()}

    def _number(self, name: str, source: str) -> pl.Expr:
        import polars as pl

        column, place = self.available[source]
        cell = pl.col(column)
        kind = self.schema[column]
        if place is not None:
            cell = cell.list.get(place, null_on_oob=True) if isinstance(kind, pl.List) else cell.arr.get(place)
        if name != "t":
            return cell.cast(pl.Float64).alias(name)
        if isinstance(kind, pl.Datetime):
            return cell.dt.timestamp("ns").alias("t")
        if isinstance(kind, pl.Duration):
            return cell.dt.total_nanoseconds().alias("t")
        return (cell.cast(pl.Int64) if kind.is_integer() else cell.cast(pl.Float64)).alias("t")

    def _columns(self) -> Columns:
        import polars as pl

        column, _ = self.available[self.columns.sources["t"]]
        if isinstance(self.schema[column], (pl.Datetime, pl.Duration)):
            return replace(self.columns, time_unit="ns", time_told=True)
        return self.columns


def _check_pages(path: Path, roots: Collection[str], summed: Collection[str] = ()) -> None:
    """Refuse pages of columns among `roots` that claim values which cannot be, or whose checksum is wrong.

    At the first polars would end the process, and at the second it does not look. The values of `summed` columns are
    verified as they are read.
    """
    with path.open("rb") as stream:
        for pages in (pages for group in _footer(path).groups for pages in group.columns):
            if not (pages.path and pages.path[0] in roots):
                continue
            place = pages.first
            while place < pages.end:
                stream.seek(place)
                try:
                    header = page_header(stream.read(min(_LARGEST_HEADER, pages.end - place)))
                except FooterError:  # old writers count the bytes otherwise; polars tells of what is damaged
                    break
                most = header.unpacked if header.dictionary else pages.values
                if not (0 <= header.values <= most and header.packed >= 0 and header.unpacked >= 0):
                    raise _damaged(
                        path, FooterError(f"a page at byte {place} claims {counted(header.values, 'value')}")
                    )
                place += header.length
                if header.crc is not None and pages.path[0] not in summed:
                    stream.seek(place)
                    if zlib.crc32(stream.read(header.packed)) != header.crc:
                        raise _damaged(path, FooterError(f"the checksum of a page at byte {place} is wrong"))
                place += header.packed


def _damaged(path: Path, error: BaseException) -> LogError:
    told = str(error).split("\n", maxsplit=1)[0][:200]
    return LogError(f"{path}: the Parquet file is damaged or not one that can be read ({told}); copy it again")
