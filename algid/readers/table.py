"""Samples as a file holds them: named channels in the file's own units, not yet converted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.blocks import concatenated, rows_of
from algid.log import IntArray

JOINT_CHANNELS = ("theta1", "theta2", "tau1", "tau2")
VELOCITIES = ("omega1", "omega2")
REFERENCES = ("q_des1", "q_des2")
CHANNELS = JOINT_CHANNELS + VELOCITIES + REFERENCES


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Successive samples: stamps (N,) in ns, channels (N,) by canonical name, file's units."""

    stamp_ns: IntArray
    columns: Mapping[str, FloatArray]

    def __len__(self) -> int:
        return int(self.stamp_ns.size)

    def part(self, first: int, last: int) -> SampleTable:
        """Rows `first` to `last` - 1 as views."""
        return self.take(slice(first, last))

    def take(self, rows: slice | IntArray | NDArray[np.bool_]) -> SampleTable:
        """The rows of a slice, an index or a mask."""
        return SampleTable(self.stamp_ns[rows], rows_of(self.columns, rows))

    def only(self, mask: NDArray[np.bool_]) -> SampleTable:
        """The rows of a mask: the table itself where that is all of them."""
        return self if mask.all() else self.take(mask)


def stack(tables: Sequence[SampleTable]) -> SampleTable:
    """One table out of several with the same channels, in their order."""
    if len(tables) == 1:
        return tables[0]
    stamps = np.concatenate([table.stamp_ns for table in tables])
    return SampleTable(stamps, concatenated([table.columns for table in tables]))


def cut(tables: Iterator[SampleTable], rows: int) -> Iterator[SampleTable]:
    """The same samples in tables of at most `rows` rows, none of which is empty."""
    for table in tables:
        for first in range(0, len(table), rows):
            yield table.part(first, min(first + rows, len(table)))


def in_pairs(sources: Mapping[str, str], velocity: str | None) -> dict[str, str]:
    """Sources by channel; velocities and references of both joints where they are read, or none."""
    gone = set[str]()
    for pair in (VELOCITIES, REFERENCES):
        if not sources.keys() >= set(pair) or (pair is VELOCITIES and velocity == "observer"):
            gone |= set(pair)
    return {name: one for name, one in sources.items() if name not in gone}


BLOCK_ROWS = 1 << 18
ROWS = 1 << 16
"""Rows a table: few enough to stay in a core's cache between decoding and copying."""
