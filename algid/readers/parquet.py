"""Parquet logs, a row group at a time: flat columns, or list columns as robots' drivers write them.

Columns of plain numbers, the usual case, are read by pyarrow alone: importing polars takes longer
than a short log does as a whole. Lists, dates and rarer types are polars'.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from algid.arrow import whole_column
from algid.errors import LogError
from algid.limits import LIMITS
from algid.log import CANONICAL_COLUMNS, KEY, Companion, loads
from algid.notices import Notice
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign
from algid.readers.footer import Footer, FooterError, Pages, page_header, parsed
from algid.readers.frames import (
    INDEX,
    NO_COMPANION,
    Cells,
    WholeRows,
    cells,
    flat_reader,
    numbers_of,
    of_numbers,
    roots_of,
    timed_by_index,
    types_of,
)
from algid.readers.stated import in_metadata
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa
    import pyarrow.parquet as pq

    from algid.profile import Profile

_NO_UNIT = ("", "-", "1", "none", "null", "unknown", "dimensionless")
_BATCH = 1 << 14
"""Rows that are decoded at once: few enough for the same warm memory to take them each time."""
_NO_SUMS = Notice("NO_CHECKSUM", numbers={"case": "values"})


def open_parquet(path: Path, profile: Profile) -> TableReader:
    """Open a Parquet log.

    Raises
    ------
    LogError
        If the file is damaged, or columns are missing or hold no numbers.
    """
    _refuse_encrypted(path)
    return _of_plain_numbers(path, profile) or _of_any_cells(path, profile)


def _of_plain_numbers(path: Path, profile: Profile) -> TableReader | None:
    """A reader by pyarrow; None where polars is wanted, also to say what is wrong with the file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        metadata = pq.read_metadata(path)
        schema = metadata.schema.to_arrow_schema()
    except (pa.ArrowException, OSError, ValueError):
        return None
    names = list(schema.names)
    nested = any(map(pa.types.is_nested, schema.types))
    dated = INDEX in names and pa.types.is_temporal(schema.field(INDEX).type)
    if nested or dated or len(set(names)) < len(names):
        return None
    _refuse_wide(path, names)
    companion = _companion(path, metadata)
    rows = counted_rows(path)
    units = units_of_schema(schema)
    columns = _assigned(path, names, profile, units, companion)
    kinds = dict(zip(names, schema.types, strict=True))
    wanted = set(columns.sources.values()) | set(columns.others.values())
    if not all(_plain(kinds[name]) for name in wanted):
        return None
    groups = _PlainGroups(path, metadata, companion.sums)
    return flat_reader(str(path), "parquet", columns, groups.frames, profile, rows, companion)


def _plain(kind: pa.DataType) -> bool:
    """Whether NumPy has the type and int64 or float64 all of its numbers."""
    import pyarrow as pa

    whole = pa.types.is_integer(kind) and not pa.types.is_uint64(kind)
    return whole or pa.types.is_float32(kind) or pa.types.is_float64(kind)


def _of_any_cells(path: Path, profile: Profile) -> TableReader:
    """A reader by polars."""
    import polars as pl
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = schema_of(path)
    _refuse_wide(path, schema)
    profile = timed_by_index(profile, schema)

    def width(column: str) -> int:
        _check_pages(path, {column}, most=1)
        first = pl.scan_parquet(path, glob=False).select(pl.col(column)).head(1).collect()
        if not first.height or first.item() is None:
            return 0
        return len(first.item())

    with _readable(path):
        metadata = pq.read_metadata(path)
        companion = _companion(path, metadata)
        cells_by_name = cells(schema, width)
        rows = counted_rows(path)
    roots = roots_of(cells_by_name)
    try:
        units = units_of_schema(metadata.schema.to_arrow_schema(), roots)
    except (pa.ArrowException, OSError, ValueError):  # types that polars reads and pyarrow does not
        units = {}
    columns = _assigned(path, list(cells_by_name), profile, units, companion)
    columns = of_numbers(str(path), columns, types_of(cells_by_name))
    groups = _Groups(path, cells_by_name, roots, companion.sums)
    return flat_reader(str(path), "parquet", columns, groups.frames, profile, rows, companion)


def _refuse_encrypted(path: Path) -> None:
    if _footer(path).encrypted:
        raise LogError(
            f"{path}: the Parquet file holds encrypted columns; write it anew without encryption"
        )


def _refuse_wide(path: Path, names: Collection[str]) -> None:
    if len(names) > LIMITS.columns:
        raise LogError(
            f"{path}: {counted(len(names), 'column')}; expected {LIMITS.columns} at most"
        )


def _companion(path: Path, metadata: pq.FileMetaData) -> Companion:
    """The truth and the sums that algid wrote into the file."""
    text = (metadata.metadata or {}).get(KEY.encode())
    if text is None:
        return NO_COMPANION
    try:
        return loads(text)
    except ValueError as error:
        raise LogError(
            f"{path}: the truth in the file's metadata cannot be read ({error})"
        ) from error


def _assigned(
    path: Path,
    names: Sequence[str],
    profile: Profile,
    units: Mapping[str, str],
    companion: Companion,
) -> Columns:
    """The columns of the channels, with a word where algid's own columns have no sums."""
    columns = assign(str(path), names, profile, units, companion.sums)
    own = {"stamp_ns"}.union(CANONICAL_COLUMNS)
    if not companion.sums and own <= set(names):
        return replace(columns, notices=columns.notices + (_NO_SUMS,))
    return columns


def schema_of(path: Path) -> dict[str, pl.DataType]:
    """Columns and their types.

    Raises
    ------
    LogError
        If the file is damaged, or columns of it are encrypted.
    """
    import polars as pl

    _refuse_encrypted(path)
    with _readable(path):
        return dict(pl.scan_parquet(path, glob=False).collect_schema())


def counted_rows(path: Path) -> int:
    """Rows of the file, once its footer, its row groups and their columns agree on them.

    Raises
    ------
    LogError
        If they do not: polars would believe one of them without a word.
    """
    footer = _footer(path)
    size = path.stat().st_size
    rows, flat, fewest, most = 0, True, 0, 0  # values less rows of a column
    for group in footer.groups:
        rows += group.rows
        for pages in group.columns:
            if not 0 < pages.first <= pages.end <= size:  # polars panics here, which takes seconds
                raise LogError(
                    f"{path}: the Parquet footer claims pages beyond the end of the file; copy the "
                    "file again"
                )
            flat = flat and len(pages.path) == 1
            fewest = min(fewest, pages.values - group.rows)
            most = max(most, pages.values - group.rows)
    # a list column has more values than rows, a flat one just as many
    if rows != footer.rows or fewest < 0 or (flat and most > 0):
        raise LogError(
            f"{path}: the Parquet footer contradicts itself about its rows; copy the file again"
        )
    return footer.rows


def units_of_schema(schema: pa.Schema, roots: Mapping[str, str] | None = None) -> dict[str, str]:
    """By name the unit that an Arrow schema's metadata state.

    `roots` are the fields that the names belong to; without them the names are the fields' own.
    """
    if roots is None:
        roots = dict(zip(schema.names, schema.names, strict=True))
    units = in_metadata(_decoded(schema.metadata), list(roots))
    times = Counter(schema.names)
    for name, root in roots.items():
        if times[root] != 1:
            continue
        for key, value in _decoded(schema.field(root).metadata).items():
            if key.lower() in ("unit", "units"):
                unit = value.strip()
                if unit.lower() not in _NO_UNIT:
                    units[name] = unit[: LIMITS.unit_letters]
                break
    return units


def _decoded(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    decoded = {}
    for key, value in (metadata or {}).items():
        decoded[key.decode(errors="replace")] = value.decode(errors="replace")
    return decoded


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """What a damaged file makes of polars and pyarrow, as a `LogError`."""
    import polars as pl
    import pyarrow as pa

    raised = (
        pl.exceptions.PolarsError,
        pl.exceptions.PanicException,
        pa.ArrowException,
        OSError,
        ValueError,
    )
    try:
        yield
    except raised as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: BaseException) -> LogError:
    reason = str(error).split("\n", maxsplit=1)[0][:200]
    return LogError(
        f"{path}: the Parquet file is damaged or not one that can be read ({reason}); copy it again"
    )


def _footer(path: Path) -> Footer:
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 8))
        tail = stream.read(8)
        length = int.from_bytes(tail[:4], "little")
        stream.seek(max(0, size - 8 - length))
        footer = stream.read(min(length, LIMITS.parquet_footer_bytes))
    if tail[4:] != b"PAR1":
        raise LogError(
            f"{path}: the Parquet file is cut off: its footer is missing, so nothing can be read "
            "of it"
        )
    if length + 12 > size or length > LIMITS.parquet_footer_bytes:
        raise LogError(
            f"{path}: the Parquet footer claims {counted(length, 'byte')} of a file of {size}; "
            "copy the file again"
        )
    try:
        return _parsed(footer)
    except FooterError as error:
        raise LogError(
            f"{path}: the Parquet footer is damaged ({error}); copy the file again"
        ) from error


_parsed = lru_cache(maxsize=2)(parsed)
"""A footer is asked for some three times on the way, and one of many row groups takes seconds."""


@dataclass
class _Groups:
    """A Parquet file's row groups: cells and columns by name, and sums of values by column.

    The pages are `checked` by the first pass.
    """

    path: Path
    cells: Cells
    roots: Mapping[str, str]
    sums: Mapping[str, int]
    checked: bool = False

    def frames(self, columns: Columns, rows: int, most: int | None) -> Iterator[pl.DataFrame]:
        """Frames of `rows` rows, the last of fewer, over the first `most` rows where that is given.

        Columns come in two lots, since one lot takes one core.
        """
        import polars as pl

        if not self.checked:
            roots = {self.roots[source] for source in columns.sources.values()}
            _check_pages(self.path, roots, self.sums, most)
            self.checked = most is None
        frame = pl.scan_parquet(self.path, glob=False)
        if most is not None:
            frame = frame.head(most)
        numbers = numbers_of(columns, self.cells)
        # both joints in one lot: they may share a list column
        middle = (len(numbers) // 2 + 1) // 2 * 2
        with _readable(self.path):
            if middle in (0, len(numbers)):  # a joint that is looked at alone
                yield from frame.select(numbers).collect_batches(chunk_size=rows)
                return
            # both lots begin here and run while the frames are being used
            first = frame.select(numbers[:middle]).collect_batches(chunk_size=rows)
            second = frame.select(numbers[middle:]).collect_batches(chunk_size=rows)
            for one, other in zip(first, second, strict=True):
                yield one.hstack(other)


@dataclass
class _PlainGroups:
    """A Parquet file of plain numbers; the pages are `checked` by the first pass."""

    path: Path
    metadata: pq.FileMetaData
    sums: Mapping[str, int]
    checked: bool = False

    def frames(self, columns: Columns, rows: int, most: int | None) -> Iterator[WholeRows]:
        """Columns of `rows` rows each at most, up to `most` rows in all if given."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        sources = list(dict.fromkeys(columns.sources.values()))
        if not self.checked:
            _check_pages(self.path, sources, self.sums, most)
            self.checked = most is None
        left = self.metadata.num_rows if most is None else most
        try:
            with pq.ParquetFile(self.path, metadata=self.metadata, pre_buffer=False) as file:
                few = min(rows, _BATCH)
                for batch in file.iter_batches(few, columns=sources, use_threads=False):
                    kept = batch.slice(0, left)
                    left -= kept.num_rows
                    if kept.num_rows:
                        yield _of_batch(columns, kept)
                    if left <= 0:
                        return
        except (pa.ArrowException, OSError) as error:
            raise _damaged(self.path, error) from error


def _of_batch(columns: Columns, batch: pa.RecordBatch) -> WholeRows:
    """Numbers by channel as float64, whole times as int64, of the rows that have them all."""
    read, cut_off = batch.num_rows, False
    if any(column.null_count for column in batch.columns):
        cut_off = not all(column[-1].is_valid for column in batch.columns)
        batch = batch.drop_null()
    arrays = {}
    for name, source in columns.sources.items():
        values = whole_column(batch.column(source))
        whole = name == "t" and np.issubdtype(values.dtype, np.integer)
        arrays[name] = values.astype(np.int64 if whole else np.float64, copy=False)
    return WholeRows(arrays, read - batch.num_rows, cut_off)


def _check_pages(
    path: Path, roots: Collection[str], summed: Collection[str] = (), most: int | None = None
) -> None:
    """Refuse pages of columns in `roots` with impossible values or a wrong checksum.

    At the first polars would end the process, and at the second it does not look. The values of
    `summed` columns are verified as they are read. Where only the first `most` rows are read, the
    pages that hold them.
    """
    left = float("inf") if most is None else most
    with path.open("rb") as stream:
        for group in _footer(path).groups:
            for pages in group.columns:
                if pages.path and pages.path[0] in roots:
                    _check_column(path, stream, pages, left, checksums=pages.path[0] not in summed)
            left -= group.rows
            if left <= 0:
                return


def _check_column(
    path: Path, stream: BinaryIO, pages: Pages, most: float, *, checksums: bool
) -> None:
    place, seen = pages.first, 0
    # the rows of a page of lists are not stated
    while place < pages.end and (seen < most or len(pages.path) > 1):
        stream.seek(place)
        try:
            header = page_header(stream.read(min(LIMITS.parquet_header_bytes, pages.end - place)))
        except (
            FooterError
        ):  # old writers count the bytes otherwise; polars tells of what is damaged
            return
        largest = header.unpacked if header.dictionary else pages.values
        if not (0 <= header.values <= largest and header.packed >= 0 and header.unpacked >= 0):
            raise _damaged(
                path,
                FooterError(f"a page at byte {place} claims {counted(header.values, 'value')}"),
            )
        place += header.length
        if not header.dictionary:
            seen += header.values
        if checksums and header.crc is not None:
            stream.seek(place)
            if zlib.crc32(stream.read(header.packed)) != header.crc:
                raise _damaged(
                    path, FooterError(f"the checksum of a page at byte {place} is wrong")
                )
        place += header.packed
