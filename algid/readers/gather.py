"""Arrays for a whole log: tables are converted straight into them, so that each sample is copied once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.log import IntArray

ROWS = 1 << 16
"""Rows a block: small enough to stay in a core's cache between decoding and copying."""
_MOST_AT_ONCE = 1 << 26
"""Rows to reserve on a file's word alone."""


@dataclass(frozen=True, eq=False)
class Room:
    """Samples to be filled in: stamps (N,) in ns; angles, torques and, where recorded, velocities (2, N)."""

    stamp_ns: IntArray
    theta: FloatArray
    tau: FloatArray
    omega: FloatArray | None

    @classmethod
    def empty(cls, rows: int, *, velocity: bool) -> Room:
        """Room for `rows` samples in one piece of memory, which the system hands out in large pages."""
        signals = np.empty((7 if velocity else 5, rows))
        stamps = signals[-1].view(np.int64)
        return cls(stamps, signals[0:2], signals[2:4], signals[4:6] if velocity else None)

    def __len__(self) -> int:
        return int(self.stamp_ns.size)

    def part(self, first: int, last: int) -> Room:
        """Samples `first` to `last` - 1 as views."""
        omega = None if self.omega is None else self.omega[:, first:last]
        return Room(self.stamp_ns[first:last], self.theta[:, first:last], self.tau[:, first:last], omega)


class Gatherer:
    """Room that grows by samples. Reserved memory costs nothing until it is written.

    Parameters
    ----------
    rows : int
        How many samples to expect; 0 where nobody knows. A wrong number costs time, nothing else.
    velocity : bool
    """

    def __init__(self, rows: int, *, velocity: bool) -> None:
        self._room = Room.empty(min(rows, _MOST_AT_ONCE), velocity=velocity)
        self._used = 0

    def more(self, rows: int) -> Room:
        """Room for the next `rows` samples."""
        first, self._used = self._used, self._used + rows
        if self._used > len(self._room):
            self._grow(first)
        return self._room.part(first, self._used)

    def _grow(self, filled: int) -> None:
        old = self._room.part(0, filled)
        self._room = Room.empty(max(self._used, 2 * len(self._room)), velocity=old.omega is not None)
        new = self._room.part(0, filled)
        new.stamp_ns[:], new.theta[:], new.tau[:] = old.stamp_ns, old.theta, old.tau
        if old.omega is not None and new.omega is not None:
            new.omega[:] = old.omega

    def filled(self) -> Room:
        """All samples so far."""
        return self._room.part(0, self._used)
