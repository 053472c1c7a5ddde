"""Feather logs (Arrow IPC files): only the needed columns, some record batches at a time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from algid.errors import LogError
from algid.limits import LIMITS
from algid.readers.assemble import TableReader
from algid.readers.columns import Columns, assign
from algid.readers.frames import (
    cells,
    flat_reader,
    numbers_of,
    of_numbers,
    roots_of,
    timed_by_index,
    types_of,
)
from algid.readers.ipc import claims
from algid.readers.natives import natively
from algid.readers.parquet import units_of_schema
from algid.words import counted, repeated

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa

    from algid.profile import Profile


def open_feather(path: Path, profile: Profile) -> TableReader:
    """Open a Feather log.

    Raises
    ------
    LogError
        If the file is damaged, claims more than any log, names a column twice, or lacks a channel.
    """
    import polars as pl

    file = opened(path)
    kinds = file.kinds()
    cells_by_name = cells(kinds, file.width)
    # of types that hold no numbers
    other = [name for name in file.schema.names if name not in kinds]
    roots = roots_of(cells_by_name)
    units = units_of_schema(file.schema, roots)
    profile = timed_by_index(profile, kinds)
    columns = assign(str(path), list(cells_by_name) + other, profile, units)
    for name, source in columns.sources.items():
        if source in other:
            kind = file.schema.field(source).type
            raise LogError(
                f"{path}: column {source!r} for {name} holds {str(kind)[:80]}; expected numbers"
            )
    types = types_of(cells_by_name) | dict.fromkeys(other, pl.Null())
    columns = of_numbers(str(path), columns, types)

    def frames(columns: Columns, rows: int, most: int | None) -> Iterator[pl.DataFrame]:
        numbers = numbers_of(columns, cells_by_name)
        read = 0
        for frame in file.frames({roots[source] for source in columns.sources.values()}, rows):
            if most is not None:
                frame = frame.head(most - read)
            yield from frame.select(numbers).iter_slices(rows)
            read += frame.height
            if most is not None and read >= most:
                return

    return flat_reader(str(path), "feather", columns, frames, profile, file.rows)


@dataclass(frozen=True)
class Feather:
    """An Arrow file that claims no more than a log does."""

    path: Path
    schema: pa.Schema
    rows: int

    def kinds(self) -> dict[str, pl.DataType]:
        """Columns that hold numbers, times or texts, and their types as frames have them."""
        import pyarrow as pa

        with natively(self.path, "feather"):
            return dict(self._taken(pa.Table.from_batches([], schema=self.schema)).schema)

    def width(self, column: str) -> int:
        """Cells of the longest list of a column in the first rows."""
        import polars as pl

        first = next(self.frames({column}, 1), None)
        if first is None:
            return 0
        return int(first.select(pl.col(column).list.len().max()).item() or 0)

    def frames(self, columns: Collection[str], rows: int) -> Iterator[pl.DataFrame]:
        """Frames of columns, of `rows` rows or more but for the last."""
        import pyarrow as pa

        wanted = [place for place, name in enumerate(self.schema.names) if name in columns]
        held: list[pa.RecordBatch] = []
        size = 0
        with natively(self.path, "feather"), pa.memory_map(str(self.path)) as source:
            options = pa.ipc.IpcReadOptions(included_fields=wanted)
            reader = pa.ipc.open_file(source, options=options)
            for place in range(reader.num_record_batches):
                batch = reader.get_batch(place)
                batch.validate(full=True)
                held.append(batch)
                size += batch.num_rows
                if size >= rows:
                    yield self._taken(pa.Table.from_batches(held))
                    held, size = [], 0
            if size:
                yield self._taken(pa.Table.from_batches(held))

    def _taken(self, table: pa.Table) -> pl.DataFrame:
        """The columns of a table that polars takes; decimal numbers as float64."""
        import polars as pl
        import pyarrow as pa

        kept = table.select([field.name for field in table.schema if _is_taken(field.type)])
        for place, field in enumerate(kept.schema):
            if pa.types.is_decimal(field.type):
                kept = kept.set_column(place, field.name, kept.column(place).cast(pa.float64()))
        frame = pl.from_arrow(kept, rechunk=False)
        return frame if isinstance(frame, pl.DataFrame) else frame.to_frame()


def opened(path: Path) -> Feather:
    """An Arrow file, once its claims are known.

    Raises
    ------
    LogError
        If it is damaged, claims more than any log, has too many columns, or two of one name.
    """
    import pyarrow as pa

    rows = claims(path)
    with natively(path, "feather"), pa.memory_map(str(path)) as source:
        schema = pa.ipc.open_file(source).schema
        for field in schema:
            str(field.name), str(field.type)  # what is no UTF-8 tells here
    if len(schema) > LIMITS.columns:
        raise LogError(
            f"{path}: {counted(len(schema), 'column')}; expected {LIMITS.columns} at most"
        )
    twice = repeated(schema.names)
    if twice:
        raise LogError(f"{path}: the column {twice[0][:80]!r} stands in the file twice; rename one")
    return Feather(path, schema, rows)


def _is_taken(kind: pa.DataType) -> bool:
    """Whether polars takes a column of a type without a panic, and it may hold what a log has."""
    import pyarrow as pa

    types = pa.types
    if types.is_dictionary(kind):
        return _is_taken(kind.value_type)
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        return not types.is_nested(kind.value_type) and _is_taken(kind.value_type)
    numbers = (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean)
    times = (types.is_timestamp, types.is_duration, types.is_time, types.is_date)
    others = (types.is_null, types.is_string, types.is_large_string)
    return any(is_one(kind) for is_one in numbers + times + others)
