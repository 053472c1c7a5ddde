"""Signals of several topics on one time base: that of the main topic, the others interpolated to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.log import IntArray, Notice
from algid.readers.table import SampleTable
from algid.words import counted

_GAP = 3.0
"""Samples of the other topic this many of its periods apart are not interpolated between."""


@dataclass(frozen=True, eq=False)
class Series:
    """A topic read as a whole: sorted stamps (M,) and its channels (M,)."""

    topic: str
    table: SampleTable

    @property
    def period(self) -> float:
        """Median time between samples in ns."""
        return float(np.median(np.diff(self.table.stamp_ns))) if len(self.table) > 1 else 0.0

    def covers(self, stamps: IntArray) -> NDArray[np.bool_]:
        """Which of the stamps (N,) lie between two samples that are not far apart."""
        own = self.table.stamp_ns
        if own.size < 2:
            return np.zeros(stamps.size, np.bool_)
        after = np.clip(np.searchsorted(own, stamps, side="left"), 1, own.size - 1)
        near = own[after] - own[after - 1] <= _GAP * self.period
        return near & (stamps >= own[0]) & (stamps <= own[-1])

    def at(self, stamps: IntArray) -> dict[str, FloatArray]:
        """The channels at the stamps (N,), linear between samples."""
        start = self.table.stamp_ns[0]
        own, wanted = (self.table.stamp_ns - start).astype(np.float64), (stamps - start).astype(np.float64)
        return {name: np.interp(wanted, own, values) for name, values in self.table.columns.items()}

    def error(self) -> str:
        """What linear interpolation costs: an eighth of the second differences, root mean square."""
        told = []
        for name, values in self.table.columns.items():
            bend = np.diff(values, 2) / 8
            told.append(f"{name} {float(np.sqrt(np.mean(bend**2))) if bend.size else 0.0:.2g}")
        return ", ".join(told)


def aligned(main: Iterator[SampleTable], others: Sequence[Series]) -> Iterator[SampleTable]:
    """The main topic's tables with the other topics' channels, where all cover it.

    The last table tells how many were dropped and what the interpolation costs, in the log's own units.
    """
    lost, held = 0, None
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
            if len(kept):
                columns |= other.at(kept.stamp_ns)
        held = SampleTable(kept.stamp_ns, columns, kept.notices)
    if held is not None:
        yield held.noting(*_told(others, lost))


def _told(others: Sequence[Series], lost: int) -> list[Notice]:
    said = [
        Notice(
            "ALIGNED",
            f"{other.topic!r} ({1e9 / other.period if other.period else 0:.6g} Hz) was interpolated; "
            f"error, root mean square, in the log's units: {other.error()}",
        )
        for other in others
    ]
    if lost:
        text = f"{counted(lost, 'sample was', 'samples were')} dropped, where another topic has none"
        said.append(Notice("NOT_COVERED", text, lossy=True))
    return [*said, *(notice for other in others for notice in other.table.notices)]
