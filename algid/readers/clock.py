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
from algid.base.words import counted
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
_MOST_RUNS = 1000
"""More are a broken clock's."""
PAUSE = 20
"""Periods between a run and the next one: a gap that no window spans."""


def in_order(
    path: str, tables: Iterator[SampleTable], segment: int | None = None, *, runs: bool = False
) -> Iterator[SampleTable]:
    """Tables with strictly increasing stamps, within and across; the last tells what was mended.

    Parameters
    ----------
    path : str
        Of the log, for messages.
    tables : iterator of SampleTable
        As they stand in the file.
    segment : int, optional
        The run that is read alone, from 1.
    runs : bool
        Whether the clock may start again.

    Raises
    ------
    LogError
        If time goes back where it may not, or by more than `HORIZON` rows, or in a quarter of the
        rows by more than a few; if it stands still in half of them; if there are too many runs, or
        fewer than `segment`.
    """
    clock = _Clock(path, runs)
    pending: SampleTable | None = None
    counts = np.zeros(3, dtype=np.int64)
    left_out: tuple[Notice, ...] = ()
    for run, table in clock.parts(tables):
        if segment not in (None, run):
            left_out += table.notices
            continue
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
    if segment is not None and segment > clock.run:
        last = Remedy({"segment": clock.run}, "the last one")
        known = counted(clock.run, "run")
        raise LogError(f"{path}: there is no segment {segment}: its time makes {known}; {last}")
    if pending is not None:
        restarts = _restarts(clock.run, segment) if clock.run > 1 else ()
        yield pending.noting(*left_out, *restarts, *_mended(*counts.tolist()))


def _mended(late: int, repeated: int, lost: int) -> Iterator[Notice]:
    """What to say of samples that came late, and of repeated stamps, of which some are lost."""
    if late:
        yield Notice("UNEVEN_STAMPS", numbers={"case": "late", "count": late})
    if repeated:
        others = ""
        if lost:
            others = f"; {counted(lost, 'with other values is', 'with other values are')} lost"
        numbers = {"count": repeated, "others": others}
        yield Notice("UNEVEN_STAMPS", numbers={"case": "repeated"} | numbers, lossy=lost > 0)


def _restarts(runs: int, only: int | None) -> tuple[Notice]:
    """What to say of several runs."""
    said = "one is read behind another, and no window spans two"
    mends: tuple[Remedy, ...] = (Remedy({"segment": 1}, "for one of them"),)
    if only is not None:
        said, mends = f"number {only} is read alone", ()
    joined = runs - 1 if only is None else 0
    numbers = {"count": runs - 1, "runs": runs, "said": said, "joined": joined}
    return (Notice("GAPS", numbers={"case": "restarts"} | numbers, remedies=mends),)


class _Clock:
    """Numbers the runs of a log, and moves the stamps of each behind the run before it.

    Attributes
    ----------
    run : int
        The run that is being read, from 1.
    """

    def __init__(self, path: str, restarts: bool) -> None:
        self.run = 1
        self._path, self._restarts = path, restarts
        self._before: SampleTable | None = None  # the run's last rows, as they stand in the file
        self._moved_ns = 0
        self._latest_ns = -(1 << 63)

    def parts(self, tables: Iterator[SampleTable]) -> Iterator[tuple[int, SampleTable]]:
        """Parts of the tables, each with its run; late rows at a table's end wait for the next."""
        waiting: SampleTable | None = None
        for each in tables:
            if not len(each):
                yield self.run, each
                continue
            table = each if waiting is None else stack([waiting, each])
            waiting = None
            while (place := self._restart(table)) is not None:
                if place:
                    yield self._moved(table.part(0, place))
                table = table.part(place, len(table))
                self._begin(int(table.stamp_ns[0]))
            settled = self._settled(table.stamp_ns)
            if settled < len(table):
                waiting = table.part(settled, len(table))
            if settled:
                yield self._moved(table.part(0, settled))
        if waiting is not None:
            yield self._moved(waiting)

    def _rises(self, stamps: IntArray) -> bool:
        before = self._before
        follows = before is None or stamps[0] > before.stamp_ns[-1]
        return bool(follows and np.all(stamps[1:] > stamps[:-1]))

    def _restart(self, table: SampleTable) -> int | None:
        """The row of the table with which a new run begins."""
        if self._rises(table.stamp_ns):
            return None
        known = [] if self._before is None else [self._before]
        first = _restart(stack([*known, table]))
        return None if first is None else max(0, first - sum(map(len, known)))

    def _settled(self, stamps: IntArray) -> int:
        """How many rows are of this run for certain: all but a few late ones at the end."""
        if self._rises(stamps):
            return stamps.size
        before = stamps[0] if self._before is None else self._before.stamp_ns.max()
        on_time = np.flatnonzero(stamps >= np.maximum(np.maximum.accumulate(stamps), before))
        certain = int(on_time[-1]) + 1 if on_time.size else 0
        return certain if stamps.size - certain < _SHORTEST else stamps.size

    def _begin(self, first_ns: int) -> None:
        """A new run begins, whose first stamp is given."""
        if not self._restarts:
            last = self._latest_ns
            raise LogError(_backwards(self._path, last, first_ns))
        if self.run == _MOST_RUNS:
            other = Remedy({"time": None}, "name another time")
            raise LogError(
                f"{self._path}: time starts again {_MOST_RUNS} times; expected one clock; {other}"
            )
        self.run += 1
        if self._before is not None:
            steps = np.diff(self._before.stamp_ns)
            period = median(steps[steps > 0]) if np.any(steps > 0) else 0.0
            self._moved_ns = self._latest_ns + max(1, round(PAUSE * period)) - first_ns
        self._before = None

    def _moved(self, part: SampleTable) -> tuple[int, SampleTable]:
        """The part behind what stands before it, and its run."""
        known = [self._before] if self._before is not None and len(part) < HORIZON else []
        last = stack([*known, SampleTable(part.stamp_ns, part.columns)])
        self._before = last.part(max(0, len(last) - HORIZON), len(last))
        latest = int(part.stamp_ns.max()) + self._moved_ns
        if self._moved_ns and latest > LIMITS.largest_time_ns:
            raise LogError(f"{self._path}: time starts again, and its runs span over 292 years")
        self._latest_ns = max(self._latest_ns, latest)
        stamps = part.stamp_ns + self._moved_ns if self._moved_ns else part.stamp_ns
        return self.run, SampleTable(stamps, part.columns, part.notices)


def _restart(table: SampleTable) -> int | None:
    """The row with which the clock starts again, None where it does not."""
    stamps = table.stamp_ns
    highest = np.maximum.accumulate(stamps)
    late = np.flatnonzero(stamps[1:] <= highest[:-1]) + 1
    for run in np.split(late, np.flatnonzero(np.diff(late) > 1) + 1):
        goes_back = np.any(np.diff(stamps[run[0] - 1 : run[-1] + 1]) < 0)  # or stands still
        if run.size < _RUN or not goes_back:
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
        if np.count_nonzero(crowded & ~_alike(table, nearest, run)) > run.size / 2:
            return int(run[0])
        # from before all that is known of the run time rises again
        known = stamps[max(0, run[0] - HORIZON) : run[0]]
        rising = np.count_nonzero(np.diff(stamps[run]) > 0) > 0.75 * run.size
        if run.size >= _SHORTEST and rising and stamps[run[0]] < known.min():
            return int(run[0])
    return None


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
    far = int(np.abs(moved).max())
    if far > HORIZON or (far > _FEW and back.size > BACKWARD_SHARE * rows):
        raise LogError(_backwards(path, int(stamps[back[0]]), int(stamps[back[0] + 1])))
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


def _backwards(path: str, last: int, first: int) -> str:
    return (
        f"{path}: time goes backwards by {(last - first) * 1e-9:.6g} s behind stamp {last} ns, "
        "and not for a few late samples only; split the file where its clock starts again"
    )


def _alike(table: SampleTable, rows: IntArray, others: IntArray) -> NDArray[np.bool_]:
    """Which rows (R,) hold what the others (R,) hold; what is missing in both is the same."""
    same = np.ones(rows.size, np.bool_)
    for values in table.columns.values():
        one, other = values[rows], values[others]
        same &= (one == other) | (np.isnan(one) & np.isnan(other))
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
        return median(np.diff(self.table.stamp_ns)) if len(self.table) > 1 else 0.0

    def covers(self, stamps: IntArray) -> NDArray[np.bool_]:
        """True where a stamp (N,) equals a sample's, or lies between two samples without a gap."""
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
            said.append(Notice("ALIGNED", numbers={"case": "interpolated"} | numbers))
    if lost:
        said.append(Notice("ALIGNED", numbers={"case": "not covered", "count": lost}))
    for other in others:
        said += other.table.notices
    if held is not None:
        yield held.noting(*said)
