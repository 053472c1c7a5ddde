"""From data frames with canonical names to tables: what CSV and Parquet share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.log import IntArray, Notice
from algid.readers.clock import NANOSECONDS, SLOWEST_NS, median_step, time_unit, to_nanoseconds, unit_of_step
from algid.readers.columns import Columns
from algid.readers.table import Table
from algid.truth import add, word_sum

if TYPE_CHECKING:
    import polars as pl


def tables(path: str, frames: Iterator[pl.DataFrame], columns: Columns, sums: Mapping[str, int]) -> Iterator[Table]:
    """Tables out of frames that hold one column a channel, and "t".

    Raises
    ------
    LogError
        If a value is missing, a time is no time, or the sums of the values are not the file's own.
    """
    expected = {name: sums[source] for name, source in columns.sources.items() if source in sums}
    unit, seen, done = columns.time_unit, dict.fromkeys(expected, 0), 0
    for frame, cut_off in _complete(path, frames):
        if frame.height == 0 and done:
            continue
        for name in seen:
            seen[name] = add(seen[name], word_sum(frame[name].to_numpy()))
        times = frame["t"].to_numpy()
        notices = list(cut_off)
        if unit is None:
            unit = _detected(path, times, notices)
        try:
            stamps = to_nanoseconds(times, unit)
        except ValueError as error:
            raise LogError(f"{path}: {error} in column {columns.sources['t']!r}, past row {done}") from error
        if not (done or columns.time_told):
            notices += _slow(columns.sources["t"], stamps, unit)
        channels = {name: frame[name].to_numpy() for name in frame.columns if name != "t"}
        done += frame.height
        yield Table(stamps, channels, tuple(notices))
    _verify(path, seen, expected)


def _detected(path: str, times: NDArray[Any], notices: list[Notice]) -> str:
    if not np.all(np.isfinite(times)):
        raise LogError(f"{path}: a time is not finite; expected a number in every row")
    if times.size == 0:
        return "s"
    unit = time_unit(times)
    if unit != "s":
        notices.append(Notice("TIME_UNIT", f"times are taken for {unit}, from their size and their steps"))
    return unit


def _slow(column: str, stamps: IntArray, unit: str) -> list[Notice]:
    """What to say where nobody told the unit of time and samples are too far apart for an arm."""
    step = median_step(stamps - stamps[:1])
    if step <= SLOWEST_NS:
        return []
    likely = unit_of_step(step / NANOSECONDS[unit])
    text = (
        f"times in {column!r} are taken for {unit}, which makes {1e9 / step:.3g} Hz, too slow for an arm in motion; "
        f'if they are in {likely}, set time_unit = "{likely}" in a profile'
    )
    return [Notice("SLOW_CLOCK", text)]


def _complete(path: str, frames: Iterator[pl.DataFrame]) -> Iterator[tuple[pl.DataFrame, tuple[Notice, ...]]]:
    """Frames without nulls: a last row that breaks off is dropped and told of, any other null refused."""
    done, held = 0, None
    for frame in frames:
        if held is not None:
            yield _without_null(path, held, done), ()
            done += held.height
        held = frame
    if held is None:
        return
    if held.height and any(value is None for value in held.row(-1)):
        lost = Notice("CUT_OFF", "the last row breaks off and was dropped", lossy=True)
        yield _without_null(path, held.head(-1), done), (lost,)
    else:
        yield _without_null(path, held, done), ()


def _without_null(path: str, frame: pl.DataFrame, done: int) -> pl.DataFrame:
    for name in frame.columns:
        if frame[name].null_count():
            row = done + (frame[name].is_null().arg_max() or 0) + 1
            raise LogError(f"{path}: {name} has no value in row {row}; expected a number in every row")
    return frame


def _verify(path: str, seen: Mapping[str, int], expected: Mapping[str, int]) -> None:
    wrong = [name for name, total in seen.items() if total != expected[name]]
    if wrong:
        raise LogError(
            f"{path}: the values of {', '.join(wrong)} are not those that were written: the file was changed "
            "or damaged; write it again, or remove its truth if it was changed on purpose"
        )
