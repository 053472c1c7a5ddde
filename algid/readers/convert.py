"""Arrays of a log or block; tables are converted straight into them, each sample copied once.

From a file's units, signs and zero to algid's: rad, N m, θ1 from the horizontal, θ2 from link 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.units import CURRENT, TORQUE, VELOCITY
from algid.log import ChannelReading, IntArray
from algid.notices import Remedy
from algid.options import flag
from algid.readers.table import CHANNELS, REFERENCES, SampleTable

if TYPE_CHECKING:
    from algid.profile import Angle, Profile, Torque, Velocity

UnitSource = Literal["flag", "profile", "names", "assumed"]
"""Who says a unit: a flag, a profile, the channel's own name, or nobody."""
ROWS = 1 << 16
"""Rows a table: few enough to stay in a core's cache between decoding and copying."""


QUANTITIES = ("theta", "tau", "omega", "q_des")


class SampleBuffer:
    """Stamps (N,) in ns and signals (2, N) by quantity in one piece of memory, which grows.

    Reserved memory costs nothing until it is written.

    Parameters
    ----------
    rows : int
        How many samples to expect; 0 where nobody knows. A wrong number costs time, nothing else.
    recorded : sequence of str
        The quantities, of `QUANTITIES`.

    Attributes
    ----------
    used : int
        Samples so far.
    """

    def __init__(self, rows: int, recorded: Sequence[str]) -> None:
        self._recorded, self.used = recorded, 0
        self._room = np.empty((1 + 2 * len(recorded), min(rows, LIMITS.reserved_rows)), np.int64)

    def more(self, rows: int) -> tuple[IntArray, dict[str, FloatArray]]:
        """Room for the next `rows` samples."""
        first, self.used = self.used, self.used + rows
        if self.used > self._room.shape[1]:
            larger = max(self.used, 2 * self._room.shape[1])
            old, self._room = self._room, np.empty((len(self._room), larger), np.int64)
            self._room[:, :first] = old[:, :first]
        return self._part(first)

    def filled(self) -> tuple[IntArray, dict[str, FloatArray]]:
        """All samples so far."""
        return self._part(0)

    def _part(self, first: int) -> tuple[IntArray, dict[str, FloatArray]]:
        part = self._room[:, first : self.used]
        signals = part[1:].view(np.float64)
        return part[0], {
            name: signals[2 * place : 2 * place + 2] for place, name in enumerate(self._recorded)
        }


@dataclass(frozen=True)
class PdLaw:
    """A PD law τ = kp (q_des − θ) − kd θ̇: gains in N m/rad and N m s/rad."""

    kp: float
    kd: float


def laws_of(path: str, profile: Profile) -> tuple[PdLaw | None, ...]:
    """The PD law of each joint, where the profile has one.

    Raises
    ------
    LogError
        If one lacks its gain or its desired angle.
    """
    laws: list[PdLaw | None] = []
    for name, channel in (("tau1", profile.tau1), ("tau2", profile.tau2)):
        given = [key for key in ("q_des", "kp", "kd") if getattr(channel, key) is not None]
        needed = {f"{name}.{key}": None for key in ("q_des", "kp") if key not in given}
        if given and needed:
            raise LogError(
                f"{path}: a PD law of {name} needs a desired angle and a gain, found "
                f"{', '.join(given)} alone: {Remedy(needed)}"
            )
        laws.append(PdLaw(float(channel.kp or 0), float(channel.kd or 0)) if given else None)
    return tuple(laws)


@dataclass(frozen=True)
class Conversion:
    """Value · factor + offset for each channel of a table, then zero and reference of the angles.

    A second motor at the base does the work τ_m1 θ̇1 + τ_m2 (θ̇1 + θ̇2): joint 1 has the sum of
    both torques. The torque of the `passive` joint, which has no motor, is zero. One of a PD law
    is made of the desired angle, which stands in its place, in the joint's own coordinates; where
    no velocities are recorded, they are differences of the angles, central ones within a table.
    """

    channels: Mapping[str, ChannelReading]
    zero: float = 0.0
    absolute: bool = False
    base: bool = False
    passive: int | None = None
    laws: tuple[PdLaw | None, ...] = (None, None)

    def apply(self, table: SampleTable, signals: Mapping[str, FloatArray]) -> None:
        """Fill in a table's signals (2, N) by quantity, in rad, N m, rad/s."""
        for quantity, both in signals.items():
            for joint, row in enumerate(both, start=1):
                name = f"{quantity}{joint}"
                channel = self.channels[name]
                if channel.factor == 1:
                    row[:] = table.columns[name]
                elif channel.factor:  # without a motor a torque may be anything
                    np.multiply(table.columns[name], channel.factor, out=row)
                if channel.offset:
                    row += channel.offset
        theta, tau, omega = signals["theta"], signals["tau"], signals.get("omega")
        for joint, law in enumerate(self.laws):
            if law is not None:
                speed = np.zeros(len(table))
                if omega is not None:
                    speed = omega[joint]
                elif law.kd and len(table) > 1:
                    speed = np.gradient(theta[joint], 1e-9 * (table.stamp_ns - table.stamp_ns[0]))
                tau[joint] = law.kp * (tau[joint] - theta[joint]) - law.kd * speed
        for quantity, both in signals.items():
            if self.absolute and quantity != "tau":
                both[1] -= both[0]
            if self.zero and quantity in ("theta", "q_des"):
                both[0] += self.zero
        if self.passive is not None:
            tau[self.passive - 1] = 0.0
        if self.base:
            tau[0] += tau[1]


def channel_readings(
    path: str, mapping: Mapping[str, str], profile: Profile, stated: Mapping[str, str]
) -> dict[str, ChannelReading]:
    """How each channel in `mapping` is to be read.

    `stated` are units that the file's own names state.

    Raises
    ------
    LogError
        If a torque is in amperes without a torque constant, or counts without counts a turn.
    """
    readings = {}
    for name in CHANNELS:
        if name not in mapping:
            continue
        joint = int(name[-1]) - 1
        # in the place of a torque may stand a desired angle, recorded as the angle is
        desired = getattr(profile.channel(name), "q_des", None) is not None
        like = f"theta{joint + 1}" if desired else name
        channel = _channel(like, profile)
        unit, source = _unit(like, profile, stated)
        if name == f"tau{profile.passive}":
            readings[name] = ChannelReading("none: no motor", "N m", "profile", 0.0)
            continue
        factor = (
            channel.sign * profile.signs[joint] * _factor(path, like, mapping[name], channel, unit)
        )
        angle = like.startswith(("theta", "q_des"))
        offset = channel.offset + (profile.offsets[joint] if angle else 0.0)
        readings[name] = ChannelReading(mapping[name], unit, source, factor, offset)
    return readings


def _channel(name: str, profile: Profile) -> Angle | Velocity | Torque:
    """The profile of a channel; a reference's is its angle's where it says nothing itself."""
    own = profile.channel(name)
    if name not in REFERENCES:
        return own
    said = {key: getattr(own, key) for key in own.model_fields_set}
    return profile.channel(f"theta{name[-1]}").model_copy(update=said)


def _unit(name: str, profile: Profile, stated: Mapping[str, str]) -> tuple[str, UnitSource]:
    """The unit of a channel, and who says it.

    A reference is recorded as its angle is, where nothing is said of it.
    """
    for place in (name, f"theta{name[-1]}") if name in REFERENCES else (name,):
        unit = profile.channel(place).unit
        if unit:
            return unit, profile.told_by(f"{place}.unit")
        if place in stated:
            return stated[place], "names"
    torque = "A" if profile.effort == "current" else "N m"
    return torque if name.startswith("tau") else "rad", "assumed"


def _factor(
    path: str, name: str, source: str, channel: Angle | Velocity | Torque, unit: str
) -> float:
    """What a value in `unit` at the channel's own side of the gear is in SI units at the joint."""
    known = (*TORQUE, *CURRENT) if name.startswith("tau") else (*VELOCITY, "counts")
    if unit not in known:
        right = Remedy({f"{name}.unit": known[0]}, "say its unit")
        raise LogError(
            f"{path}: {name} ({source}) is in {unit!r} by its name; expected one of "
            f"{', '.join(known)}; "
            f"{right}"
        )
    if unit in CURRENT:
        constant = getattr(channel, "torque_constant", None)
        if constant is None:
            motor = Remedy({f"{name}.torque_constant": None, f"{name}.gear_ratio": None})
            torque = Remedy({f"{name}.unit": "N m"}, "if it is a torque after all")
            unknown = Remedy({f"{name}.torque_constant": 1}, "where the constant is not known")
            raise LogError(
                f"{path}: {name} is a current; its torque needs the motor's constant in N m/A: "
                f"{motor}; {torque}; {unknown} gives all constants up to a gain, and a known "
                f"payload that gain ({flag('payload_mass')})"
            )
        return CURRENT[unit] * float(constant) * channel.gear_ratio
    if unit == "counts":
        counts = getattr(channel, "counts", None)
        if counts is None:
            turn = Remedy({f"{name}.counts": None})
            raise LogError(f"{path}: {name} in encoder counts needs counts a turn: {turn}")
        return 2 * math.pi / float(counts) / channel.gear_ratio
    return (
        TORQUE[unit] * channel.gear_ratio
        if name.startswith("tau")
        else VELOCITY[unit] / channel.gear_ratio
    )
