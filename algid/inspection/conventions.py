"""Another convention than the one read, under which a log obeys physics, and its remedy.

`algid.estimators.convention_search` finds it; here it becomes words, and settings of a profile
that change the reading.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import degrees, isclose, pi, remainder
from typing import Any, Protocol

import numpy as np

from algid.estimators.convention_search import (
    APART,
    EVIDENCE,
    EXPLAINED,
    MET,
    MOST_LOGS,
    Candidate,
    Judgement,
    Recorded,
    judge_together,
    tried_together,
    zeroed_together,
)
from algid.estimators.convention_sums import WINDOW
from algid.estimators.conventions import AS_READ, Convention
from algid.log import ZEROS, Log, Origin, Reading
from algid.model import K2, K3, K4, K5
from algid.notices import Notice, Remedy
from algid.signals.segments import stretches

# rad: a zero this close, or a centre of mass off its link, is a phase and no other convention
_SMALL = np.pi / 4
_MENTIONED = 0.01  # rad: a zero that is off by less is not mentioned
_SAME = 1e-3  # of a scale or rad: as good as equal
_DEGREES, _TURNS = 180 / pi, 1 / (2 * pi)  # scales of angles that are no motor's
# weight in N m to inertia in kg m^2: a fifth of g/l for links of 1.5 m
_LEAST_PULL = 1.3
_OF_WEIGHT = 0.01  # of a torque: what weight must explain to be there
_OTHER_WAY = Convention(torque_signs=(-1, -1))
_BEHIND = Convention(signs=(-1, -1), torque_signs=(-1, -1))
GUESSES = (
    _OTHER_WAY,
    _BEHIND,
    *(replace(one, zero=(off, 0.0)) for one in (AS_READ, _OTHER_WAY) for off in (-pi / 2, pi / 2)),
)
"""Under which gravity pulls down where it pulls up, or to a side, as the log was read."""


class Read(Protocol):
    """A log, or what stands for one: how it was read."""

    @property
    def origin(self) -> Origin:
        """Where its samples come from."""
        ...


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
    passive, parts = log.origin.reading.passive, []
    for stretch in sorted(stretches([log]), key=len, reverse=True)[:MOST_LOGS]:
        part = stretch.part(0, int(min(len(stretch), seconds / stretch.dt)))
        seconds -= len(part) * part.dt
        parts.append(Recorded(part.theta.copy(), part.tau.copy(), part.dt, passive))
    return parts


def is_right(judgement: Judgement | None) -> bool:
    """Whether physics holds for a log as it was read, and for no other convention."""
    return judgement is not None and judgement.alone and judgement.best.convention == AS_READ


def is_to_scale(judgement: Judgement | None) -> bool:
    """True if the log shows a real arm as it was read, and no scale of its angles a better one."""
    if judgement is None:
        return False
    return judgement.as_read.convincing and judgement.best.convention.scale == AS_READ.scale


def mend(log: Read, judgement: Judgement | None) -> Notice | None:
    """What sets a log right that physics contradicts as it was read.

    None where it is right but for zeros that may be centres of mass off their links, or the log
    leaves it open.

    Parameters
    ----------
    log : Log, as it was read
    judgement : of `judged`
    """
    if judgement is None or not judgement.alone or judgement.best.convention == AS_READ:
        return None
    convention = judgement.best.convention
    only_zeros = replace(convention, zero=(0.0, 0.0)) == AS_READ
    if only_zeros and max(abs(angle) for angle in convention.zero) < _SMALL:
        return None
    mirrored = convention.mirrored()
    if mirrored == _BEHIND or len(list(_clauses(mirrored))) < len(list(_clauses(convention))):
        convention = mirrored
    settings = _settings(convention, log)
    if not settings:  # it is how the log was read
        return None
    broken, left = judgement.as_read.broken, 100 * float(judgement.as_read.left.max())
    then = 100 * float(judgement.best.left.max())
    contradiction = f"{left:.3g} % of a torque stays unexplained, {then:.2g} % otherwise"
    if broken:
        name = min(broken, key=lambda name: broken[name])
        contradiction = f"{name} is broken by {round(-broken[name]):,} σ"
    numbers = {"wrong": " and ".join(_clauses(convention)), "contradiction": contradiction}
    return Notice("WRONG_CONVENTION", numbers=numbers, remedies=(Remedy(settings),))


def mends(
    logs: Sequence[tuple[Read, list[Recorded]]], *, gravity: bool = True
) -> list[Notice | None]:
    """What sets each of several logs of one arm right: see `mend`.

    They are judged together. Where that leaves it open, each is judged alone.
    """
    judgement = judge_together([part for _, parts in logs for part in parts], gravity=gravity)
    if judgement is not None and judgement.alone:
        return [mend(log, judgement) for log, _ in logs]
    return [mend(log, judge_together(parts, gravity=gravity)) for log, parts in logs]


def doubted(log: Log, judgement: Judgement | None) -> Notice | None:
    """What gravity says against a log as it was read, of which no one convention is sure.

    None where the log is right, or shows a real arm no better under any of `GUESSES` or another
    zero.
    """
    if judgement is None or is_right(judgement):
        return None
    as_read, parts = judgement.as_read, recorded(log)
    k = dict(zip(as_read.names, as_read.k.tolist(), strict=True))
    left, pull = float(as_read.left.max()), math.hypot(k[K2], k[K4])
    if left < EXPLAINED and pull < _LEAST_PULL * abs(k[K3] + k[K5]):
        (weightless,) = tried_together(parts, AS_READ, gravity=False)
        if weightless.convincing and weightless.left.max() < left + _OF_WEIGHT:
            driver = Remedy({"effort": "gravity-compensated"}, "for such a driver")
            remedies = driver, Remedy({"gravity": 0}, "for a horizontal plane")
            return Notice("GRAVITY_COMPENSATED", numbers={"case": "arm"}, remedies=remedies)
    guesses = tried_together(parts, *GUESSES)
    turned = zeroed_together(parts, AS_READ, _OTHER_WAY)
    turned = [one for one in turned if abs(one.zero[0]) > _SMALL]
    every = [one for one in (*guesses, *turned) if one.plausible and _weighs(one)]
    seconds = sum(part.theta.shape[1] * part.dt for part in parts)
    apart = max(APART, 2 * EVIDENCE * WINDOW / seconds)
    best = min((one.score for one in every), default=math.inf)
    if as_read.plausible and as_read.score < best + apart:
        return None
    near = [one for one in every if one.score < best + apart]
    # a named zero or sign before the zeros that fit best
    named = [one for one in near if one in guesses] or near
    if not named:
        return None
    offered = tuple(Remedy(_settings(one.convention, log)) for one in named)
    if named[0].zero[0]:
        turn = {"turn": -degrees(named[0].zero[0])}
        return Notice("WRONG_ZERO", numbers=turn, remedies=offered)
    return Notice("FLIPPED_SIGN", numbers={"weight": k[K4]}, remedies=offered)


def _weighs(one: Candidate) -> bool:
    """True if gravity pulls down under a convention, beyond doubt."""
    return max(one.demands.get("k2 > 0", 0.0), one.demands.get("k4 > 0", 0.0)) > MET


def _clauses(convention: Convention) -> Iterator[str]:
    """What is wrong with a log that has to be read by `convention`."""
    if convention == _BEHIND:
        yield (
            "both joints count the other way round, or θ1 counts from the other horizontal (the "
            "same arm seen from behind)"
        )
        return
    if convention.swapped and convention.torques_swapped:
        yield "the joints are swapped"
    elif convention.swapped:
        yield "the angles of the joints are swapped"
    elif convention.torques_swapped:
        yield "the torques of the joints are swapped"
    for joint in (0, 1):
        angle, torque = convention.signs[joint] < 0, convention.torque_signs[joint] < 0
        if angle and torque:
            yield f"joint {joint + 1} counts the other way round"
        elif angle:
            yield f"the sign of θ{joint + 1} is wrong"
        elif torque:
            yield f"the sign of τ{joint + 1} is wrong"
    if convention.absolute:
        yield "θ2 counts from the horizontal or the vertical, not from link 1"
    if convention.base:
        yield "the second motor stands at the base"
    for what, scale in zip(("θ1", "θ2"), convention.scale, strict=True):
        if isclose(scale, _DEGREES):
            yield f"{what} is in degrees"
        elif isclose(scale, _TURNS):
            yield f"{what} is in turns"
        elif scale != 1:
            yield f"{what} is the motor's angle, {scale:.4g} times the joint's"
    for what, off in zip(("θ1", "θ2"), convention.zero, strict=True):
        if what == "θ1" and abs(off + pi / 2) < _SAME:
            yield "θ1 is zero hanging straight down"
        elif what == "θ1" and abs(off - pi / 2) < _SAME:
            yield "θ1 is zero upright"
        elif abs(off) > _MENTIONED:
            yield f"the zero of {what} is off by {degrees(off):.4g}°"


def _settings(convention: Convention, log: Read, off: float = _SAME) -> dict[str, Any]:
    """The settings, by dotted names, that read the log by `convention`.

    A named zero stands for one that is `off` by as many rad.
    """
    reading = log.origin.reading
    mending: dict[str, Any] = dict(_sources(convention, log))
    for joint in (0, 1):
        theta, tau = f"theta{joint + 1}", f"tau{joint + 1}"
        # A channel that is swapped keeps what the profile says of its joint: names and units go
        # with the joint.
        if convention.signs[joint] < 0 and convention.torque_signs[joint] < 0:
            signs = list(mending.get("signs", reading.signs))
            signs[joint] = -signs[joint]
            mending["signs"] = signs
        elif convention.signs[joint] < 0:
            mending[f"{theta}.sign"] = -_own_sign(reading, theta)
        elif convention.torque_signs[joint] < 0:
            mending[f"{tau}.sign"] = -_own_sign(reading, tau)
        scale = convention.scale[joint]
        if isclose(scale, _DEGREES):
            mending[f"{theta}.unit"] = "deg"
        elif isclose(scale, _TURNS):
            mending[f"{theta}.unit"] = "rev"
        elif scale != 1:
            mending[f"{theta}.gear_ratio"] = float(f"{scale:.6g}")
    if convention.absolute:
        mending["second_angle"] = "absolute"
    if convention.base:
        mending["drive"] = "base"
    return mending | _zeros(convention, reading, off)


def zeroed(log: Read, turn: float, half: float) -> Remedy:
    """What reads θ1 further on by `turn` ± `half` rad, by a named zero that lies within that."""
    convention = replace(AS_READ, zero=(round(turn, 3), 0.0))
    return Remedy(_settings(convention, log, half))


def _sources(convention: Convention, log: Read) -> Iterator[tuple[str, Any]]:
    """Where the channels come from that have to change places."""
    joints = log.origin.reading.joints
    if convention.swapped and convention.torques_swapped and joints is not None:
        yield "joints", [joints[1], joints[0]]
        return
    swapped = {"theta": convention.swapped, "tau": convention.torques_swapped}
    for quantity in ("theta", "tau"):
        if not swapped[quantity]:
            continue
        for joint, other in ((1, 2), (2, 1)):
            name = f"{quantity}{other}"
            source = log.origin.mapping.get(name, name)
            yield f"{quantity}{joint}.source", source.partition(": ")[2] or source


def _own_sign(reading: Reading, name: str) -> int:
    """The sign that the profile gives a channel, beside that of its joint."""
    if name not in reading.channels:
        return 1
    return reading.channels[name].sign * reading.signs[int(name[-1]) - 1]


def _zeros(convention: Convention, reading: Reading, within: float) -> dict[str, Any]:
    """The profile's zero and offsets, to add to recorded angles once signs and scales are right."""
    channels = (reading.channels.get(name) for name in ("theta1", "theta2"))
    # what the channels' offsets added as the log was read
    own = np.array([one.offset if one else 0.0 for one in channels])
    read = own + [ZEROS[reading.zero], 0.0]
    if reading.second_angle == "absolute":
        read[1] -= own[0]
    moved = read
    if convention.swapped:
        moved = read[::-1]
    moved = np.array(convention.signs) / np.array(convention.scale) * moved
    if convention.absolute:
        moved[1] -= moved[0]
    moved = moved + convention.zero
    if np.allclose(moved, read, rtol=1e-9, atol=_SAME) and not convention.absolute:
        return {}
    # the nearest of the named zeros, the profile's own first, and what is left of it as an offset
    lefts = {name: remainder(float(moved[0]) - turned, 2 * pi) for name, turned in ZEROS.items()}
    near = [name for name in (reading.zero, *ZEROS) if abs(lefts[name]) <= within]
    zero = near[0] if near else reading.zero
    offset, second = lefts[zero] * (not near), float(moved[1])
    if convention.absolute:
        second += offset
    added = np.array([offset, remainder(second, 2 * pi)]) - (own - reading.offsets)
    offsets = [float(f"{angle:.6g}") for angle in np.where(np.abs(added) < _SAME, 0.0, added)]
    mending: dict[str, Any] = {}
    if zero != reading.zero:
        mending["zero"] = zero
    if offsets != list(reading.offsets):
        mending["offsets"] = offsets
    return mending
