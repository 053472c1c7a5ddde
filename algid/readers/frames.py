"""Tables from frames of a flat log's columns: clock found, incomplete rows dropped, sums checked.

float64 seconds since 1970 resolve 0.24 µs, so whole and fractional seconds are converted apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.limits import LIMITS
from algid.log import Companion, IntArray, Origin, add, word_sum
from algid.notices import Notice, Remedy
from algid.quantiles import median
from algid.readers.assemble import TableReader, reader_of
from algid.readers.columns import Columns
from algid.readers.joints import moving_joints
from algid.readers.names import has_a_time
from algid.readers.table import SampleTable
from algid.units import ANGLE, NANOSECONDS

if TYPE_CHECKING:
    import polars as pl

    from algid.profile import Profile


@dataclass(frozen=True, eq=False)
class WholeRows:
    """Channels (N,) of the rows that have every value.

    How many more had not, and whether the last row is left out: among those that are lost, or
    beside them where nobody knows whether it breaks off.
    """

    columns: Mapping[str, NDArray[Any]]
    lost: int = 0
    cut_off: bool = False

    @classmethod
    def left_out(cls, columns: Columns, *, lost: bool) -> WholeRows:
        """No row where the last one would stand: it breaks off, or it may."""
        return cls(dict.fromkeys(columns.sources, np.empty(0)), int(lost), cut_off=True)


if TYPE_CHECKING:
    Frame = pl.DataFrame | WholeRows
    """One column a channel: of polars, or as arrays."""

    Frames = Callable[[Columns, int, int | None], Iterator[Frame]]
    """A fresh pass over columns in frames of so many rows; over the first rows only if given."""

NO_COMPANION = Companion(None, {})
_LOOKED = 1 << 14
"""Samples in which the joints that are not read are looked at."""


def flat_reader(
    path: str,
    kind: str,
    columns: Columns,
    frames: Frames,
    profile: Profile,
    rows: int,
    companion: Companion = NO_COMPANION,
) -> TableReader:
    """A reader of columns out of the frames that hold them; `rows` samples are to be expected.

    Raises
    ------
    LogError
        As `reader_of`.
    """
    reading = replace(columns.reading, clock="column", time_unit=columns.time_unit)
    mapping = dict(columns.sources)
    if columns.rate is not None:
        mapping["t"] = f"rows at {columns.rate:g} Hz"
    origin = Origin(path, kind, mapping, companion.truth, reading)

    def look(others: Mapping[str, str]) -> Iterator[SampleTable]:
        looked = replace(columns, sources={"t": columns.sources["t"], **others})
        return tables(path, frames(looked, _LOOKED, _LOOKED), looked, {})

    unit = profile.theta1.unit or columns.units.get("theta1", "rad")
    # of counts nobody knows how far they are
    beside = moving_joints(columns.others, look, ANGLE[unit]) if unit in ANGLE else ()
    return reader_of(
        origin,
        lambda rows: tables(path, frames(columns, rows, None), columns, companion.sums),
        profile,
        columns.units,
        (*columns.notices, *beside),
        rows,
    )


def cells(
    schema: Mapping[str, pl.DataType], width: Callable[[str], int]
) -> dict[str, tuple[pl.Expr, pl.DataType]]:
    """Expression and type of every cell of a row by name: a column, or a list's ``q[0]``, ``q[1]``.

    Parameters
    ----------
    schema : mapping
        The type of each column.
    width : callable
        How many cells the lists of a column have, of which 64 at most are taken.
    """
    import polars as pl

    by_name: dict[str, tuple[pl.Expr, pl.DataType]] = {}
    for column, kind in schema.items():
        cell = pl.col(column)
        if not isinstance(kind, (pl.List, pl.Array)):
            by_name[column] = cell, kind
            continue
        size = width(column) if isinstance(kind, pl.List) else kind.size
        lists = cell.list if isinstance(kind, pl.List) else cell.arr
        for place in range(min(size, LIMITS.list_cells)):
            by_name[f"{column}[{place}]"] = (
                lists.get(place, null_on_oob=True),
                cast("pl.DataType", kind.inner),
            )
    return by_name


Cells = Mapping[str, tuple["pl.Expr", "pl.DataType"]]
"""Expression and type of every cell of a row by name."""


def types_of(cells: Cells) -> dict[str, pl.DataType]:
    """The type of each cell."""
    return {name: kind for name, (_, kind) in cells.items()}


def roots_of(cells: Cells) -> dict[str, str]:
    """The column that each cell is taken from."""
    return {name: cell.meta.root_names()[0] for name, (cell, _) in cells.items()}


def numbers_of(columns: Columns, cells: Cells) -> list[pl.Expr]:
    """The number of each channel out of a row's cells."""
    return [number(name, *cells[source]) for name, source in columns.sources.items()]


INDEX = "__index_level_0__"
"""What pandas calls an index without a name where a frame becomes Arrow or Parquet."""


def timed_by_index(profile: Profile, kinds: Mapping[str, pl.DataType]) -> Profile:
    """The profile with an index of dates or durations for the time.

    As it is where a column has a time's name, the user says another, or there is no such index.
    """
    kind = kinds.get(INDEX)
    if kind is None or not kind.is_temporal():
        return profile
    if profile.time is not None or profile.rate is not None or has_a_time(kinds):
        return profile
    return profile.model_copy(update={"time": INDEX})


def of_numbers(path: str, columns: Columns, kinds: Mapping[str, pl.DataType]) -> Columns:
    """The columns once their types, given by column, hold numbers.

    The time may hold dates, or durations.

    Raises
    ------
    LogError
        If a column holds something else.
    """
    import polars as pl

    for name, source in columns.sources.items():
        kind = kinds[source]
        if not (
            kind.is_numeric()
            or (name == "t" and isinstance(kind, (pl.Datetime, pl.Duration, pl.Time)))
        ):
            raise LogError(f"{path}: column {source!r} for {name} holds {kind}; expected numbers")
    others = {joint: name for joint, name in columns.others.items() if kinds[name].is_numeric()}
    columns = replace(columns, others=others)
    return columns.dated() if kinds[columns.sources["t"]].is_temporal() else columns


def number(name: str, cell: pl.Expr, kind: pl.DataType) -> pl.Expr:
    """A cell as the float64 of a channel.

    As "t" a whole number as int64, a date in ns since 1970, a duration in ns.
    """
    import polars as pl

    if name != "t":
        return cell.cast(pl.Float64).alias(name)
    if isinstance(kind, (pl.Datetime, pl.Duration)):
        factor = NANOSECONDS[kind.time_unit or "us"]
        units = cell.to_physical()
        most = int(LIMITS.largest_time_ns) // factor
        return (
            pl.when(units.is_between(-most, most))
            .then(units * factor)
            .otherwise(beyond(units))
            .alias(name)
        )
    if kind in (pl.UInt64, pl.Int128, pl.UInt128):
        most = (1 << 63) - 1
        within = cell <= most if kind.is_unsigned_integer() else cell.is_between(-most, most)
        return pl.when(within).then(cell).otherwise(beyond(cell)).cast(pl.Int64).alias(name)
    return cell.cast(pl.Int64 if kind.is_integer() or kind.is_temporal() else pl.Float64).alias(
        name
    )


def beyond(cell: pl.Expr) -> pl.Expr:
    """The largest int64 where a cell has a value, so that `to_nanoseconds` refuses it as a time."""
    import polars as pl

    return pl.when(cell.is_not_null()).then(pl.lit((1 << 63) - 1, pl.Int64))


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


def tables(
    path: str, frames: Iterator[Frame], columns: Columns, sums: Mapping[str, int]
) -> Iterator[SampleTable]:
    """Tables out of frames that hold one column a channel, and "t"; `sums` are of words by column.

    Raises
    ------
    LogError
        If a value is missing, a time is no time, or the sums of the values are not the file's own.
    """
    expected = {name: sums[source] for name, source in columns.sources.items() if source in sums}
    unit, seen, done = columns.time_unit, dict.fromkeys(expected, 0), 0
    for frame, cut_off in _complete(path, frames):
        for name in seen:
            seen[name] = add(seen[name], word_sum(frame[name]))
        times = frame["t"]
        notices: list[Notice] = []
        if columns.rate is not None and any(one.code == "EMPTY_CELLS" for one in cut_off):
            raise LogError(
                f"{path}: rows lack a value, and without a time the rows behind them have none; "
                "fill the cells, or add a column of times"
            )
        if unit is None and times.size:
            if not np.all(np.isfinite(times)):
                raise LogError(f"{path}: a time is not finite; expected a number in every row")
            unit = time_unit(times)
            if unit != "s":
                notices.append(Notice("TIME_UNIT", numbers={"unit": unit}))
        try:
            stamps = (
                to_nanoseconds(times, unit or "s")
                if columns.rate is None
                else _counted(done, times.size, columns.rate)
            )
        except ValueError as error:
            raise LogError(
                f"{path}: {error} in column {columns.sources['t']!r}, past row {done}"
            ) from error
        if unit and not (done or columns.time_stated):
            notices += _slow(columns.sources["t"], stamps, unit)
        channels = dict(frame)
        del channels["t"]
        done += times.size
        yield SampleTable(stamps, channels, (*notices, *cut_off))
    wrong = [name for name, total in seen.items() if total != expected[name]]
    if wrong:
        raise LogError(
            f"{path}: the values of {', '.join(wrong)} are not those that were written: the file "
            "was changed or damaged; write it again, or remove its truth if it was changed on "
            "purpose"
        )


def _counted(done: int, rows: int, rate: float) -> IntArray:
    """Stamps (N,) in ns of the rows behind the first `done`, `rate` a second."""
    return np.rint((done + np.arange(rows)) * (1e9 / rate)).astype(np.int64)


def _slow(column: str, stamps: IntArray, unit: str) -> list[Notice]:
    """What to say where nobody gave the unit of time and samples are too far apart for an arm."""
    step = _median_step(stamps - stamps[:1])
    if step <= _SLOWEST_NS:
        return []
    likely = _unit_of_step(step / NANOSECONDS[unit])
    numbers = {"column": column, "unit": unit, "rate": 1e9 / step}
    other = Remedy({"time_unit": likely}, f"if they are in {likely}")
    return [Notice("SLOW_CLOCK", numbers=numbers, remedies=(other,))]


def _whole_rows(frame: pl.DataFrame) -> WholeRows:
    cut_off = bool(frame.height) and None in frame.row(-1)
    whole = frame.drop_nulls() if any(frame.null_count().row(0)) else frame
    columns = {name: whole[name].to_numpy() for name in whole.columns}
    return WholeRows(columns, frame.height - whole.height, cut_off)


def _complete(
    path: str, frames: Iterator[Frame]
) -> Iterator[tuple[Mapping[str, NDArray[Any]], tuple[Notice, ...]]]:
    """Frames without gaps: rows that lack a value are dropped and counted.

    The last row may break off.

    Raises
    ------
    LogError
        Where no row is complete.
    """
    rows, lost = 0, 0
    held: WholeRows | None = None
    for frame in frames:
        if held is not None:
            yield held.columns, ()
        held = frame if isinstance(frame, WholeRows) else _whole_rows(frame)
        rows += held.columns["t"].size + held.lost
        lost += held.lost
    if held is None:
        return
    if lost == rows > 0 and not (lost == 1 and held.cut_off):
        raise LogError(
            f"{path}: no row has a value in every column that is needed; put the signals on "
            "common stamps"
        )
    yield held.columns, _of_gaps(rows, lost, held)


def _of_gaps(rows: int, lost: int, last: WholeRows) -> tuple[Notice, ...]:
    """What to say of so many rows, of which some are lost, and of the last frame of them."""
    doubtful = last.cut_off and not last.lost
    if lost == 1 and last.cut_off and not doubtful:
        return (Notice("CUT_OFF", numbers={"case": "row", "row": rows}, lossy=True),)
    notices = []
    if lost:
        notices.append(Notice("EMPTY_CELLS", numbers={"count": lost, "rows": rows}, lossy=True))
    if doubtful:
        notices.append(Notice("NO_LINE_END", numbers={"row": rows + 1}, note=True))
    return tuple(notices)
