"""Tables of named columns, of any format: clock found, incomplete rows dropped, sums checked.

float64 seconds since 1970 resolve 0.24 µs, so whole and fractional seconds are converted apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.base.arrow import whole_column
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.quantiles import median
from algid.base.units import ANGLE, NANOSECONDS
from algid.base.words import repeated
from algid.log import Companion, IntArray, Origin, add, word_sum
from algid.notices import Notice, Remedy
from algid.readers.assemble import TableReader, make_reader
from algid.readers.attributes import decoded, honoured
from algid.readers.columns import Columns, assign
from algid.readers.joints import moving_joints
from algid.readers.names import has_a_time
from algid.readers.stated import lines_of, units_in
from algid.readers.table import SampleTable

if TYPE_CHECKING:
    import pyarrow as pa

    from algid.profile import Profile

BATCH_ROWS = 1 << 14
"""Rows that are decoded at once: few enough to stay in a core's cache."""
_LOOKED = 1 << 14
"""Samples in which the joints that are not read are looked at."""
_LISTED = 12
"""Arrays of other lengths that a message lists."""
_NO_UNIT = ("", "-", "1", "none", "null", "unknown", "dimensionless")
INDEX = "__index_level_0__"
"""What pandas calls an index without a name where a frame becomes Arrow or Parquet."""


@dataclass(frozen=True, eq=False)
class TableFile:
    """An opened file, or object in memory, of named columns.

    Attributes
    ----------
    path, kind : str
        What messages call it, and its format.
    schema : pyarrow.Schema
        Names and types of the columns; what the file states of them is in the metadata.
    rows : int
        0 where the file does not tell.
    batches : callable
        A fresh pass over some columns, of which the first is the clock, in record batches; over
        the first rows only if a number is given. Whatever way of missing a value the format has
        is a null.
    companion : Companion
        Truth and sums that algid wrote with the columns.
    notices : tuple of Notice
        What is to be said of the file.
    others : tuple of str
        What else it holds, of another length.
    expected : int
        Rows to expect where `rows` is 0.
    said : tuple of str
        What it states in words, such as comments.
    """

    path: str
    kind: str
    schema: pa.Schema
    rows: int
    batches: Callable[[Sequence[str], int | None], Iterator[pa.RecordBatch]]
    companion: Companion = field(default_factory=lambda: Companion(None, {}))
    notices: tuple[Notice, ...] = ()
    others: tuple[str, ...] = ()
    expected: int = 0
    said: tuple[str, ...] = ()


@contextmanager
def as_log_error(path: object, kind: str) -> Iterator[None]:
    """Turn what a library raises about a file into a `LogError`; its own errors pass.

    A panic of polars is no Exception.

    Raises
    ------
    LogError
        If anything is raised within.
    """
    try:
        yield
    except LogError:
        raise
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = str(error).partition("\n")[0][:200]
        raise LogError(
            f"{path}: the {kind} file is damaged or not one that can be read "
            f"({type(error).__name__}: {reason}); copy it again"
        ) from error


@dataclass(frozen=True)
class Cell:
    """A number of each row: a column's, or one within its lists and structures."""

    column: str
    steps: tuple[int | str, ...]
    type: pa.DataType

    def of(self, batch: pa.RecordBatch) -> pa.Array:
        """The numbers of a batch: integers, floats, or for a clock ticks of its type."""
        import pyarrow as pa

        column = batch.column(self.column)
        if not self.steps and _is_plain(self.type):
            return column
        if pa.types.is_decimal256(self.type):  # polars has none
            return column.cast(pa.float64())
        if pa.types.is_temporal(self.type) and not self.steps:
            return column.view(pa.int32() if self.type.bit_width == 32 else pa.int64())
        import polars as pl

        if pa.types.is_dictionary(column.type):
            column = column.dictionary_decode()
        values = pl.Series(pl.from_arrow(column))
        for step in self.steps:
            if isinstance(step, str):
                values = values.struct.field(step)
            elif isinstance(values.dtype, pl.Array):
                values = values.arr.get(step, null_on_oob=True)
            else:
                values = values.list.get(step, null_on_oob=True)
        if pa.types.is_temporal(self.type):
            return values.to_physical().to_arrow()
        return (values if _is_plain(self.type) else values.cast(pl.Float64)).to_arrow()


def _is_plain(kind: pa.DataType) -> bool:
    """Whether NumPy has the type."""
    import pyarrow as pa

    return pa.types.is_integer(kind) or pa.types.is_floating(kind)


def _is_number(kind: pa.DataType) -> bool:
    import pyarrow as pa

    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    return _is_plain(kind) or pa.types.is_decimal(kind)


def _is_clock(kind: pa.DataType) -> bool:
    """Whether a column holds dates, durations, or times of a day."""
    import pyarrow as pa

    return pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind)


def cells_of(table: TableFile) -> dict[str, Cell]:
    """Every cell of a row by name: a column, ``q[0]`` of its lists, ``q.x`` of its structures.

    The first rows tell how many cells the lists have.

    Raises
    ------
    LogError
        If a name stands there twice, or there are more cells than any log has.
    """
    import pyarrow as pa

    twice = repeated(filter(None, table.schema.names))
    if twice:
        raise LogError(
            f"{table.path}: the column {twice[0][:80]!r} stands in the file twice; rename one"
        )
    nested = [one.name for one in table.schema if _is_nested(one.type)]
    first = {}
    if nested:
        batch = next(table.batches(nested, BATCH_ROWS), None)
        for name in nested:
            first[name] = None if batch is None else batch.column(name)
    cells: dict[str, Cell] = {}

    def take(name: str, cell: Cell, values: pa.Array | None) -> None:
        if len(cells) >= LIMITS.columns:
            raise LogError(
                f"{table.path}: more than {LIMITS.columns} columns; expected a log of an arm"
            )
        if pa.types.is_struct(cell.type):
            for one in cell.type:
                inner = Cell(cell.column, (*cell.steps, one.name), one.type)
                take(
                    f"{name}.{one.name}", inner, None if values is None else values.field(one.name)
                )
        elif _is_nested(cell.type):
            size = 0
            if pa.types.is_fixed_size_list(cell.type):
                size = cell.type.list_size
            elif values is not None:
                size = max(np.diff(whole_column(values.offsets)), default=0)
            for place in range(min(size, LIMITS.list_cells)):
                inner = Cell(cell.column, (*cell.steps, place), cell.type.value_type)
                take(f"{name}[{place}]", inner, None if values is None else values.flatten())
        else:
            cells[name] = cell

    for one in table.schema:
        take(one.name, Cell(one.name, (), one.type), first.get(one.name))
    return cells


def _is_nested(kind: pa.DataType) -> bool:
    import pyarrow as pa

    types = pa.types
    lists = types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
    return lists or types.is_struct(kind)


def units_of(schema: pa.Schema, cells: Mapping[str, Cell]) -> dict[str, str]:
    """By cell the unit that the schema's metadata state of it, of its column, or of the file."""
    units, names = units_in(decoded(schema.metadata), list(cells)), list(schema.names)
    for name, cell in cells.items():
        for key, value in decoded(schema.field(names.index(cell.column)).metadata).items():
            if key.lower() in ("unit", "units"):
                unit = value.strip()
                if unit.lower() not in _NO_UNIT:
                    units[name] = unit[: LIMITS.unit_letters]
                break
    return units


def open_table(table: TableFile, profile: Profile) -> TableReader:
    """A reader of the columns that a profile, or their names, choose.

    Raises
    ------
    LogError
        If a channel has no column, or its column holds no numbers.
    """
    path, table = table.path, honoured(table)
    cells = cells_of(table)
    index = cells.get(INDEX)
    if index and _is_clock(index.type) and not (profile.time or has_a_time(cells)):
        profile = profile.model_copy(update={"time": INDEX})
    units = units_of(table.schema, cells)
    try:
        columns = assign(path, list(cells), profile, units, table.companion.sums)
    except LogError as error:
        if not table.others:
            raise
        more = ", ".join(table.others[:_LISTED])
        raise LogError(f"{error}; the log also holds, of another length: {more}") from error
    for name, source in columns.sources.items():
        kind = cells[source].type
        if not (_is_number(kind) or (name == "t" and _is_clock(kind))):
            held = str(kind).removeprefix("large_").removesuffix("_view")[:80]  # layouts of memory
            raise LogError(f"{path}: column {source!r} for {name} holds {held}; expected numbers")
    joints = {joint: one for joint, one in columns.others.items() if _is_number(cells[one].type)}
    columns = replace(columns, others=joints)
    if _is_clock(cells[columns.sources["t"]].type):
        columns = columns.dated()
    mapping = dict(columns.sources)
    if columns.rate is not None:
        mapping["t"] = f"rows at {columns.rate:g} Hz"
    reading = replace(columns.reading, clock="column", time_unit=columns.time_unit)
    origin = Origin(path, table.kind, mapping, table.companion.truth, reading)

    def look(others: Mapping[str, str]) -> Iterator[SampleTable]:
        looked = replace(columns, sources={"t": columns.sources["t"], **others})
        return samples(table, cells, looked, {}, _LOOKED)

    unit = profile.theta1.unit or columns.units.get("theta1", "rad")
    # of counts nobody knows how far they are
    beside = moving_joints(columns.others, look, ANGLE[unit]) if unit in ANGLE else ()
    return make_reader(
        origin,
        lambda _: samples(table, cells, columns, table.companion.sums),
        profile,
        columns.units,
        (*table.notices, *columns.notices, *beside),
        table.rows or table.expected,
        (*table.said, *lines_of(decoded(table.schema.metadata))),
    )


def samples(
    table: TableFile,
    cells: Mapping[str, Cell],
    columns: Columns,
    sums: Mapping[str, int],
    most: int | None = None,
) -> Iterator[SampleTable]:
    """The rows that have every value, with their stamps; the last table tells of the others.

    Parameters
    ----------
    table : TableFile
    cells : mapping
        Its cells by name.
    columns : Columns
    sums : mapping
        Of the words of each column, as they were written.
    most : int, optional
        Rows to read.

    Raises
    ------
    LogError
        If no row has every value, a time is no time, or the values are not those written.
    """
    path, unit, clock = table.path, columns.time_unit, cells[columns.sources["t"]].type
    expected = {name: sums[source] for name, source in columns.sources.items() if source in sums}
    seen = dict.fromkeys(expected, 0)
    rows = lost = done = 0
    cut_off = False
    held: SampleTable | None = None
    sources = [columns.sources["t"], *columns.sources.values()]
    wanted = list(dict.fromkeys(cells[source].column for source in sources))
    for batch in table.batches(wanted, most):
        import pyarrow as pa

        arrays = [cells[source].of(batch) for source in columns.sources.values()]
        if any(one.null_count for one in arrays):
            cut_off = not all(one[-1].is_valid for one in arrays)
            whole = pa.RecordBatch.from_arrays(arrays, names=list(columns.sources)).drop_null()
            lost += batch.num_rows - whole.num_rows
            arrays = whole.columns
        else:
            cut_off = False
        rows += batch.num_rows
        channels: dict[str, NDArray[Any]] = {}
        for name, one in zip(columns.sources, arrays, strict=True):
            values = whole_column(one)
            channels[name] = values if name == "t" else values.astype(np.float64, copy=False)
        times = channels.pop("t")
        if not np.issubdtype(times.dtype, np.integer):
            times = times.astype(np.float64, copy=False)
        for name in seen:
            seen[name] = add(seen[name], word_sum(times if name == "t" else channels[name]))
        notices: list[Notice] = []
        if unit is None and times.size:
            if not np.all(np.isfinite(times)):
                raise LogError(f"{path}: a time is not finite; expected a number in every row")
            unit = time_unit(times)
            if unit != "s":
                notices.append(Notice("OTHER_UNIT", numbers={"case": "time", "unit": unit}))
        try:
            if columns.rate is not None:
                stamps = np.rint((done + np.arange(times.size)) * (1e9 / columns.rate))
                stamps = stamps.astype(np.int64)
            else:
                ticks = clock.unit if _is_clock(clock) else unit or "s"
                stamps = to_nanoseconds(times, ticks)
        except ValueError as error:
            raise LogError(
                f"{path}: {error} in column {columns.sources['t']!r}, past row {done}"
            ) from error
        if unit and not (done or columns.time_stated):
            notices += _slow(columns.sources["t"], stamps, unit)
        done += times.size
        if held is not None:
            yield held
        held = SampleTable(stamps, channels, tuple(notices))
    if held is None:
        return
    if lost == rows and not (lost == 1 and cut_off):
        raise LogError(
            f"{path}: no row has a value in every column that is needed; put the signals on "
            "common stamps"
        )
    if lost == 1 and cut_off:
        held = held.noting(Notice("CUT_OFF", numbers={"case": "row", "row": rows}))
    elif lost and columns.rate is not None:
        raise LogError(
            f"{path}: rows lack a value, and without a time the rows behind them have none; "
            "fill the cells, or add a column of times"
        )
    elif lost:
        numbers = {"count": lost, "rows": rows}
        held = held.noting(Notice("NOT_FINITE", numbers={"case": "empty"} | numbers))
    yield held
    wrong = [name for name, total in seen.items() if total != expected[name]]
    if wrong:
        raise LogError(
            f"{path}: the values of {', '.join(wrong)} are not those that were written: the file "
            "was changed or damaged; write it again, or remove its truth if it was changed on "
            "purpose"
        )


_EPOCH = (("s", 1e8, 1e11), ("ms", 1e11, 1e14), ("us", 1e14, 1e17), ("ns", 1e17, 1e20))
_STEPS = (("s", 0.2), ("ms", 50.0), ("us", 50_000.0))
_SLOWEST_NS = 200_000_000
"""A longer median step is no recording of an arm in motion: it has 5 Hz at least."""


def time_unit(times: NDArray[Any]) -> str:
    """The unit of a time column (N,) nobody named one for: "s", "ms", "us" or "ns".

    Times since 1970 tell by their size, where that makes a median step of 20 µs to 10 s. Times
    since the start of a log tell by their median step, for logs between 20 Hz and 20 kHz: below
    0.2 it is seconds, below 50 ms, below 50,000 µs, else ns.
    """
    first, step = abs(float(times[0])), _median_step(times)
    for unit, low, high in _EPOCH:
        if low <= first < high and (step == 0 or 2e4 <= step * NANOSECONDS[unit] <= 1e10):
            return unit
    return _unit_of_step(step)


def _unit_of_step(step: float) -> str:
    return next((unit for unit, longest in _STEPS if step < longest), "ns")


def _median_step(times: NDArray[Any]) -> float:
    """Median size of the steps between times (N,) that differ; 0 where none do."""
    steps = np.abs(np.diff(times.astype(np.float64)))
    steps = steps[steps > 0]
    return median(steps) if steps.size else 0.0


def to_nanoseconds(times: NDArray[Any], unit: str) -> IntArray:
    """Times (N,) in `unit` as int64 ns, to the nearest; integers stay exact.

    Raises
    ------
    ValueError
        If a time is not finite, or out of the 292 years that int64 nanoseconds span.
    """
    factor = NANOSECONDS[unit]
    whole = np.issubdtype(times.dtype, np.integer)
    if not (whole or np.all(np.isfinite(times))):
        raise ValueError("a time that is not finite")
    if (
        times.size
        and max(abs(times.min().item()), abs(times.max().item())) * factor > LIMITS.largest_time_ns
    ):
        raise ValueError("a time beyond 292 years")
    if whole:
        whole_ns = times.astype(np.int64, copy=False)
        return whole_ns * factor if factor != 1 else whole_ns
    seconds = np.floor(times)
    return seconds.astype(np.int64) * factor + np.rint((times - seconds) * factor).astype(np.int64)


def _slow(column: str, stamps: IntArray, unit: str) -> list[Notice]:
    """What to say where nobody gave the unit of time and samples are too far apart for an arm."""
    step = _median_step(stamps - stamps[:1])
    if step <= _SLOWEST_NS:
        return []
    likely = _unit_of_step(step / NANOSECONDS[unit])
    numbers = {"column": column, "unit": unit, "rate": 1e9 / step}
    other = Remedy({"time_unit": likely}, f"if they are in {likely}")
    return [Notice("OTHER_UNIT", numbers={"case": "slow time"} | numbers, remedies=(other,))]
