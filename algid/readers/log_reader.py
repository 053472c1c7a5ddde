"""From a format's tables to blocks of a log: the part that every reader shares."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.base.faults import during
from algid.base.limits import LIMITS
from algid.base.text import counted
from algid.log import IntArray, Log, Origin
from algid.notices import Notice, Remedy
from algid.readers.annotations import other_rate
from algid.readers.clock import in_order
from algid.readers.convert import Law, convert
from algid.readers.table import BLOCK_ROWS, REFERENCES, ROWS, SampleTable, cut

QUANTITIES = ("theta", "tau", "omega", "q_des")
PASSIVE_TORQUE = 0.01
"""Of the other joint's: more than what a torque's noise makes of a joint without a motor."""


@dataclass(frozen=True, eq=False)
class TableReader:
    """An opened log of any format.

    What it is stands in `origin` at once; its samples come in blocks, in time order.

    `tables` gives a fresh pass, and adds to a list what it finds to be said. Stamps strictly
    increase within and across blocks; a block's notices are those found while reading it. Memory
    is bounded by the block's size wherever the format allows it.
    """

    origin: Origin
    tables: Callable[[list[Notice]], Iterator[SampleTable]]
    notices: tuple[Notice, ...] = ()
    rows: int = 0
    """Samples to expect, 0 where the file does not tell."""
    stated_rate: float | None = None
    """Samples a second, as the file states them beside its stamps."""
    laws: tuple[Law, ...] = (None, None)
    """Of joints whose torque a controller makes."""

    def blocks(self, rows: int = BLOCK_ROWS) -> Iterator[Log]:
        """Blocks of at most `rows` samples.

        Raises
        ------
        LogError
            If a value is not finite, time runs wrong, or there are fewer than two samples.
        """
        blocks = self._gathered(rows)
        while True:
            with during("reading", self.origin.path):
                log = next(blocks, None)
            if log is None:
                return
            yield log

    def whole(self) -> Log:
        """The whole log.

        Raises
        ------
        LogError
            As `blocks`.
        """
        (log,) = self.blocks(sys.maxsize)
        return log

    def _gathered(self, most: int) -> Iterator[Log]:
        """Logs of at most `most` samples, each converted from small tables into its arrays."""
        origin, last = self.origin, [math.nan, math.nan]
        # stamps and signals of one log in one piece, which costs nothing until it is written
        room, recorded = np.empty((0, 0), np.int64), list[str]()
        told, total, used = list(self.notices), 0, 0

        def parts(first: int = 0) -> tuple[IntArray, dict[str, FloatArray]]:
            part = room[:, first:used]
            pairs = part[1:].view(np.float64).reshape(len(recorded), 2, -1)
            return part[0], dict(zip(recorded, pairs, strict=True))

        def log() -> Log:
            stamps, one = parts()
            omega, reference = one.get("omega"), one.get("q_des")
            return Log(stamps, one["theta"], one["tau"], origin, omega, tuple(told), reference)

        segment = origin.reading.segment
        ordered = in_order(self.tables(told), told, segment, runs=True)
        for table in cut(self._usable(ordered, told), min(ROWS, most)):
            first = used
            if used and used + len(table) > most:
                yield log()
                first = 0
                told.clear()
            if total < 2 <= len(table):
                told += other_rate(self.stated_rate, table.stamp_ns)
            if not total:
                told += self._of_passive(table)
            used = first + len(table)
            if not first:
                recorded = [name for name in QUANTITIES if f"{name}1" in table.columns]
                rows = max(used, min(most, self.rows, LIMITS.reserved_rows))
                room = np.empty((1 + 2 * len(recorded), rows), np.int64)
            elif used > room.shape[1]:
                larger = np.empty((len(room), max(used, 2 * room.shape[1])), np.int64)
                larger[:, :first] = room[:, :first]
                room = larger  # the smaller one goes at once
            stamps, signals = parts(first)
            stamps[:] = table.stamp_ns
            convert(table, signals, origin.reading, self.laws)
            for joint in np.flatnonzero(origin.reading.unwrap):
                last[joint] = unwrap(signals["theta"][joint], last[joint])
                if "q_des" in signals:  # follows within half a turn
                    away = signals["theta"][joint] - signals["q_des"][joint]
                    signals["q_des"][joint] += _TURN * np.rint(away / _TURN)
            total += len(table)
        if total < 2:
            worst = min(told, key=lambda notice: not notice.lossy, default=None)
            why = "" if worst is None else f" ({worst.text})"
            raise LogError(f"{counted(total, 'sample')}; a log needs two at least{why}")
        yield log()

    def _usable(self, tables: Iterator[SampleTable], told: list[Notice]) -> Iterator[SampleTable]:
        """The rows from `start` to `end` of the reading, whose numbers are finite.

        Where a user accepts others, their rows are left out and counted.

        Raises
        ------
        LogError
            If one is not finite, and the user accepts none.
        """
        reading, mapping = self.origin.reading, self.origin.mapping
        start, end = reading.start or 0.0, math.inf if reading.end is None else reading.end
        # a joint without a motor has no torque, and nobody need follow a reference always
        unchecked = (f"tau{reading.passive}", *REFERENCES)
        begin_ns: int | None = None
        outside = dropped = done = 0
        for table in tables:
            begin_ns = int(table.stamp_ns[0]) if begin_ns is None else begin_ns
            if (start, end) != (0.0, math.inf):
                since = table.stamp_ns - begin_ns
                inside = (since >= 1e9 * start) & (since <= 1e9 * end)
                rows = len(table)
                table = table.only(inside)
                outside += rows - len(table)
            good = np.ones(len(table), np.bool_)
            for name, values in table.columns.items():
                # a small sum of squares, which needs no array of its own, has no large term
                if name in unchecked or np.einsum("i,i->", values, values) < LIMITS.largest_value:
                    continue
                good &= np.abs(values) < LIMITS.largest_value
                if not (good.all() or "NOT_FINITE" in reading.accepted):
                    row = int(np.argmin(good))
                    out = Remedy({"start": None, "end": None}, "cut that part out")
                    accept = Remedy({"accept": "NOT_FINITE"}, "or leave such samples out")
                    raise LogError(
                        f"{name} ({mapping.get(name, name)}) in sample "
                        f"{done + row + 1}: expected a finite number below "
                        f"{LIMITS.largest_value:g} in size, found {values[row]}; {out}; {accept}"
                    )
            done += len(table)
            kept = table.only(good)
            dropped += len(table) - len(kept)
            yield kept
        if not (reading.start is None and reading.end is None):
            until = "the end" if reading.end is None else f"{end:g} s"
            told.append(Notice("CUT", numbers={"count": outside, "start": start, "end": until}))
        if dropped:
            told.append(Notice("NOT_FINITE", numbers={"case": "number", "count": dropped}))

    def _of_passive(self, begin: SampleTable) -> tuple[Notice, ...]:
        """What to say of a torque in the column of a joint that is called passive."""
        passive, mapping = self.origin.reading.passive, self.origin.mapping
        own, other = f"tau{passive}", f"tau{3 - (passive or 1)}"
        if own not in begin.columns or mapping[own] == mapping[other]:
            return ()
        with np.errstate(all="ignore"):  # without a motor a torque may be anything
            size = np.linalg.norm(begin.columns[own])
            share = float(size / np.linalg.norm(begin.columns[other]))
        if not PASSIVE_TORQUE < share < math.inf:
            return ()
        numbers = {"column": mapping[own], "joint": passive, "percent": 100 * share}
        return (Notice("PASSIVE_TORQUE", numbers=numbers),)


_TURN = 2 * math.pi


def unwrap(angle: FloatArray, last: float) -> float:
    """Add whole turns in place where an angle (N,) in rad jumps, from the `last` one or NaN on.

    Returns
    -------
    float
        The last angle.
    """
    if not angle.size:
        return last
    before = np.concatenate([[angle[0] if math.isnan(last) else last], angle])
    angle -= _TURN * np.cumsum(np.rint(np.diff(before) / _TURN))
    return float(angle[-1])
