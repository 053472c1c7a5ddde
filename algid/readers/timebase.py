"""Samples on one time base: in time order, other topics interpolated to the main one's stamps.

Late samples are put in their place, repeated stamps dropped, a broken clock refused.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.criteria import BRIDGED
from algid.errors import LogError
from algid.limits import LIMITS
from algid.log import IntArray
from algid.notices import Notice, Remedy
from algid.quantiles import median
from algid.readers.table import SampleTable, stack
from algid.words import counted

HORIZON = 1024
"""Rows a sample may come late: a network reorders neighbours, it does not mix two recordings."""
BACKWARD_SHARE = 0.25
REPEATED_SHARE = 0.5
_RUN = 8
"""Samples in a row that come late: fewer are jitter."""


def in_order(path: str, tables: Iterator[SampleTable]) -> Iterator[SampleTable]:
    """Tables with strictly increasing stamps, within and across.

    The last one tells what was mended.

    Raises
    ------
    LogError
        If time goes backwards by more than `HORIZON` rows or in a quarter of the rows, or stands
        still in half of them.
    """
    pending: SampleTable | None = None
    counts = np.zeros(3, dtype=np.int64)
    for table in tables:
        if len(table) == 0 and pending is not None:
            pending = pending.noting(*table.notices)
            continue
        ordered, added = _sorted(path, table)
        counts += added
        if pending is None:
            pending = ordered
        elif len(pending) == 0:
            pending = ordered.noting(*pending.notices)
        elif ordered.stamp_ns[0] > pending.stamp_ns[-1]:
            yield pending
            pending = ordered
        else:
            merged, added = _sorted(path, stack([pending, ordered]))
            counts += added
            keep = max(0, len(merged) - max(HORIZON, len(ordered) // 2))
            if keep:
                yield merged.part(0, keep)
                merged = merged.part(keep, len(merged))
            pending = merged
    late, repeated, lost = counts.tolist()
    said = []
    if late:
        said.append(Notice("UNSORTED_STAMPS", numbers={"count": late}))
    if repeated:
        others = ""
        if lost:
            others = f"; {counted(lost, 'with other values is', 'with other values are')} lost"
        numbers = {"count": repeated, "others": others}
        said.append(Notice("DUPLICATE_STAMPS", numbers=numbers, lossy=lost > 0))
    if pending is not None:
        yield pending.noting(*said)


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


def _sorted(path: str, table: SampleTable) -> tuple[SampleTable, tuple[int, int, int]]:
    """The table in time order, with counts of late samples, dropped repeats, differing repeats.

    The last count is of dropped samples whose values differ from those of the sample kept.

    Raises
    ------
    LogError
        As `in_order`.
    """
    stamps = table.stamp_ns
    if np.all(stamps[1:] > stamps[:-1]):
        return table, (0, 0, 0)
    rows = len(table)
    back = np.flatnonzero(np.diff(stamps) < 0)
    order = np.argsort(stamps, kind="stable")
    moved = order - np.arange(rows)
    place = None
    if back.size:
        place = set_back(table)
        if place is None and (back.size > BACKWARD_SHARE * rows or np.abs(moved).max() > HORIZON):
            place = back[0]
    if place is not None:
        last = stamps[place]
        raise LogError(
            f"{path}: time goes backwards by {(last - stamps[place + 1]) * 1e-9:.6g} s behind "
            f"stamp {last} ns, "
            "and not for a few late samples only; split the file where its clock starts again"
        )
    fresh = np.diff(stamps[order], prepend=stamps[order[0]] - 1) > 0
    repeated = rows - int(np.count_nonzero(fresh))
    if repeated > REPEATED_SHARE * rows:
        time = Remedy({"time": None}, "name another time")
        clock = Remedy({"clock": "log"}, "of messages take another clock")
        raise LogError(
            f"{path}: time stands still: {repeated} of {counted(rows, 'stamp')} as the one before; "
            f"expected increasing stamps; {time}; {clock}"
        )
    kept = order[fresh]
    gone, instead = order[~fresh], kept[np.cumsum(fresh)[~fresh] - 1]
    same = _alike(table, gone, instead)
    late, lost = np.count_nonzero(moved > 0), gone.size - np.count_nonzero(same)
    return table.take(kept), (int(late), repeated, int(lost))


def _alike(table: SampleTable, rows: IntArray, others: IntArray) -> NDArray[np.bool_]:
    """Which rows (R,) hold what the others (R,) hold; what is missing in both is the same."""
    same = np.ones(rows.size, np.bool_)
    for values in table.columns.values():
        one, other = values[rows], values[others]
        same &= (one == other) | (np.isnan(one) & np.isnan(other))
    return same


def set_back(table: SampleTable) -> int | None:
    """The row behind which the clock was set back, if it was.

    Samples that merely come late fill the hole that they left, or come twice. Where a clock is set
    back, a row of other samples lies in time that was recorded already.
    """
    stamps = table.stamp_ns
    highest = np.maximum.accumulate(stamps)
    late = np.flatnonzero(stamps[1:] <= highest[:-1]) + 1
    runs = np.split(late, np.flatnonzero(np.diff(late) > 1) + 1)
    for run in runs:
        if run.size < _RUN:
            continue
        # in time order but for late ones among them
        before = np.arange(max(0, run[0] - HORIZON - run.size), run[0])
        before = before[np.argsort(stamps[before], kind="stable")]
        step = np.diff(stamps[before])
        period = median(step[step > 0]) if np.any(step > 0) else 0.0
        after = np.clip(np.searchsorted(stamps[before], stamps[run]), 0, before.size - 1)
        nearest = before[after]
        left = before[np.maximum(after - 1, 0)]
        nearer = np.abs(stamps[left] - stamps[run]) < np.abs(stamps[nearest] - stamps[run])
        nearest = np.where(nearer, left, nearest)
        crowded = np.abs(stamps[nearest] - stamps[run]) <= period / 2
        again = _alike(table, nearest, run)
        if np.count_nonzero(crowded & ~again) > run.size / 2:
            return int(run[0]) - 1
    return None


@dataclass(frozen=True, eq=False)
class Series:
    """A topic read as a whole: sorted stamps (M,) and its channels (M,)."""

    topic: str
    table: SampleTable

    @property
    def period(self) -> float:
        """Median time between samples in ns."""
        return median(np.diff(self.table.stamp_ns)) if len(self.table) > 1 else 0.0

    def covers(self, stamps: IntArray) -> NDArray[np.bool_]:
        """Which of the stamps (N,) are those of samples, or between two samples that are close."""
        own = self.table.stamp_ns
        if own.size < 2:
            return np.zeros(stamps.size, np.bool_)
        after = np.clip(np.searchsorted(own, stamps, side="left"), 1, own.size - 1)
        bridged = own[after] - own[after - 1] <= BRIDGED * self.period
        at_sample = (own[after] == stamps) | (own[after - 1] == stamps)
        return (bridged | at_sample) & (stamps >= own[0]) & (stamps <= own[-1])

    def holds(self, stamps: IntArray) -> bool:
        """Whether each of the stamps (N,) is a sample's."""
        own = self.table.stamp_ns
        places = np.minimum(np.searchsorted(own, stamps), own.size - 1)
        return bool(np.array_equal(own[places], stamps))

    def at(self, stamps: IntArray) -> dict[str, FloatArray]:
        """The channels at the stamps (N,), linear between samples."""
        start = self.table.stamp_ns[0]
        own = (self.table.stamp_ns - start).astype(np.float64)
        wanted = (stamps - start).astype(np.float64)
        return {name: np.interp(wanted, own, values) for name, values in self.table.columns.items()}

    def error(self) -> str:
        """Error of linear interpolation by channel: RMS of an eighth of the second differences."""
        costs = []
        for name, values in self.table.columns.items():
            cost = 0.0
            if values.size > 2:
                cost = float(np.sqrt(np.mean((np.diff(values, 2) / 8) ** 2)))
            costs.append(f"{name} {cost:.2g}")
        return ", ".join(costs)


def whole_topic(
    path: str, topic: str, channels: Collection[str], tables: Iterator[SampleTable]
) -> Series:
    """A topic of a file as a whole, in time order; its tables hold the `channels`.

    Raises
    ------
    LogError
        As `in_order`, and if there is no sample.
    """
    filled = [table for table in in_order(path, tables) if len(table)]
    if not filled:
        channel = next(iter(channels))
        other = Remedy({f"{channel}.topic": None, f"{channel}.source": None}, "name another")
        raise LogError(f"{path}: topic {topic!r} holds no sample of {channel}; {other}")
    return Series(topic, stack(filled))


def aligned(
    main: Iterator[SampleTable],
    others: Sequence[Series],
    beside: Sequence[Series] = (),
    notices: Sequence[Notice] = (),
) -> Iterator[SampleTable]:
    """The main topic's tables with the other topics' channels, where all `others` cover it.

    Where those `beside` do not, their channels are NaN.

    The last table tells how many were dropped and what the interpolation costs, in the log's own
    units, and has the `notices`.
    """
    lost, held = 0, None
    between: set[str] = set()
    for table in main:
        if held is not None:
            yield held
        covered = np.ones(len(table), np.bool_)
        for other in others:
            covered &= other.covers(table.stamp_ns)
        lost += len(table) - int(np.count_nonzero(covered))
        kept = table if covered.all() else table.take(covered)
        columns = dict(kept.columns)
        for other in others:
            columns |= other.at(kept.stamp_ns)
            if not other.holds(kept.stamp_ns):
                between.add(other.topic)
        for other in beside:
            known = other.covers(kept.stamp_ns)
            at_stamps = other.at(kept.stamp_ns)
            for name, values in at_stamps.items():
                columns[name] = np.where(known, values, np.nan)
        held = SampleTable(kept.stamp_ns, columns, kept.notices)
    said = list(notices)
    for other in others:
        if other.topic in between:
            rate = 1e9 / other.period if other.period else 0.0
            numbers = {"topic": other.topic, "rate": rate, "error": other.error()}
            said.append(Notice("ALIGNED", numbers=numbers))
    if lost:
        said.append(Notice("NOT_COVERED", numbers={"count": lost}, lossy=True))
    for other in others:
        said += other.table.notices
    if held is not None:
        yield held.noting(*said)
