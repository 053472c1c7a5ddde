"""Arrays for a log or a block of it: tables are converted straight into them, so that each sample is copied once.

From a file's units, signs and zero to algid's: rad, N m, θ1 from the horizontal, θ2 from link 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.errors import LogError
from algid.log import IntArray
from algid.readers.table import JOINT_CHANNELS, VELOCITIES, Table

ROWS = 1 << 16
"""Rows a table: few enough to stay in a core's cache between decoding and copying."""
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

    def __len__(self) -> int:
        return self._used

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


if TYPE_CHECKING:
    from algid.profile import Profile

_TURN = 2 * math.pi
_ANGLE = {"rad": 1.0, "deg": math.pi / 180, "rev": _TURN, "rpm": _TURN / 60}
_TORQUE = {"N m": 1.0, "mN m": 1e-3}
_CURRENT = {"A": 1.0, "mA": 1e-3}


@dataclass(frozen=True)
class Conversion:
    """Value · factor + offset for each channel of a table, then the zero and the reference of the angles."""

    factors: Mapping[str, float]
    offsets: Mapping[str, float]
    hanging: bool = False
    absolute: bool = False

    def apply(self, table: Table, room: Room) -> None:
        """Fill in a table's angles, torques and, where recorded, velocities in rad, N m, rad/s."""
        theta, omega = room.theta, room.omega
        self._joint_pair(table, JOINT_CHANNELS[:2], theta)
        self._joint_pair(table, JOINT_CHANNELS[2:], room.tau)
        if omega is not None:
            self._joint_pair(table, VELOCITIES, omega)
        if self.absolute:
            theta[1] -= theta[0]
            if omega is not None:
                omega[1] -= omega[0]
        if self.hanging:
            theta[0] -= math.pi / 2

    def _joint_pair(self, table: Table, names: Sequence[str], both: FloatArray) -> None:
        for row, name in zip(both, names, strict=True):
            if self.factors[name] == 1:
                row[:] = table.columns[name]
            else:
                np.multiply(table.columns[name], self.factors[name], out=row)
            if self.offsets[name]:
                row += self.offsets[name]


def conversion(path: str, profile: Profile | None, told: Mapping[str, str]) -> Conversion:
    """The conversion that a profile asks for; `told` are units that the file's own names state.

    Raises
    ------
    LogError
        If a torque is in amperes without a torque constant, or counts without counts a turn.
    """
    names = (*JOINT_CHANNELS, *VELOCITIES)
    factors = {name: _factor(path, name, profile, told.get(name)) for name in names}
    if profile is None:
        return Conversion(factors, dict.fromkeys(names, 0.0))
    offsets = {name: profile.channel(name).offset for name in names}
    for joint in (0, 1):
        offsets[names[joint]] += profile.offsets[joint]
    return Conversion(factors, offsets, hanging=profile.zero == "hanging", absolute=profile.second_angle == "absolute")


def _factor(path: str, name: str, profile: Profile | None, told: str | None) -> float:
    channel = profile.channel(name) if profile else None
    unit = (channel.unit if channel else None) or told or ("N m" if name.startswith("tau") else "rad")
    sign = channel.sign * profile.signs[int(name[-1]) - 1] if channel and profile else 1
    if unit in _CURRENT:
        constant = getattr(channel, "torque_constant", None)
        if constant is None:
            raise LogError(
                f"{path}: {name} is a current; torque in N m needs the motor's torque constant: set "
                f'unit = "A", torque_constant (N m/A) and gear_ratio of [{name}] in a profile'
            )
        return sign * _CURRENT[unit] * constant * float(getattr(channel, "gear_ratio", 1.0))
    if unit == "counts":
        counts = getattr(channel, "counts", None)
        if counts is None:
            raise LogError(f"{path}: {name} in encoder counts needs counts a turn: set counts of [{name}]")
        return sign * _TURN / float(counts)
    if name.startswith("tau"):
        return sign * _TORQUE[unit]
    return sign * _ANGLE[unit]
