"""From a format's tables to blocks of a log: the part that every reader shares."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.base.faults import during
from algid.base.limits import LIMITS
from algid.base.words import counted
from algid.log import ZEROS, Log, Origin
from algid.notices import Notice, Remedy
from algid.readers.clock import in_order
from algid.readers.convert import (
    QUANTITIES,
    ROWS,
    Conversion,
    SampleBuffer,
    channel_readings,
    laws_of,
)
from algid.readers.stated import other_rate, settings_unused, stated_rate, unused
from algid.readers.table import BLOCK_ROWS, REFERENCES, SampleTable, cut, remark

if TYPE_CHECKING:
    from algid.profile import Profile

PASSIVE_TORQUE = 0.01
"""Of the other joint's: more than what a torque's noise makes of a joint without a motor."""


@dataclass(frozen=True, eq=False)
class TableReader:
    """An opened log of any format.

    What it is stands in `origin` at once; its samples come in blocks, in time order.

    `tables` gives a fresh pass in tables of at most so many rows. Stamps strictly increase within
    and across blocks; a block's notices are those found while reading it. Memory is bounded by the
    block's size wherever the format allows it.
    """

    origin: Origin
    tables: Callable[[int], Iterator[SampleTable]]
    conversion: Conversion
    notices: tuple[Notice, ...] = ()
    rows: int = 0
    """Samples to expect, 0 where the file does not tell."""
    stated_rate: float | None = None
    """Samples a second, as the file states them beside its stamps."""

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
        with during("reading", self.origin.path):
            (log,) = self._gathered(sys.maxsize)
        return log

    def _gathered(self, most: int) -> Iterator[Log]:
        """Logs of at most `most` samples, each converted from small tables into its arrays."""
        unwrapper = Unwrapper(self.origin.reading.unwrap)
        buffer: SampleBuffer | None = None
        notices, total = self.notices, 0
        ordered = in_order(
            self.origin.path, self.tables(ROWS), self.origin.reading.segment, runs=True
        )
        for table in cut(self._usable(ordered), min(ROWS, most)):
            if not len(table):
                notices += table.notices
                continue
            if buffer is not None and buffer.used + len(table) > most:
                yield self._log(buffer, notices)
                buffer, notices = None, ()
            if total < 2 <= len(table):
                notices += other_rate(self.stated_rate, table.stamp_ns)
            if not total:
                notices += self._of_passive(table)
            if buffer is None:
                recorded = [name for name in QUANTITIES if f"{name}1" in table.columns]
                buffer = SampleBuffer(min(most, self.rows or len(table)), recorded)
            stamps, signals = buffer.more(len(table))
            stamps[:] = table.stamp_ns
            self.conversion.apply(table, signals)
            unwrapper.run(signals["theta"], signals.get("q_des"))
            notices += table.notices
            total += len(table)
        if total < 2:
            worst = min(notices, key=lambda notice: not notice.lossy, default=None)
            why = "" if worst is None else f" ({worst.text})"
            raise LogError(
                f"{self.origin.path}: {counted(total, 'sample')}; a log needs two at least{why}"
            )
        if buffer is not None:
            yield self._log(buffer, notices)

    def _log(self, buffer: SampleBuffer, notices: tuple[Notice, ...]) -> Log:
        stamps, signals = buffer.filled()
        theta, tau = signals["theta"], signals["tau"]
        omega, reference = signals.get("omega"), signals.get("q_des")
        return Log(stamps, theta, tau, self.origin, omega, notices, reference)

    def _usable(self, tables: Iterator[SampleTable]) -> Iterator[SampleTable]:
        """The rows from `start` to `end` of the reading, whose numbers are finite.

        Where a user accepts others, their rows are left out and counted.
        """
        reading = self.origin.reading
        start, end = reading.start or 0.0, math.inf if reading.end is None else reading.end
        whole, accepted = (start, end) == (0.0, math.inf), "NOT_FINITE" in reading.accepted
        begin_ns: int | None = None
        outside = dropped = done = 0
        for table in tables:
            if not len(table):
                yield table
                continue
            begin_ns = int(table.stamp_ns[0]) if begin_ns is None else begin_ns
            if not whole:
                since = table.stamp_ns - begin_ns
                inside = (since >= 1e9 * start) & (since <= 1e9 * end)
                outside += len(table) - int(np.count_nonzero(inside))
                table = table.take(inside)
            good = np.ones(len(table), np.bool_)
            for name, values in table.columns.items():
                # a joint without a motor has no torque, and nobody need follow a reference always
                if name in (f"tau{reading.passive}", *REFERENCES):
                    continue
                if accepted:
                    good &= np.abs(values) < LIMITS.largest_value
                else:
                    self._check(name, values, done)
            done += len(table)
            dropped += len(table) - int(np.count_nonzero(good))
            yield table if good.all() else table.take(good)
        if not (reading.start is None and reading.end is None):
            last = "the end" if reading.end is None else f"{end:g} s"
            yield remark(Notice("CUT", numbers={"count": outside, "start": start, "end": last}))
        if dropped:
            yield remark(Notice("NOT_FINITE", numbers={"case": "number", "count": dropped}))

    def _of_passive(self, begin: SampleTable) -> tuple[Notice, ...]:
        """What to say of a torque in the column of a joint that is called passive."""
        passive, mapping = self.origin.reading.passive, self.origin.mapping
        names = f"tau{passive}", f"tau{3 - (passive or 1)}"
        if not set(names) <= begin.columns.keys() or mapping[names[0]] == mapping[names[1]]:
            return ()
        with np.errstate(over="ignore"):  # without a motor a torque may be anything
            own, other = (np.sqrt(np.mean(np.square(begin.columns[name]))) for name in names)
        if not (np.isfinite(own) and own > PASSIVE_TORQUE * other > 0):
            return ()
        share = 100 * float(own / other)
        numbers = {"column": mapping[names[0]], "joint": passive, "percent": share}
        return (Notice("PASSIVE_TORQUE", numbers=numbers),)

    def _check(self, name: str, values: FloatArray, first: int) -> None:
        # one pass without an array of its own: a small sum of squares has no large term, and no NaN
        if np.einsum("i,i->", values, values) < LIMITS.largest_value:
            return
        wrong = np.flatnonzero(~(np.abs(values) < LIMITS.largest_value))
        if wrong.size:
            row = int(wrong[0])
            source = self.origin.mapping.get(name, name)
            cut = Remedy({"start": None, "end": None}, "cut that part out")
            accept = Remedy({"accept": "NOT_FINITE"}, "or leave such samples out")
            raise LogError(
                f"{self.origin.path}: {name} ({source}) in sample {first + row + 1}: "
                f"expected a finite number below {LIMITS.largest_value:g} in size, found "
                f"{values[row]}; "
                f"{cut}; {accept}"
            )


def make_reader(
    origin: Origin,
    tables: Callable[[int], Iterator[SampleTable]],
    profile: Profile | None,
    stated: Mapping[str, str],
    notices: tuple[Notice, ...] = (),
    rows: int = 0,
    said: Sequence[str] = (),
) -> TableReader:
    """A reader of `tables` as a profile says.

    Parameters
    ----------
    origin : Origin
        Its reading holds what the format's reader has decided: joints, topics, clock, unit of time.
    tables : callable
        Gives tables of at most so many rows.
    profile : Profile, optional
    stated : mapping
        By canonical channel the unit that the file's own names state.
    notices, rows : as of `TableReader`
    said : sequence of str
        What the file states in words.

    Raises
    ------
    LogError
        If a torque is in amperes without a torque constant, or an angle in counts without counts a
        turn.
    """
    if profile is None:
        from algid.profile import Profile

        profile = Profile()
    channels = channel_readings(origin.path, origin.mapping, profile, stated)
    reading = replace(
        origin.reading,
        channels=channels,
        zero=profile.zero,
        second_angle=profile.second_angle,
        drive=profile.drive,
        passive=profile.passive,
        signs=profile.signs,
        offsets=profile.offsets,
        unwrap=(profile.theta1.unwrap, profile.theta2.unwrap),
        start=profile.start,
        end=profile.end,
        segment=profile.segment,
        accepted=profile.accept,
    )
    units = Conversion(
        channels,
        zero=ZEROS[profile.zero],
        absolute=profile.second_angle == "absolute",
        base=profile.drive == "base",
        passive=profile.passive,
        laws=laws_of(origin.path, profile),
    )
    notices += tuple(unused(said, reading, profile))
    notices += tuple(settings_unused(profile, reading, origin.mapping))
    origin = replace(origin, reading=reading)
    return TableReader(origin, tables, units, notices, rows, stated_rate(said))


_TURN = 2 * math.pi


class Unwrapper:
    """Adds whole turns where an angle jumps, for the joints that a profile says so of."""

    def __init__(self, joints: tuple[bool, bool]) -> None:
        self._joints = joints
        self._last = [math.nan, math.nan]  # each joint's last angle as recorded
        self._turns = [0.0, 0.0]

    def run(self, theta: FloatArray, reference: FloatArray | None = None) -> None:
        """Unwrap the next angles (2, N), rad, in place; references follow within half a turn."""
        for joint in np.flatnonzero(self._joints):
            if theta.shape[1]:
                start = theta[joint, 0] if math.isnan(self._last[joint]) else self._last[joint]
                raw = np.concatenate([[start], theta[joint]])
                turns = self._turns[joint] - np.cumsum(np.rint(np.diff(raw) / _TURN))
                self._last[joint], self._turns[joint] = raw[-1], turns[-1]
                theta[joint] += _TURN * turns
            if reference is not None:
                reference[joint] += _TURN * np.rint((theta[joint] - reference[joint]) / _TURN)
