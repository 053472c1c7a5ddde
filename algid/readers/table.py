"""Samples as a file holds them: named channels in the file's own units, not yet converted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.blocks import concatenated, rows_of
from algid.log import IntArray
from algid.notices import Notice

JOINT_CHANNELS = ("theta1", "theta2", "tau1", "tau2")
VELOCITIES = ("omega1", "omega2")
REFERENCES = ("q_des1", "q_des2")
CHANNELS = JOINT_CHANNELS + VELOCITIES + REFERENCES
Source = TypeVar("Source")


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Successive samples: stamps (N,) in ns, channels (N,) by canonical name, file's units."""

    stamp_ns: IntArray
    columns: Mapping[str, FloatArray]
    notices: tuple[Notice, ...] = ()

    def __len__(self) -> int:
        return int(self.stamp_ns.size)

    def part(self, first: int, last: int) -> SampleTable:
        """Rows `first` to `last` - 1 as views; the notices stay with the first part."""
        columns = rows_of(self.columns, slice(first, last))
        return SampleTable(self.stamp_ns[first:last], columns, self.notices if first == 0 else ())

    def take(self, rows: IntArray | NDArray[np.bool_]) -> SampleTable:
        """The rows of an index or mask, with all notices."""
        return SampleTable(self.stamp_ns[rows], rows_of(self.columns, rows), self.notices)

    def only(self, mask: NDArray[np.bool_]) -> SampleTable:
        """The rows of a mask, with all notices: the table itself where that is all of them."""
        return self if mask.all() else self.take(mask)

    def noting(self, *notices: Notice) -> SampleTable:
        """The table with more notices."""
        return replace(self, notices=(*self.notices, *notices))


def remark(*notices: Notice) -> SampleTable:
    """A table of no samples, that only tells something: a pass ends with what it has counted."""
    return SampleTable(np.empty(0, np.int64), {}, notices)


def stack(tables: Sequence[SampleTable]) -> SampleTable:
    """One table out of several with the same channels, in their order."""
    notices = tuple(notice for table in tables for notice in table.notices)
    filled = [table for table in tables if len(table)] or list(tables[:1])
    if len(filled) == 1:
        return SampleTable(filled[0].stamp_ns, filled[0].columns, notices)
    stamps = np.concatenate([table.stamp_ns for table in filled])
    return SampleTable(stamps, concatenated([table.columns for table in filled]), notices)


def cut(tables: Iterator[SampleTable], rows: int) -> Iterator[SampleTable]:
    """The same samples in tables of at most `rows` rows."""
    for table in tables:
        for first in range(0, max(1, len(table)), rows):
            yield table.part(first, min(first + rows, len(table)))


def in_pairs(sources: Mapping[str, Source], velocity: str | None) -> dict[str, Source]:
    """Sources by channel; velocities and references of both joints where they are read, or none."""
    gone = set[str]()
    for pair in (VELOCITIES, REFERENCES):
        if not sources.keys() >= set(pair) or (pair is VELOCITIES and velocity == "observer"):
            gone |= set(pair)
    return {name: one for name, one in sources.items() if name not in gone}


BLOCK_ROWS = 1 << 18
