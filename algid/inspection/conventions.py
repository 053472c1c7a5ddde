"""Another convention than the one read, under which a log obeys physics, and its remedy.

`algid.estimators.convention_search` finds it; here it becomes words, and settings of a profile
that change the reading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from math import degrees, isclose, pi, remainder
from typing import Any

import numpy as np

from algid.base.units import ANGLE
from algid.estimators.convention_search import (
    MET,
    MOST_LOGS,
    Candidate,
    Judgement,
    Recorded,
    judge_together,
)
from algid.estimators.conventions import AS_READ, Convention
from algid.log import ZEROS, ChannelReading, Log, Origin, Reading
from algid.model import K2, K3, K4, K5, Model
from algid.notices import Notice, Remedy
from algid.signals.segments import stretches

# rad: a zero this close, or a centre of mass off its link, is a phase and no other convention
_SMALL = np.pi / 4
_SAME = 1e-3  # of a scale or rad: as good as equal
PLAIN = ChannelReading("", "rad")
# weight in N m to inertia in kg m^2: a fifth of g/l for links of 1.5 m
_LEAST_PULL = 1.3
_OF_WEIGHT = 0.01  # of a torque: what weight must explain to be there
_TORQUES = Convention(torque_signs=(-1, -1))
_SIDEWAYS = ((-pi / 2, 0.0), (pi / 2, 0.0))  # θ1 from the vertical


def judged(log: Log, *, gravity: bool = True) -> Judgement | None:
    """Every convention tried on a log.

    None where it is too short or too slow, or a torque is zero throughout.

    Parameters
    ----------
    log : Log, as it was read
    gravity : False for an arm in a horizontal plane
    """
    return judge_together(recorded(log), gravity=gravity)


def recorded(log: Log, seconds: float = math.inf) -> list[Recorded]:
    """The stretches of a log without a gap, the longest first, `seconds` of them in all."""
    parts, reading = [], log.origin.reading
    # what was said of θ2, of the second motor and of units may be wrong
    way: dict[str, Any] = {
        "passive": reading.passive,
        "absolute": -1 if reading.second_angle == "absolute" else 1,
        "base": -1 if reading.drive == "base" else 1,
        "unit_scales": tuple(_unit_scales(reading, 1).values()),
    }
    for stretch in sorted(stretches([log]), key=len, reverse=True)[:MOST_LOGS]:
        part = stretch.part(0, int(min(len(stretch), seconds / stretch.dt)))
        seconds -= len(part) * part.dt
        parts.append(Recorded(part.theta.copy(), part.tau.copy(), part.dt, **way))
    return parts


def is_to_scale(judgement: Judgement | None) -> bool:
    """True if the log shows a real arm as it was read, and no scale of its angles a better one."""
    if judgement is None:
        return False
    return judgement.as_read.convincing and judgement.best.convention.scale == AS_READ.scale


def mend(origin: Origin, judgement: Judgement | None) -> Notice | None:
    """What sets a log right that physics contradicts as it was read.

    None where it is right but for zeros that may be centres of mass off their links, or the log
    leaves it open.

    Parameters
    ----------
    origin : how the log was read
    judgement : of `judged`
    """
    if judgement is None:
        return None
    best, settings = judgement.best, dict[str, Any]()
    # a small zero is a phase
    if judgement.alone and (best.family != AS_READ or max(map(abs, best.zero)) >= _SMALL):
        settings = _settings(best.convention, origin)
    if not settings and K4 not in judgement.as_read.constants:  # said to be without weight
        weighed = judgement.trials.reweighed()
        better = weighed.score < best.score - judgement.trials.apart
        if better and weighed.convincing and _has_weight(weighed):
            best, settings = weighed, {"effort": "raw", "gravity": Model().gravity}
    if not settings:  # without settings it is how the log was read
        return None
    broken = judgement.as_read.broken
    left, then = (100 * float(one.left.max()) for one in (judgement.as_read, best))
    contradiction = f"{left:.3g} % of a torque stays unexplained, {then:.2g} % otherwise"
    if broken:
        worst = min(broken, key=broken.__getitem__)
        contradiction = f"{worst} is broken by {round(-broken[worst]):,} σ"
    numbers = {"wrong": list(settings), "contradiction": contradiction}
    return Notice("WRONG_CONVENTION", numbers=numbers, remedies=(Remedy(settings),))


def mends(
    logs: Sequence[tuple[Origin, list[Recorded]]], *, gravity: bool = True
) -> list[Notice | None]:
    """What sets each of several logs of one arm right: see `mend`.

    They are judged together. Where that leaves it open, each is judged alone.
    """
    every = judge_together([part for _, parts in logs for part in parts], gravity=gravity)
    if every is not None and every.alone:
        return [mend(origin, every) for origin, _ in logs]
    return [mend(origin, judge_together(parts, gravity=gravity)) for origin, parts in logs]


def doubted(origin: Origin, judgement: Judgement | None) -> Notice | None:
    """What gravity says against a log as it was read, of which no one convention is sure.

    None where the log is right, shows a real arm no better with other signs or another zero, or the
    arm has no weight.
    """
    if judgement is None or K4 not in judgement.as_read.constants:
        return None
    as_read, trials = judgement.as_read, judgement.trials
    if judgement.alone and judgement.best.convention == AS_READ:
        return None
    if not _has_weight(as_read):
        weightless = trials.reweighed()
        if weightless.convincing and weightless.left.max() < as_read.left.max() + _OF_WEIGHT:
            driver = Remedy({"effort": "gravity-compensated"}, "for such a driver")
            level = Remedy({"gravity": 0}, "for a horizontal plane")
            numbers = {"case": "arm"}
            return Notice("GRAVITY_COMPENSATED", numbers=numbers, remedies=(driver, level))
    named = trials.under(AS_READ, (pi, 0.0), *_SIDEWAYS)
    named += trials.under(_TORQUES, AS_READ.zero, *_SIDEWAYS)
    likely = []
    for one in (*named, trials.zeroed(AS_READ), trials.zeroed(_TORQUES)):
        down = max(one.demands.get(f"{name} > 0", 0.0) for name in (K2, K4)) > MET
        if one.plausible and down and (one.family != AS_READ or abs(one.zero[0]) > _SMALL):
            likely.append(one)
    least = min((one.score for one in likely), default=-math.inf) + trials.apart
    near = [one for one in likely if one.score < least]
    if not near or (as_read.plausible and as_read.score < least):
        return None
    # a named zero or sign before the zeros that fit best
    near = [one for one in near if one in named] or near
    offered = tuple(Remedy(_settings(one.convention, origin)) for one in near)
    turn = near[0].zero[0]
    if turn in (0.0, pi):
        weight = {"weight": as_read.constants[K4]}
        return Notice("FLIPPED_SIGN", numbers=weight, remedies=offered)
    return Notice("WRONG_ZERO", numbers={"turn": -degrees(turn)}, remedies=offered)


def _has_weight(one: Candidate) -> bool:
    """True if gravity pulls as it does on links of their inertia."""
    k = one.constants
    return math.hypot(k[K2], k[K4]) >= _LEAST_PULL * abs(k[K3] + k[K5])


def zeroed(origin: Origin, turn: float, half: float) -> Remedy:
    """What reads θ1 further on by `turn` ± `half` rad, by a named zero that lies within that."""
    convention = replace(AS_READ, zero=(round(turn, 3), 0.0))
    return Remedy(_zeros(convention, origin.reading, half))


def _unit_scales(reading: Reading, joint: int) -> dict[str, float]:
    """By unit what divides angles that are in it, not in the one by which they were read."""
    known = reading.channels.get(f"theta{joint}", PLAIN).unit
    if known not in ANGLE:
        return {}
    return {unit: ANGLE[known] / factor for unit, factor in ANGLE.items() if unit != known}


def _settings(convention: Convention, origin: Origin) -> dict[str, Any]:
    """The settings that read a log by `convention`, or by the same arm seen from behind.

    Those that need no number, then those that are fewer.
    """
    both = [_exactly(one, origin) for one in (convention, convention.mirrored())]
    return min(both, key=lambda one: ("offsets" in one, len(one)))


def _exactly(convention: Convention, origin: Origin) -> dict[str, Any]:
    """The settings, by dotted names, that read a log by `convention`."""
    reading, settings = origin.reading, dict[str, Any]()
    swapped = ["theta"] * convention.swapped + ["tau"] * convention.torques_swapped
    if len(swapped) == 2 and reading.joints is not None:
        settings["joints"] = list(reversed(reading.joints))
        swapped = []
    for quantity in swapped:
        for own, other in ("12", "21"):
            source = origin.mapping.get(quantity + other, quantity + other)
            settings[f"{quantity}{own}.source"] = source.rpartition(": ")[2]
    # A channel that is swapped keeps what the profile says of its joint: names and units go with
    # the joint.
    for joint, scale in enumerate(convention.scale, start=1):
        place = joint - 1
        angle, torque = convention.signs[place], convention.torque_signs[place]
        if angle + torque < 0:
            settings.setdefault("signs", list(reading.signs))[place] *= -1
        elif angle != torque:
            name = f"theta{joint}" if angle < 0 else f"tau{joint}"
            channel = reading.channels.get(name)
            # against the sign that the profile gives the channel, beside that of its joint
            settings[f"{name}.sign"] = -channel.sign * reading.signs[place] if channel else -1
        units = _unit_scales(reading, joint)
        if unit := next((one for one in units if isclose(scale, units[one])), None):
            settings[f"theta{joint}.unit"] = unit
        elif scale != 1:
            read = reading.channels.get(f"theta{joint}", PLAIN)
            geared = ANGLE.get(read.unit, abs(read.factor)) / abs(read.factor)
            settings[f"theta{joint}.gear_ratio"] = float(f"{geared * scale:.6g}")
    if convention.absolute:
        settings["second_angle"] = "absolute" if convention.absolute > 0 else "relative"
    if convention.base:
        settings["drive"] = "base" if convention.base > 0 else "joint"
    return settings | _zeros(convention, reading)


def _zeros(convention: Convention, reading: Reading, within: float = _SAME) -> dict[str, Any]:
    """The profile's zero and offsets, to add to recorded angles once signs and scales are right.

    A named zero stands for one that is `within` as many rad.
    """
    absolute = reading.second_angle == "absolute"
    channels = (reading.channels.get(name) for name in ("theta1", "theta2"))
    own = np.array([one.offset if one else 0.0 for one in channels])
    # what was added to the angles as the log was read, and what has to be
    read = own + [ZEROS[reading.zero], -own[0] * absolute]
    first, second = convention.angles(read[:, None])[:, 0].tolist()
    # the nearest of the named zeros, the profile's own first, and what is left of it as an offset
    lefts = {name: remainder(first - turned, 2 * pi) for name, turned in ZEROS.items()}
    zero = min((reading.zero, *ZEROS), key=lambda name: abs(lefts[name]) > within)
    offset = lefts[zero] * (abs(lefts[zero]) > within)
    added = np.array([offset, second + offset * (absolute + convention.absolute)]) - own
    added = np.remainder(added + pi, 2 * pi) - pi
    added[np.abs(added) < _SAME] = 0.0
    offsets = [float(f"{one:.6g}") for one in reading.offsets + added]
    named = {"zero": zero} if zero != reading.zero else {}
    return named | {"offsets": offsets} if added.any() else named
