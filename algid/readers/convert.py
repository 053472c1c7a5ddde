"""From a file's units, signs and zero to rad, N m, θ1 from the horizontal, θ2 from link 1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.base.units import CURRENT, TORQUE, VELOCITY
from algid.log import ZEROS, ChannelReading, Reading
from algid.notices import Remedy
from algid.options import flag
from algid.readers.table import CHANNELS, REFERENCES, SampleTable

if TYPE_CHECKING:
    from algid.profile import Angle, Profile, Torque, Velocity

UnitSource = Literal["profile", "names", "assumed"]
"""Who says a unit: a flag, a profile, the channel's own name, or nobody."""
Law = tuple[float, float] | None
"""Of a joint's PD law τ = kp (q_des − θ) − kd θ̇ the gains in N m/rad and N m s/rad."""


def laws_of(profile: Profile) -> tuple[Law, ...]:
    """The PD law of each joint, where the profile has one.

    Raises
    ------
    LogError
        If one lacks its gain or its desired angle.
    """
    laws: list[Law] = []
    for name, channel in (("tau1", profile.tau1), ("tau2", profile.tau2)):
        given = [key for key in ("q_des", "kp", "kd") if getattr(channel, key) is not None]
        needed = {f"{name}.{key}": None for key in ("q_des", "kp") if key not in given}
        if given and needed:
            raise LogError(
                f"a PD law of {name} needs a desired angle and a gain, found "
                f"{', '.join(given)} alone: {Remedy(needed)}"
            )
        laws.append((float(channel.kp or 0), float(channel.kd or 0)) if given else None)
    return tuple(laws)


def convert(
    table: SampleTable,
    signals: Mapping[str, FloatArray],
    reading: Reading,
    laws: Sequence[Law] = (None, None),
) -> None:
    """Fill in a table's signals (2, N) by quantity, in rad, N m, rad/s.

    Value · factor + offset for each channel, then zero and reference of the angles. A second motor
    at the base does the work τ_m1 θ̇1 + τ_m2 (θ̇1 + θ̇2): joint 1 has the sum of both torques. The
    torque of a passive joint, which has no motor, is zero. One of a PD law is made of the desired
    angle, which stands in its place, in the joint's own coordinates; where no velocities are
    recorded, they are differences of the angles, central ones within a table.
    """
    for quantity, both in signals.items():
        for joint, row in enumerate(both, start=1):
            name = f"{quantity}{joint}"
            channel = reading.channels[name]
            if channel.factor == 1:
                row[:] = table.columns[name]
            elif channel.factor:  # without a motor a torque may be anything
                np.multiply(table.columns[name], channel.factor, out=row)
            if channel.offset:
                row += channel.offset
    theta, tau, omega = signals["theta"], signals["tau"], signals.get("omega")
    for joint, law in enumerate(laws):
        if law is not None:
            speed = np.zeros(len(table))
            if omega is not None:
                speed = omega[joint]
            elif law[1] and len(table) > 1:
                speed = np.gradient(theta[joint], 1e-9 * (table.stamp_ns - table.stamp_ns[0]))
            tau[joint] = law[0] * (tau[joint] - theta[joint]) - law[1] * speed
    for quantity, both in signals.items():
        if reading.second_angle == "absolute" and quantity != "tau":
            both[1] -= both[0]
        if ZEROS[reading.zero] and quantity in ("theta", "q_des"):
            both[0] += ZEROS[reading.zero]
    if reading.passive is not None:
        tau[reading.passive - 1] = 0.0
    if reading.drive == "base":
        tau[0] += tau[1]


def channel_readings(
    mapping: Mapping[str, str], profile: Profile, stated: Mapping[str, str]
) -> dict[str, ChannelReading]:
    """How each channel in `mapping` is to be read.

    `stated` are units that the file states, in algid's writing or, of none that algid knows, as
    they stand. A user's word beats a file's. A reference is recorded as its angle is, where nothing
    is said of it; what stands in the place of a torque may be a desired angle.

    Raises
    ------
    LogError
        If a unit is none of the channel's, a torque is in amperes without a torque constant, or an
        angle in counts without counts a turn.
    """
    readings: dict[str, ChannelReading] = {}
    for name in CHANNELS:
        if name not in mapping:
            continue
        if name == f"tau{profile.passive}":
            readings[name] = ChannelReading("none: no motor", "N m", "profile", 0.0)
            continue
        joint = int(name[-1]) - 1
        angle = f"theta{joint + 1}"
        like = name if getattr(profile.channel(name), "q_des", None) is None else angle
        torque, own = like.startswith("tau"), profile.channel(like)
        channel, places = own, [like]
        if like in REFERENCES:
            said = {key: getattr(own, key) for key in own.model_fields_set}
            channel, places = profile.channel(angle).model_copy(update=said), [like, angle]
        known: tuple[str, ...] = (*TORQUE, *CURRENT) if torque else (*VELOCITY, "counts")
        unit = "A" if torque and profile.effort == "current" else known[0]
        source: UnitSource = "assumed"
        for place in reversed(places):
            there, given = stated.get(place), profile.channel(place).unit
            # an instrument may be in any unit: of it the scale says nothing
            if there and (there in known or like not in REFERENCES):
                unit, source = there, "names"
            if given:
                unit, source = given, "profile"
        if unit not in known:
            right = Remedy({f"{like}.unit": known[0]}, "say its unit if that is wrong")
            raise LogError(
                f"the column {mapping[name]!r} for {like} is in {unit!r}; expected one of "
                f"{', '.join(known)}; {right}"
            )
        factor = channel.sign * profile.signs[joint] * _factor(like, channel, unit)
        offset = channel.offset + (0.0 if like[:-1] in ("tau", "omega") else profile.offsets[joint])
        readings[name] = ChannelReading(mapping[name], unit, source, factor, offset)
    return readings


def _factor(name: str, channel: Angle | Velocity | Torque, unit: str) -> float:
    """What a value in `unit` at the channel's own side of the gear is in SI units at the joint."""
    if unit in CURRENT:
        constant = getattr(channel, "torque_constant", None)
        if constant is None:
            motor = Remedy({f"{name}.torque_constant": None, f"{name}.gear_ratio": None})
            torque = Remedy({f"{name}.unit": "N m"}, "if it is a torque after all")
            unknown = Remedy({f"{name}.torque_constant": 1}, "where the constant is not known")
            raise LogError(
                f"{name} is a current; its torque needs the motor's constant in N m/A: "
                f"{motor}; {torque}; {unknown} gives all constants up to a gain, and a known "
                f"payload that gain ({flag('payload_mass')})"
            )
        return CURRENT[unit] * float(constant) * channel.gear_ratio
    if unit == "counts":
        counts = getattr(channel, "counts", None)
        if counts is None:
            turn = Remedy({f"{name}.counts": None})
            raise LogError(f"{name} in encoder counts needs counts a turn: {turn}")
        return 2 * math.pi / float(counts) / channel.gear_ratio
    if name.startswith("tau"):
        return TORQUE[unit] * channel.gear_ratio
    return VELOCITY[unit] / channel.gear_ratio
