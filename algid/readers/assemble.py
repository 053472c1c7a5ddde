"""From a format's tables to blocks of a log: the part that every reader shares."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.errors import LogError
from algid.log import Log, Notice, Origin
from algid.readers.base import BLOCK_ROWS
from algid.readers.convert import Conversion
from algid.readers.order import Sorter
from algid.readers.table import Table, cut

_LARGEST = 1e100
"""Beyond this a value is no angle and no torque, and its square would overflow."""


@dataclass(frozen=True, eq=False)
class TableReader:
    """A `Reader` over any format that yields tables of at most so many rows."""

    origin: Origin
    tables: Callable[[int], Iterator[Table]]
    conversion: Conversion
    unwrap: tuple[bool, bool] = (False, False)
    notices: tuple[Notice, ...] = ()
    rows: int = 0
    """Samples to expect, 0 where the file does not tell."""

    def blocks(self, rows: int = BLOCK_ROWS) -> Iterator[Log]:
        """Blocks of at most `rows` samples: see `algid.readers.base.Reader`.

        Raises
        ------
        LogError
            If a value is not finite, time runs wrong, or there are fewer than two samples.
        """
        tables = self._finite(self.tables(rows))
        notices, total, turns = self.notices, 0, np.array([[math.nan, 0.0]] * 2)
        for table in cut(Sorter(self.origin.path).run(tables), rows):
            notices += table.notices
            if not len(table):
                continue
            theta, tau, omega = self.conversion.apply(table)
            turns = self._unwrapped(theta, turns)
            total += len(table)
            yield Log(table.stamp_ns, theta, tau, self.origin, omega, notices)
            notices = ()
        if total < 2:
            why = "".join(f" ({notice.text})" for notice in notices[:1])
            raise LogError(f"{self.origin.path}: {total} samples; a log needs two at least{why}")

    def _finite(self, tables: Iterator[Table]) -> Iterator[Table]:
        first = 0
        for table in tables:
            for name, values in table.columns.items():
                self._check(name, values, first)
            first += len(table)
            yield table

    def _check(self, name: str, values: FloatArray, first: int) -> None:
        # min and max are NaN when any value is, and need no array of their own
        if values.size and not (values.min() > -_LARGEST and values.max() < _LARGEST):
            row = int(np.flatnonzero(~(np.abs(values) < _LARGEST))[0])
            source = self.origin.mapping.get(name, name)
            raise LogError(
                f"{self.origin.path}: {name} ({source}) in sample {first + row + 1}: "
                f"expected a finite number below {_LARGEST:g} in size, found {values[row]}; "
                "cut that part out or name another source"
            )

    def _unwrapped(self, theta: FloatArray, before: FloatArray) -> FloatArray:
        """Unwrap in place where a profile says so; keeps each joint's last angle and turns so far."""
        after = before.copy()
        for joint in (0, 1):
            if self.unwrap[joint] and theta.shape[1]:
                last, turns = before[joint]
                start = theta[joint, 0] if math.isnan(last) else last
                raw = np.concatenate([[start], theta[joint]])
                whole = turns - np.cumsum(np.rint(np.diff(raw) / (2 * math.pi)))
                after[joint] = raw[-1], whole[-1]
                theta[joint] += 2 * math.pi * whole
        return after
