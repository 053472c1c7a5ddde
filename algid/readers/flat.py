"""Tables of named columns, of any format: clock found, incomplete rows dropped, sums checked.

float64 seconds since 1970 resolve 0.24 µs, so whole and fractional seconds are converted apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.base.arrow import whole_column
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.quantiles import median
from algid.base.units import ANGLE, NANOSECONDS
from algid.log import IntArray, Origin, add, word_sum
from algid.notices import Notice, Remedy
from algid.readers.column_names import has_a_time
from algid.readers.columns import ChannelSources, choose_columns
from algid.readers.joints import moving_joints
from algid.readers.log_reader import TableReader, make_reader
from algid.readers.stated import lines_of
from algid.readers.table import SampleTable
from algid.readers.table_cells import TableCells, TableFile, cells_of, decoded, groups_in, units_of

if TYPE_CHECKING:
    from algid.profile import Profile

_LOOKED = 1 << 14
"""Samples in which the joints that are not read are looked at."""
_LISTED = 12
"""Arrays of other lengths that a message lists."""
INDEX = "__index_level_0__"
"""What pandas calls an index without a name where a frame becomes Arrow or Parquet."""


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


def open_table(table: TableFile, profile: Profile) -> TableReader:
    """A reader of the columns that a profile, or their names, choose.

    Raises
    ------
    LogError
        If a channel has no column, or its column holds no numbers.
    """
    path, rows = table.path, cells_of(table)
    cells = rows.by_name
    index = cells.get(INDEX)
    if index and index.is_clock and not (profile.time or has_a_time(cells)):
        profile = profile.model_copy(update={"time": INDEX})
    try:
        columns = choose_columns(path, list(cells), profile, units_of(rows), table.companion.sums)
    except LogError as error:
        if not table.others:
            raise
        more = ", ".join(table.others[:_LISTED])
        raise LogError(f"{error}; the log also holds, of another length: {more}") from error
    for name, source in columns.sources.items():
        cell = cells[source]
        if not (cell.is_number or (name == "t" and cell.is_clock)):
            held = str(cell.type).removeprefix("large_").removesuffix("_view")[:80]
            raise LogError(f"{path}: column {source!r} for {name} holds {held}; expected numbers")
    joints = {joint: one for joint, one in columns.others.items() if cells[one].is_number}
    columns = replace(columns, others=joints)
    if cells[columns.sources["t"]].is_clock:
        columns = replace(columns, time_unit="ns", time_stated=True)
    mapping = dict(columns.sources)
    if columns.rate is not None:
        mapping["t"] = f"rows at {columns.rate:g} Hz"
    reading = replace(columns.reading, clock="column", time_unit=columns.time_unit)
    origin = Origin(path, table.kind, mapping, table.companion.truth, reading)

    def look(others: Mapping[str, str]) -> Iterator[SampleTable]:
        looked = replace(columns, sources={"t": columns.sources["t"], **others})
        return samples(rows, looked, {}, _LOOKED)

    unit = profile.channel("theta1").unit or columns.units.get("theta1", "rad")
    # of counts nobody knows how far they are
    beside = moving_joints(columns.others, look, ANGLE[unit]) if unit in ANGLE else ()
    return make_reader(
        origin,
        lambda _: samples(rows, columns, table.companion.sums),
        profile,
        columns.units,
        (*table.notices, *groups_in(table), *columns.notices, *beside),
        table.rows or table.expected,
        (*table.said, *lines_of(decoded(table.schema.metadata))),
    )


def samples(
    rows: TableCells, columns: ChannelSources, sums: Mapping[str, int], most: int | None = None
) -> Iterator[SampleTable]:
    """The rows that have every value, with their stamps; the last table tells of the others.

    Parameters
    ----------
    rows : TableCells
    columns : ChannelSources
    sums : mapping
        Of the words of each column, as they were written.
    most : int, optional
        Rows to read.

    Raises
    ------
    LogError
        If no row has every value, a time is no time, or the values are not those written.
    """
    path, unit, clock = rows.table.path, columns.time_unit, rows.by_name[columns.sources["t"]]
    sources = {"t": columns.sources["t"], **columns.sources}
    expected = {name: sums[source] for name, source in sources.items() if source in sums}
    seen = dict.fromkeys(expected, 0)
    count = lost = done = 0
    cut_off = False
    held: SampleTable | None = None
    for arrays in rows.batches(list(sources.values()), most):
        import pyarrow as pa

        count += len(arrays[0])
        cut_off = False
        if any(one.null_count for one in arrays):
            cut_off = not all(one[-1].is_valid for one in arrays)
            whole = pa.RecordBatch.from_arrays(arrays, names=list(sources)).drop_null()
            lost += len(arrays[0]) - whole.num_rows
            arrays = whole.columns
        channels: dict[str, NDArray[Any]] = {}
        for name, one in zip(sources, arrays, strict=True):
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
                ticks = clock.type.unit if clock.is_clock else unit or "s"
                stamps = to_nanoseconds(times, ticks)
        except ValueError as error:
            raise LogError(
                f"{path}: {error} in column {sources['t']!r}, past row {done}"
            ) from error
        if unit and not (done or columns.time_stated):
            notices += _slow(sources["t"], stamps, unit)
        done += times.size
        if held is not None:
            yield held
        held = SampleTable(stamps, channels, tuple(notices))
    if held is None:
        return
    if lost == count and not (lost == 1 and cut_off):
        raise LogError(
            f"{path}: no row has a value in every column that is needed; put the signals on "
            "common stamps"
        )
    if lost == 1 and cut_off:
        held = held.noting(Notice("CUT_OFF", numbers={"case": "row", "row": count}))
    elif lost and columns.rate is not None:
        raise LogError(
            f"{path}: rows lack a value, and without a time the rows behind them have none; "
            "fill the cells, or add a column of times"
        )
    elif lost:
        numbers = {"count": lost, "rows": count}
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
