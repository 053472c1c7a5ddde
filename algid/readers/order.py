"""Time order: late samples are put in their place, repeated stamps dropped, a broken clock refused."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from algid.errors import LogError
from algid.log import Notice
from algid.readers.table import SampleTable, stack
from algid.words import counted

HORIZON = 1024
"""Rows a sample may come late: a network reorders neighbours, it does not mix two recordings."""
BACKWARD_SHARE = 0.25
REPEATED_SHARE = 0.5


class Sorter:
    """Sorts a stream of tables and counts what it had to do."""

    def __init__(self, path: str) -> None:
        self._path = path
        self.late = 0
        self.repeated = 0

    def run(self, tables: Iterator[SampleTable]) -> Iterator[SampleTable]:
        """Tables with strictly increasing stamps, within and across; the last one tells what was mended.

        Raises
        ------
        LogError
            If time goes backwards by more than `HORIZON` rows or in a quarter of the rows, or stands still
            in half of them.
        """
        pending: SampleTable | None = None
        for table in tables:
            if len(table) == 0 and pending is not None:
                pending = pending.noting(*table.notices)
                continue
            ordered = self._sorted(table)
            if pending is None or len(pending) == 0:
                pending = ordered if pending is None else ordered.noting(*pending.notices)
            elif ordered.stamp_ns[0] > pending.stamp_ns[-1]:
                yield pending
                pending = ordered
            else:
                merged = self._sorted(stack([pending, ordered]))
                keep = max(0, len(merged) - max(HORIZON, len(ordered) // 2))
                if keep:
                    yield merged.part(0, keep)
                pending = merged.part(keep, len(merged)) if keep else merged
        if pending is not None:
            yield pending.noting(*self._report())

    def _sorted(self, table: SampleTable) -> SampleTable:
        if np.all(table.stamp_ns[1:] > table.stamp_ns[:-1]):
            return table
        steps = np.diff(table.stamp_ns)
        backward = int(np.count_nonzero(steps < 0))
        if backward:
            table = self._reordered(table, backward)
            steps = np.diff(table.stamp_ns)
        fresh = np.concatenate([[True], steps > 0])
        repeated = int(fresh.size - np.count_nonzero(fresh))
        if repeated > REPEATED_SHARE * fresh.size:
            raise LogError(
                f"{self._path}: time stands still: {repeated} of {counted(fresh.size, 'stamp')} as the one before; "
                'expected increasing stamps; name another time: --set time=NAME (profile: time = "NAME"), of messages '
                '--clock log (profile: clock = "log")'
            )
        self.repeated += repeated
        return table.take(fresh) if repeated else table

    def _reordered(self, table: SampleTable, backward: int) -> SampleTable:
        order = np.argsort(table.stamp_ns, kind="stable")
        moved = order - np.arange(order.size)
        place = int(np.flatnonzero(np.diff(table.stamp_ns) < 0)[0])
        if backward > BACKWARD_SHARE * order.size or np.abs(moved).max() > HORIZON:
            step = (table.stamp_ns[place] - table.stamp_ns[place + 1]) * 1e-9
            raise LogError(
                f"{self._path}: time goes backwards by {step:.6g} s behind stamp {table.stamp_ns[place]} ns, "
                "and not for a few late samples only; split the file where its clock starts again"
            )
        self.late += int(np.count_nonzero(moved > 0))
        return table.take(order)

    def _report(self) -> list[Notice]:
        found = []
        if self.late:
            found.append(Notice("UNSORTED_STAMPS", f"{counted(self.late, 'sample')} came late, now in order"))
        if self.repeated:
            found.append(
                Notice(
                    "DUPLICATE_STAMPS",
                    f"{counted(self.repeated, 'sample repeats', 'samples repeat')} a stamp; the first of each was kept",
                )
            )
        return found
