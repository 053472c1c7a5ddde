"""One clock for a log: late samples in their place, repeated stamps dropped, restarts joined.

A clock that is set back, or a second recording behind the first one in a file, starts a run: a row
of samples lies in time that was recorded already, and is not what was recorded then. Samples that
merely come late start none: they fill a hole, or stand twice. Runs are read one behind another, or
one of them alone. Other topics are interpolated to the main one's stamps.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import BRIDGED
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.quantiles import median
from algid.base.text import counted
from algid.log import IntArray
from algid.notices import Notice, Remedy
from algid.readers.table import SampleTable, stack

HORIZON = 1024
"""Rows a sample may come late: a network reorders neighbours, it does not mix two recordings."""
BACKWARD_SHARE, REPEATED_SHARE = 0.25, 0.5
"""Of the rows: those that come late by more than a few places, and those of a repeated stamp."""
_FEW = 16
"""Places by which any number of samples may come late: two threads that write to one file."""
_RUN = 8
"""Samples in a row that come late: fewer are jitter."""
_SHORTEST = 64
"""Late samples at a table's end that wait for the next table, and least of a run before all."""
_APART = 1.5
"""Periods: between the step of all rows and that of the half that one of two threads writes."""
PAUSE = 20
"""Periods between a run and the next one: a gap that no window spans."""


def in_order(
    tables: Iterator[SampleTable],
    told: list[Notice],
    segment: int | None = None,
    *,
    runs: bool = False,
) -> Iterator[SampleTable]:
    """Tables with strictly increasing stamps, within and across, none of them empty.

    Parameters
    ----------
    tables : iterator of SampleTable
        As they stand in the file.
    told : list of Notice
        At the end it has what was mended, too.
    segment : int, optional
        The run that is read alone, from 1.
    runs : bool
        Whether the clock may start again.

    Raises
    ------
    LogError
        If time goes back where it may not, or by more than `HORIZON` rows, or in a quarter of the
        rows by more than a few; if it stands still in half of them; if there are fewer runs than
        `segment`.
    """
    run, shift_ns = 1, 0
    held: SampleTable | None = None  # this run's last rows: late ones may belong among them
    counts = np.zeros(3, np.int64)

    def moved(table: SampleTable) -> Iterator[SampleTable]:
        """A part of this run behind the run before; nothing of it where another is read alone."""
        if segment not in (None, run):
            return
        if int(table.stamp_ns[-1]) + shift_ns > LIMITS.largest_time_ns:
            raise LogError("time starts again, and its runs span over 292 years")
        yield SampleTable(table.stamp_ns + shift_ns, table.columns) if shift_ns else table

    for rows in tables:
        if not len(rows):
            continue
        rising = bool(np.all(rows.stamp_ns[1:] > rows.stamp_ns[:-1]))
        if held is not None and rising and np.all(held.stamp_ns < rows.stamp_ns[0]):
            yield from moved(_sorted(held, counts))
        elif held is not None:
            rows, rising = stack([held, rows]), False
        if rising:
            held = rows
            continue
        while (start := _restart(rows)) is not None:
            ordered = _sorted(rows.part(0, start), counts)
            last_ns, first_ns = int(ordered.stamp_ns[-1]), int(rows.stamp_ns[start])
            if not runs:
                raise LogError(_backwards(last_ns, first_ns))
            yield from moved(ordered)
            pause = max(1, round(PAUSE * _period(ordered.stamp_ns[-HORIZON:])))
            shift_ns += last_ns + pause - first_ns
            rows, run = rows.part(start, len(rows)), run + 1
        # late rows at the end are perhaps the next run's first; so many would have shown it
        certain = int(np.flatnonzero(~_late(rows.stamp_ns))[-1]) + 1
        if len(rows) - certain >= _SHORTEST:
            certain = len(rows)
        ordered = _sorted(rows.part(0, certain), counts)
        settled = max(0, len(ordered) - HORIZON)
        if settled:
            yield from moved(ordered.part(0, settled))
        held = stack([ordered.part(settled, len(ordered)), rows.part(certain, len(rows))])
    if segment is not None and segment > run:
        last_one, known = Remedy({"segment": run}, "the last one"), counted(run, "run")
        raise LogError(f"there is no segment {segment}: its time makes {known}; {last_one}")
    if held is not None:
        yield from moved(_sorted(held, counts))
    late, repeated, lost = counts.tolist()
    if run > 1:
        said = "one is read behind another, and no window spans two"
        remedies: tuple[Remedy, ...] = (Remedy({"segment": 1}, "for one of them"),)
        if segment is not None:
            said, remedies = f"number {segment} is read alone", ()
        joined = run - 1 if segment is None else 0
        numbers = {"count": run - 1, "runs": run, "said": said, "joined": joined}
        told.append(Notice("GAPS", numbers={"case": "restarts"} | numbers, remedies=remedies))
    if late:
        told.append(Notice("UNEVEN_STAMPS", numbers={"case": "late", "count": late}))
    if repeated:
        others = ""
        if lost:
            others = f"; {counted(lost, 'with other values is', 'with other values are')} lost"
        numbers = {"case": "repeated", "count": repeated, "others": others}
        told.append(Notice("UNEVEN_STAMPS", numbers=numbers, lossy=lost > 0))


def _period(stamps: IntArray) -> float:
    """Median step between increasing stamps (N,) in ns; 0 for one stamp."""
    return median(np.diff(stamps)) if stamps.size > 1 else 0.0


def _late(stamps: IntArray) -> NDArray[np.bool_]:
    """Which stamps (N,) are not above all before them."""
    late = np.zeros(stamps.size, np.bool_)
    late[1:] = stamps[1:] <= np.maximum.accumulate(stamps)[:-1]
    return late


def _restart(table: SampleTable) -> int | None:
    """The row of the table with which the clock starts again; None where it does not.

    Rows that merely come late fill a hole, or repeat what stands there. Those of another run lie
    in time of which rows are known without a hole, or before all that is known.
    """
    late = np.flatnonzero(_late(table.stamp_ns))
    for rows in np.split(late, np.flatnonzero(np.diff(late) > 1) + 1):
        if rows.size < _RUN or rows[0] < 2:
            continue
        before = table.part(max(0, rows[0] - 2 * HORIZON - rows.size), rows[0])
        order = np.argsort(before.stamp_ns, kind="stable")
        known, own = before.stamp_ns[order], table.stamp_ns[rows]
        after = np.clip(np.searchsorted(known, own), 1, known.size - 1)
        near = known[after] - known[after - 1] <= _APART * _period(np.unique(known))
        inside = near & (known[0] <= own) & (own < known[-1])  # where it stands still none is
        same = (known[after] == own) & _alike(table, rows[0] - known.size + order[after], rows)
        if np.count_nonzero(inside & ~same) > rows.size / 2:
            return int(rows[0])
        rising = np.count_nonzero(np.diff(own) > 0) > 0.75 * rows.size
        if rows.size >= _SHORTEST and rising and own[0] < before.stamp_ns[-HORIZON:].min():
            return int(rows[0])
    return None


def _sorted(table: SampleTable, counts: IntArray) -> SampleTable:
    """The table in time order.

    What that mends is added to `counts`: late samples, dropped repeats, and of these the ones whose
    values differ from those of the sample kept.

    Raises
    ------
    LogError
        As `in_order`.
    """
    stamps = table.stamp_ns
    if np.all(stamps[1:] > stamps[:-1]):
        return table
    rows = len(table)
    back = np.flatnonzero(np.diff(stamps) < 0)
    order = np.argsort(stamps, kind="stable")
    moved = order - np.arange(rows)
    far = int(np.abs(moved).max())
    if far > HORIZON or (far > _FEW and back.size > BACKWARD_SHARE * rows):
        raise LogError(_backwards(int(stamps[back[0]]), int(stamps[back[0] + 1])))
    fresh = np.diff(stamps[order], prepend=stamps[order[0]] - 1) > 0
    repeated = rows - int(np.count_nonzero(fresh))
    if repeated > REPEATED_SHARE * rows:
        time = Remedy({"time": None}, "name another time")
        clock = Remedy({"clock": "log"}, "of messages take another clock")
        raise LogError(
            f"time stands still: {repeated} of {counted(rows, 'stamp')} as the one before; "
            f"expected increasing stamps; {time}; {clock}"
        )
    kept = order[fresh]
    gone, instead = order[~fresh], kept[np.cumsum(fresh)[~fresh] - 1]
    lost = gone.size - np.count_nonzero(_alike(table, gone, instead))
    counts += np.array([np.count_nonzero(moved > 0), repeated, lost])
    return table.take(kept)


def _backwards(last: int, first: int) -> str:
    return (
        f"time goes backwards by {(last - first) * 1e-9:.6g} s behind stamp {last} ns, "
        "and not for a few late samples only; split the file where its clock starts again"
    )


def _alike(table: SampleTable, rows: IntArray, others: IntArray) -> NDArray[np.bool_]:
    """Which rows (R,) hold what the others (R,) hold; missing in both is the same."""
    same = np.ones(rows.size, np.bool_)
    for values in table.columns.values():
        one, two = values[rows], values[others]
        same &= (one == two) | (np.isnan(one) & np.isnan(two))
    return same


def check_step(path: str, stamps: IntArray) -> None:
    """Refuse a clock that no arm is sampled by: its unit is another.

    Raises
    ------
    LogError
        If the median step between the stamps (N,) is shorter than `FileLimits.shortest_step_ns`.
    """
    step = median(np.diff(stamps)) if stamps.size > 2 else np.inf
    if step < LIMITS.shortest_step_ns:
        unit = Remedy({"time_unit": "s"}, "say their unit (s, ms, us or ns)")
        clock = Remedy({"clock": "log"}, "of messages take another clock")
        raise LogError(
            f"{path}: its stamps are {step:g} ns apart in the median, {1e9 / max(step, 1.0):.3g} "
            f"Hz, as no arm's log is; {unit}; {clock}"
        )


@dataclass(frozen=True, eq=False)
class Series:
    """A topic read as a whole: sorted stamps (M,) and its channels (M,)."""

    topic: str
    table: SampleTable

    @property
    def period(self) -> float:
        """Median time between samples in ns."""
        return _period(self.table.stamp_ns)

    def at(self, stamps: IntArray) -> tuple[NDArray[np.bool_], dict[str, FloatArray]]:
        """Which stamps (N,) it covers, and the channels there, linear between samples.

        Covered is what equals a sample's, or lies between two samples without a gap; the rest is
        NaN.
        """
        own = self.table.stamp_ns
        place = np.searchsorted(own, stamps)
        after, before = np.minimum(place, own.size - 1), np.maximum(place - 1, 0)
        inside = (own[before] <= stamps) & (stamps <= own[after])
        covered = inside & (own[after] - own[before] <= BRIDGED * self.period)
        covered |= own[after] == stamps
        since, wanted = ((one - own[0]).astype(np.float64) for one in (own, stamps))
        channels = {}
        for name, values in self.table.columns.items():
            channels[name] = np.where(covered, np.interp(wanted, since, values), np.nan)
        return covered, channels

    def error(self) -> str:
        """Error of linear interpolation by channel: RMS of an eighth of the second differences."""
        costs = []
        for name, values in self.table.columns.items():
            bends = np.diff(values, 2)
            cost = np.linalg.norm(bends) / np.sqrt(64 * max(bends.size, 1))
            costs.append(f"{name} {cost:.2g}")
        return ", ".join(costs)


def whole_topic(
    topic: str,
    channels: Collection[str],
    tables: Iterator[SampleTable],
    told: list[Notice],
) -> Series:
    """A topic of a file as a whole, in time order; its tables hold the `channels`.

    Raises
    ------
    LogError
        As `in_order`, and if there is no sample.
    """
    parts = list(in_order(tables, told))
    if not parts:
        channel = next(iter(channels))
        other = Remedy({f"{channel}.topic": None, f"{channel}.source": None}, "name another")
        raise LogError(f"topic {topic!r} holds no sample of {channel}; {other}")
    return Series(topic, stack(parts))


def aligned(
    main: Iterator[SampleTable],
    others: Sequence[Series],
    told: list[Notice],
    beside: Sequence[Series] = (),
) -> Iterator[SampleTable]:
    """The main topic's tables with the other topics' channels, where all `others` cover it.

    Where those `beside` do not, their channels are NaN.

    At the end `told` has how many were dropped and what the interpolation costs, in the log's own
    units.
    """
    lost, between = 0, set[str]()
    for table in main:
        covered, columns = np.ones(len(table), np.bool_), dict(table.columns)
        for place, other in enumerate((*others, *beside)):
            known, channels = other.at(table.stamp_ns)
            columns |= channels
            if place < len(others):
                covered &= known
        kept = SampleTable(table.stamp_ns, columns).only(covered)
        lost += len(table) - len(kept)
        for other in others:
            own = other.table.stamp_ns
            places = np.minimum(np.searchsorted(own, kept.stamp_ns), own.size - 1)
            if not np.array_equal(own[places], kept.stamp_ns):
                between.add(other.topic)
        yield kept
    for other in others:
        if other.topic in between:
            rate = 1e9 / other.period if other.period else 0.0
            numbers = {"topic": other.topic, "rate": rate, "error": other.error()}
            told.append(Notice("ALIGNED", numbers={"case": "interpolated"} | numbers))
    if lost:
        told.append(Notice("ALIGNED", numbers={"case": "not covered", "count": lost}))
