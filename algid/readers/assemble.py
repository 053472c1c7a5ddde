"""From a format's tables to blocks of a log: the part that every reader shares."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
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
from algid.readers.convert import ROWS, Conversion, GrowingBuffer, channel_readings, laws_of
from algid.readers.stated import other_rate, settings_unused, stated_rate, unused
from algid.readers.table import BLOCK_ROWS, REFERENCES, SampleTable, cut, stack

if TYPE_CHECKING:
    from algid.profile import Profile

_Noted = tuple[SampleTable, tuple[Notice, ...]]
"""A table, and what is to be said of it."""
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
        buffer: GrowingBuffer | None = None
        notices, samples = self._of_passive(self._samples(min(ROWS, most)))
        for table, said in samples:
            if buffer is not None and len(buffer) + len(table) > most:
                yield self._log(buffer, notices)
                buffer, notices = None, ()
            if buffer is None:
                buffer = GrowingBuffer(
                    min(most, self.rows or len(table)),
                    velocity=table.has_velocities,
                    reference=table.has_references,
                )
            room = buffer.more(len(table))
            room.stamp_ns[:] = table.stamp_ns
            self.conversion.apply(table, room)
            unwrapper.run(room.theta)
            if room.reference is not None:
                unwrapper.follow(room.reference, room.theta)
            notices += said
        if buffer is not None:
            yield self._log(buffer, notices)

    def _log(self, buffer: GrowingBuffer, notices: tuple[Notice, ...]) -> Log:
        room = buffer.filled()
        return Log(
            room.stamp_ns,
            room.theta,
            room.tau,
            self.origin,
            room.omega,
            notices,
            room.reference,
        )

    def _samples(self, rows: int) -> Iterator[_Noted]:
        """Checked and sorted tables that are not empty, with what is to be said of each."""
        notices, total = self.notices, 0
        held: _Noted | None = None
        path, segment = self.origin.path, self.origin.reading.segment
        ordered = in_order(path, self.tables(rows), segment, runs=True)
        for table in cut(self._finite(self._within(ordered)), rows):
            if total < 2 <= len(table):
                notices += other_rate(self.stated_rate, table.stamp_ns)
            notices += table.notices
            if len(table):
                if held is not None:
                    yield held
                total += len(table)
                held, notices = (table, notices), ()
        if total < 2:
            said = held[1] + notices if held else notices
            worst = min(said, key=lambda notice: not notice.lossy, default=None)
            why = "" if worst is None else f" ({worst.text})"
            raise LogError(
                f"{self.origin.path}: {counted(total, 'sample')}; a log needs two at least{why}"
            )
        if held is not None:  # what the last tables tell, also where they are empty
            yield held[0], held[1] + notices

    def _within(self, tables: Iterator[SampleTable]) -> Iterator[SampleTable]:
        """The rows between the `start` and the `end` that the reading says.

        The last table tells of the cut.
        """
        start, end = self.origin.reading.start, self.origin.reading.end
        if start is None and end is None:
            yield from tables
            return
        first_ns, left_out = None, 0
        held: SampleTable | None = None
        for table in tables:
            if held is not None:
                yield held
            if first_ns is None and len(table):
                first_ns = int(table.stamp_ns[0])
            since = table.stamp_ns - (first_ns or 0)
            inside = (since >= 1e9 * (start or 0.0)) & (
                since <= 1e9 * (math.inf if end is None else end)
            )
            left_out += len(table) - int(np.count_nonzero(inside))
            held = table.take(inside)
        if held is not None:
            last = "the end" if end is None else f"{end:g} s"
            numbers = {"count": left_out, "start": start or 0.0, "end": last}
            yield held.noting(Notice("CUT", numbers=numbers))

    def _finite(self, tables: Iterator[SampleTable]) -> Iterator[SampleTable]:
        """Tables of finite numbers.

        Where a user accepts others, their rows are left out and counted.
        """
        first, dropped = 0, 0
        held: SampleTable | None = None
        for table in tables:
            if held is not None:
                yield held
            held = table
            if "NOT_FINITE" in self.origin.reading.accepted:
                good = np.ones(len(table), np.bool_)
                for values in self._measured(table).values():
                    good &= np.abs(values) < LIMITS.largest_value
                dropped += len(table) - int(np.count_nonzero(good))
                held = table.take(good)
            else:
                for name, values in self._measured(table).items():
                    self._check(name, values, first)
            first += len(table)
        if held is not None and dropped:
            held = held.noting(Notice("NOT_FINITE", numbers={"case": "number", "count": dropped}))
        if held is not None:
            yield held

    def _measured(self, table: SampleTable) -> Mapping[str, FloatArray]:
        """The columns of a table without the torque of a joint that has no motor, and references.

        Nobody need follow a reference all the time.
        """
        without = (f"tau{self.origin.reading.passive}", *REFERENCES)
        return {name: values for name, values in table.columns.items() if name not in without}

    def _of_passive(self, samples: Iterator[_Noted]) -> tuple[tuple[Notice, ...], Iterator[_Noted]]:
        """Notice of a torque in the column of a joint that is called passive, and all samples.

        The first `ROWS` samples show it.
        """
        passive, mapping = self.origin.reading.passive, self.origin.mapping
        names = f"tau{passive}", f"tau{3 - (passive or 1)}"
        if passive is None or not set(names) <= set(mapping):
            return (), samples
        looked_at: list[_Noted] = []
        for noted in samples:
            looked_at.append(noted)
            if sum(len(table) for table, _ in looked_at) >= ROWS:
                break
        samples = chain(looked_at, samples)
        begin = stack([table for table, _ in looked_at])
        own, other = begin.columns.get(names[0]), begin.columns.get(names[1])
        if own is None or other is None or mapping[names[0]] == mapping[names[1]]:
            return (), samples
        size, driving = _rms(own), _rms(other)
        if not (np.isfinite(size) and size > PASSIVE_TORQUE * driving > 0):
            return (), samples
        numbers = {
            "column": mapping[names[0]],
            "joint": passive,
            "percent": 100 * size / driving,
        }
        return (Notice("PASSIVE_TORQUE", numbers=numbers),), samples

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


def _rms(values: FloatArray) -> float:
    with np.errstate(over="ignore"):  # without a motor a torque may be anything
        return float(np.sqrt(np.mean(np.square(values))))


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

    def run(self, theta: FloatArray) -> None:
        """Unwrap the next angles (2, N), rad, in place."""
        for joint in (0, 1):
            if self._joints[joint] and theta.shape[1]:
                start = theta[joint, 0] if math.isnan(self._last[joint]) else self._last[joint]
                raw = np.concatenate([[start], theta[joint]])
                turns = self._turns[joint] - np.cumsum(np.rint(np.diff(raw) / _TURN))
                self._last[joint], self._turns[joint] = raw[-1], turns[-1]
                theta[joint] += _TURN * turns

    def follow(self, reference: FloatArray, theta: FloatArray) -> None:
        """Bring references (2, N) within half a turn of the unwrapped angles, in place."""
        for joint in (0, 1):
            if self._joints[joint]:
                reference[joint] += _TURN * np.rint((theta[joint] - reference[joint]) / _TURN)
