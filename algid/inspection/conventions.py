"""Another convention than the one read, under which a log obeys physics, and its remedy.

`algid.estimators.convention_search` finds it; here it becomes words, and settings of a profile
that change the reading.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, isclose, pi, remainder
from typing import Any, Protocol

import numpy as np

from algid.estimators.convention_search import (
    Candidate,
    Judgement,
    Recorded,
    judge_together,
    tried_together,
    zeroed_together,
)
from algid.estimators.conventions import AS_READ, Convention
from algid.inspection.dynamics import Suspicion
from algid.log import ZEROS, Log, Origin, Reading
from algid.notices import Notice, Remedy
from algid.signals.segments import Segment, append, segments
from algid.words import counted

# rad: a zero this close, or a centre of mass off its link, is a phase and no other convention
_SMALL = np.pi / 4
_TOLD = 0.01  # rad: a zero closer than this is not worth a word
_SAME = 1e-3  # of a scale or rad: as good as equal


class Read(Protocol):
    """A log, or what stands for one: how it was read."""

    @property
    def origin(self) -> Origin:
        """Where its samples come from."""
        ...


@dataclass(frozen=True)
class Mend:
    """How a log has to be read.

    Parameters
    ----------
    words : what is wrong, in clauses
    contradiction : what physics says against the convention that the log was read by
    settings : the profile's settings that mend it; a channel's are a dictionary of their own
    another : whether it is another convention, not the same one with its zeros a little off
    """

    words: str
    contradiction: str
    settings: dict[str, Any]
    another: bool

    @property
    def notice(self) -> Notice:
        """What there is to say of the log."""
        numbers = {"wrong": self.words, "contradiction": self.contradiction}
        if not self.another:
            return Notice("ZERO_OFFSET", numbers=numbers, note=True)
        return Notice("WRONG_CONVENTION", numbers=numbers, remedies=(self.remedy,))

    @property
    def remedy(self) -> Remedy:
        """The same settings by dotted names."""
        return Remedy(_flat(self.settings))


def _flat(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by dotted names."""
    flat: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}.{key}": inner for key, inner in value.items()}
        else:
            flat[name] = value
    return flat


def judged(log: Log, *, gravity: bool = True) -> Judgement | None:
    """Every convention tried on a log.

    None where it is too short or too slow to tell, or a torque is none.

    Parameters
    ----------
    log : Log, as it was read
    gravity : False for an arm in a horizontal plane
    """
    return judged_together([recorded(log)], gravity=gravity)


def judged_together(logs: Iterable[Recorded | None], *, gravity: bool = True) -> Judgement | None:
    """The same of logs of one arm, of which None tells nothing."""
    return judge_together([log for log in logs if log is not None], gravity=gravity)


def recorded(log: Log, seconds: float = math.inf) -> Recorded | None:
    """The beginning of the longest stretch of a log without a gap; None of an empty one."""
    stretches: list[Segment] = []
    for segment in segments([log]):
        if segment.continues and stretches:
            stretches[-1] = append(stretches[-1], segment)
        else:
            stretches.append(segment)
    longest = max(stretches, key=len, default=None)
    if longest is None:
        return None
    part = longest.part(0, int(min(len(longest), seconds / longest.dt)))
    passive = log.origin.reading.passive
    return Recorded(part.theta.copy(), part.tau.copy(), part.dt, passive)


def is_right(found: Judgement | None) -> bool:
    """Whether physics holds for a log as it was read, and for no other convention."""
    return found is not None and found.alone and found.best.convention == AS_READ


def mend(log: Read, found: Judgement | None) -> Mend | None:
    """What sets a log right that physics contradicts as it was read.

    None where it is right, or the log does not tell.

    Parameters
    ----------
    log : Log, as it was read
    found : what `judged` says of it
    """
    if found is None or not found.alone or found.best.convention == AS_READ:
        return None
    convention = min(
        (found.best.convention, found.best.convention.mirrored()),
        key=lambda one: len(list(_clauses(one))),
    )
    words = " and ".join(_clauses(convention))
    if convention.mirrored().zero == (0.0, 0.0) and replace(convention, zero=(0.0, 0.0)) == AS_READ:
        words = (
            "all signs are turned round, or θ1 counts from the other horizontal (the same arm "
            "seen from behind)"
        )
    broken = min(found.as_read.broken.items(), key=lambda one: one[1], default=None)
    if broken is None:
        left, then = (100 * float(one.left.max()) for one in (found.as_read, found.best))
        contradiction = f"{left:.3g} % of a torque stays unexplained, {then:.2g} % then"
    else:
        name, distance = broken
        missed = counted(round(-distance), "standard deviation")
        contradiction = f"it demands {name}, which the log misses by {missed}"
    small = all(abs(angle) < _SMALL for angle in convention.zero)
    return Mend(
        words,
        contradiction,
        _settings(convention, log),
        another=not small or replace(convention, zero=(0.0, 0.0)) != AS_READ,
    )


def mends(logs: Sequence[tuple[Read, Recorded]], *, gravity: bool = True) -> list[Mend | None]:
    """What sets each of several logs of one arm right: see `mend`.

    They are judged together. Where that does not tell, each is judged by itself, and accused of
    another convention only: what a single run alleges of zeros may be friction.
    """
    judgement = judged_together([recording for _, recording in logs], gravity=gravity)
    if judgement is not None and judgement.alone:
        return [mend(log, judgement) for log, _ in logs]
    own = [mend(log, judged_together([each], gravity=gravity)) for log, each in logs]
    return [None if one is None or not one.another else one for one in own]


def advised(log: Log, suspicion: Suspicion) -> Notice:
    """The notice of a suspicion with its remedies: those under which the log shows a real arm."""
    known = recorded(log)
    tried = () if known is None else _tried(log, suspicion, known)
    return replace(suspicion.notice, remedies=tuple(tried))


def _tried(log: Log, suspicion: Suspicion, known: Recorded) -> Iterator[Remedy]:
    """The remedies that are physical and explain the torque."""
    if suspicion.weightless and _is_real(tried_together([known], AS_READ, gravity=False)):
        yield Remedy({"effort": "gravity-compensated"}, "for such a driver")
        yield Remedy({"gravity": 0}, "for a horizontal plane")
    candidates = [tried_together([known], guess) for guess in suspicion.guesses]
    if suspicion.free_zero and not any(map(_is_real, candidates)):
        candidates += [zeroed_together([known], guess) for guess in suspicion.guesses]
    for one in candidates:
        if one is not None and one.convincing:
            yield Remedy(_flat(_settings(one.convention, log)))


def _is_real(found: Candidate | None) -> bool:
    return found is not None and found.convincing


def _clauses(convention: Convention) -> Iterator[str]:
    """What is wrong with a log that has to be read by `convention`."""
    if convention.swapped and convention.torques_swapped:
        yield "the joints are swapped"
    elif convention.swapped or convention.torques_swapped:
        yield f"the {'angles' if convention.swapped else 'torques'} of the joints are swapped"
    for joint in (0, 1):
        angle, torque = convention.signs[joint] < 0, convention.torque_signs[joint] < 0
        if angle and torque:
            yield f"joint {joint + 1} counts the other way round"
        elif angle or torque:
            yield f"the sign of {'θ' if angle else 'τ'}{joint + 1} is wrong"
    if convention.absolute:
        yield "θ2 counts from the horizontal or the vertical, not from link 1"
    if convention.base:
        yield "the second motor stands at the base"
    for what, scale in zip(("θ1", "θ2"), convention.scale, strict=True):
        if _is_unit(scale):
            yield f"{what} is in {'degrees' if scale > 1 else 'turns'}"
        elif scale != 1:
            yield f"{what} is the motor's angle, {scale:.4g} times the joint's"
    for what, off in zip(("θ1", "θ2"), convention.zero, strict=True):
        if what == "θ1" and abs(abs(off) - pi / 2) < _SAME:
            yield f"θ1 is zero {'hanging straight down' if off < 0 else 'upright'}"
        elif abs(off) > _TOLD:
            yield f"the zero of {what} is off by {degrees(off):.4g}°"


def _is_unit(scale: float) -> bool:
    return isclose(scale, 180 / pi) or isclose(scale, 1 / (2 * pi))


def _settings(convention: Convention, log: Read) -> dict[str, Any]:
    """The settings that read the log by `convention`, over those that it was read by."""
    reading = log.origin.reading
    mending: dict[str, Any] = dict(_sources(convention, log))
    place = (1, 0) if convention.swapped else (0, 1)
    for joint in (0, 1):
        theta, tau = (
            mending.setdefault(f"theta{joint + 1}", {}),
            mending.setdefault(f"tau{joint + 1}", {}),
        )
        # A channel that is swapped keeps what the profile says of its joint: names and units go
        # with the joint.
        if convention.signs[joint] < 0 and convention.torque_signs[joint] < 0:
            signs = list(mending.get("signs", reading.signs))
            signs[joint] = -signs[joint]
            mending["signs"] = signs
        elif convention.signs[joint] < 0:
            theta["sign"] = -_own_sign(reading, f"theta{joint + 1}")
        elif convention.torque_signs[joint] < 0:
            tau["sign"] = -_own_sign(reading, f"tau{joint + 1}")
        scale = convention.scale[joint]
        if _is_unit(scale):
            theta["unit"] = "deg" if scale > 1 else "rev"
        elif scale != 1:
            theta["gear_ratio"] = float(f"{scale:.6g}")
    if convention.absolute:
        mending["second_angle"] = "absolute"
    if convention.base:
        mending["drive"] = "base"
    mending |= _zeros(convention, reading, place)
    return {name: value for name, value in mending.items() if value != {}}


def _sources(convention: Convention, log: Read) -> Iterator[tuple[str, Any]]:
    """Where the channels come from that have to change places."""
    joints = log.origin.reading.joints
    if convention.swapped and convention.torques_swapped and joints is not None:
        yield "joints", [joints[1], joints[0]]
        return
    for name, swapped in (("theta", convention.swapped), ("tau", convention.torques_swapped)):
        for joint in (1, 2) if swapped else ():
            source = log.origin.mapping.get(f"{name}{3 - joint}", f"{name}{3 - joint}")
            yield f"{name}{joint}", {"source": source.partition(": ")[2] or source}


def _own_sign(reading: Reading, name: str) -> int:
    """The sign that the profile gives a channel, beside that of its joint."""
    return (
        reading.channels[name].sign * reading.signs[int(name[-1]) - 1]
        if name in reading.channels
        else 1
    )


def _zeros(convention: Convention, reading: Reading, place: tuple[int, int]) -> dict[str, Any]:
    """The profile's zero and offsets, to add to recorded angles once signs and scales are right."""
    channels = (reading.channels.get("theta1"), reading.channels.get("theta2"))
    own = [0.0 if channel is None else channel.offset for channel in channels]
    read = [
        own[0] + ZEROS[reading.zero],
        own[1] - (own[0] if reading.second_angle == "absolute" else 0.0),
    ]
    first, second = (
        convention.signs[joint] / convention.scale[joint] * read[place[joint]] for joint in (0, 1)
    )
    first, second = (
        first + convention.zero[0],
        second - (first if convention.absolute else 0.0) + convention.zero[1],
    )
    if (
        isclose(first, read[0], abs_tol=_SAME)
        and isclose(second, read[1], abs_tol=_SAME)
        and not convention.absolute
    ):
        return {}
    zeros = {name: first - turned for name, turned in ZEROS.items()}
    zero = min(
        zeros, key=lambda name: (abs(remainder(zeros[name], 2 * pi)) > _SAME, name != reading.zero)
    )
    offset = remainder(zeros[zero], 2 * pi)
    both = (offset, second + (offset if convention.absolute else 0.0))
    added = [
        remainder(both[joint], 2 * pi) - (own[joint] - reading.offsets[joint]) for joint in (0, 1)
    ]
    offsets = [0.0 if abs(angle) < _SAME else float(f"{angle:.6g}") for angle in added]
    mending: dict[str, Any] = {"zero": zero} if zero != reading.zero else {}
    return mending | ({"offsets": offsets} if offsets != list(reading.offsets) else {})
