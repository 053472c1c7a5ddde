"""Runs of a log whose clock starts again: read one behind another, or one of them alone.

A clock that is set back, or a second recording behind the first one in a file, starts a run.
Samples that merely come late start none: they fill a hole, or stand twice.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from algid.errors import LogError
from algid.limits import LIMITS
from algid.log import IntArray
from algid.notices import Notice, Remedy
from algid.quantiles import median
from algid.readers.table import SampleTable, stack
from algid.readers.timebase import HORIZON, set_back
from algid.words import counted

_SHORTEST = 64
"""Late samples at a table's end that wait for the next table, and least samples of a far run."""
_MOST = 1000
"""Runs of a log: more are a broken clock's."""
PAUSE = 20
"""Periods between a run and the next one: a gap that no window spans."""


def one_after_another(
    path: str, tables: Iterator[SampleTable], only: int | None = None
) -> Iterator[SampleTable]:
    """The tables with the runs one behind another in time; the last one tells of them.

    Parameters
    ----------
    path : str
        Of the log, for messages.
    tables : iterator of SampleTable
        As they stand in the file.
    only : int, optional
        The run that is read alone, from 1.

    Raises
    ------
    LogError
        If there are too many runs, or fewer than `only`.
    """
    clock = _Clock(path)
    held: SampleTable | None = None
    left_out: tuple[Notice, ...] = ()
    for run, part in clock.parts(tables):
        if only not in (None, run):
            left_out += part.notices
            continue
        if held is not None:
            yield held
        held = part
    if only is not None and only > clock.run:
        last = Remedy({"segment": clock.run}, "the last one")
        runs = counted(clock.run, "run")
        raise LogError(f"{path}: there is no segment {only}: its time makes {runs}; {last}")
    if held is not None:
        notices = _restarts(clock.run, only) if clock.run > 1 else ()
        yield held.noting(*left_out, *notices)


def _restarts(runs: int, only: int | None) -> tuple[Notice]:
    """What to say of several runs."""
    said = "one is read behind another, and no window spans two"
    mends: tuple[Remedy, ...] = (Remedy({"segment": 1}, "for one of them"),)
    if only is not None:
        said, mends = f"number {only} is read alone", ()
    joined = runs - 1 if only is None else 0
    numbers = {"count": runs - 1, "runs": runs, "said": said, "joined": joined}
    return (Notice("RESTARTS", numbers=numbers, note=True, remedies=mends),)


class _Clock:
    """Numbers the runs of a log, and moves the stamps of each behind the run before it.

    Attributes
    ----------
    run : int
        The run that is being read, from 1.
    """

    def __init__(self, path: str) -> None:
        self.run = 1
        self._path = path
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
        around = stack([*known, table])
        places = (set_back(around), _far_back(around.stamp_ns))
        first = min((place for place in places if place is not None), default=None)
        if first is None:
            return None
        return max(0, first + 1 - sum(map(len, known)))

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
        if self.run == _MOST:
            other = Remedy({"time": None}, "name another time")
            raise LogError(
                f"{self._path}: time starts again {_MOST} times; expected one clock; {other}"
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


def _far_back(stamps: IntArray) -> int | None:
    """The row behind which time rises again from before all that is known of the run."""
    highest = np.maximum.accumulate(stamps)
    late = np.flatnonzero(stamps[1:] <= highest[:-1]) + 1
    for run in np.split(late, np.flatnonzero(np.diff(late) > 1) + 1):
        if run.size < _SHORTEST or run[0] < HORIZON:
            continue
        earlier = stamps[run[0]] < stamps[run[0] - HORIZON : run[0]].min()
        if earlier and np.count_nonzero(np.diff(stamps[run]) > 0) > 0.75 * run.size:
            return int(run[0]) - 1
    return None
