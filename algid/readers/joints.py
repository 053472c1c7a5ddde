"""Which of two joints is the first along the arm, known from their names.

And whether those not read are held still.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np

from algid.base.criteria import BESIDE_STILL, SWINGING
from algid.base.errors import LogError
from algid.base.text import joined
from algid.log import Reading
from algid.notices import Notice, Remedy, nevertheless
from algid.readers.table import SampleTable

if TYPE_CHECKING:
    from algid.profile import Profile

_FROM_BASE_TO_TIP = (
    "base root waist",
    "shoulder upperarm upper_arm hip thigh proximal inner boom first primary pan",
    "elbow forearm lowerarm lower_arm fore_arm knee shank distal outer stick second secondary tilt",
    "wrist ankle hand foot tip bucket third",
)
_RANKS = {word: rank for rank, words in enumerate(_FROM_BASE_TO_TIP) for word in words.split()}
_LETTERS = {"a": 1, "b": 2, "i": 1, "ii": 2, "one": 1, "two": 2}


def along_the_arm(names: Sequence[str]) -> tuple[tuple[str, str], Literal["names", "order"]]:
    """The two joints from the base outwards, and whether names or only the log's order say so.

    Names tell by the one number in which they differ, by a place on an arm or leg (shoulder before
    elbow, base before anything), or by the letters a and b.
    """
    first, second = names
    ranks = _ranks(first, second)
    if ranks is None:
        return (first, second), "order"
    if ranks[0] >= ranks[1]:
        first, second = second, first
    return (first, second), "names"


def reading_of(names: Sequence[str], profile: Profile) -> tuple[Reading, tuple[Notice, ...]]:
    """Joints 1 and 2 by the user or else by the two `names`, their source, and notices.

    Nothing is said where names and log agree.
    """
    if profile.joints:
        return Reading(joints=profile.joints, joints_told="profile"), ()
    joints, by = along_the_arm(names)
    reading = Reading(joints=joints, joints_told=by)
    if by == "names" and list(names) == list(joints):
        return reading, ()
    why = "by their names; the log has them the other way round"
    if by == "order":
        why = "as they stand in the log: their names do not tell"
    numbers = {"case": "names", "first": joints[0], "second": joints[1], "why": why}
    swapped = Remedy({"joints": list(joints[::-1])}, "to swap them")
    note = by == "names"
    return reading, (Notice("JOINT_ORDER", numbers=numbers, remedies=(swapped,), note=note),)


def _ranks(first: str, second: str) -> tuple[int, int] | None:
    """Comparable places of the two names along the arm; None where the names do not tell."""
    words, others = _words(first), _words(second)
    differing = [pair for pair in zip(words, others, strict=False) if pair[0] != pair[1]]
    if len(words) == len(others) and len(differing) == 1:
        one, other = differing[0]
        if one.isdecimal() and other.isdecimal():
            return int(one), int(other)
        if one in _LETTERS and other in _LETTERS:
            return _LETTERS[one], _LETTERS[other]
    places = [_place(words), _place(others)]
    if places[0] == places[1] or (None in places and 0 not in places):
        return None
    first_place, second_place = (1 if one is None else one for one in places)  # behind a base
    return first_place, second_place


def _place(words: Sequence[str]) -> int | None:
    """What the first word, or pair of words, that stands for a place on an arm says."""
    known = [word for word in (*map("_".join, pairwise(words)), *words) if word in _RANKS]
    return _RANKS[known[0]] if known else None


def _words(name: str) -> list[str]:
    """Words and numbers of a name: ``leftArm_joint02`` is left, arm, joint, 02."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.findall(r"[^\W\d_]+|\d+", spaced.lower())


_NAMED = 4
LOOKED = 1 << 14
"""Samples in which the joints that are not read are looked at."""


def moving_joints(
    positions: Mapping[str, str], tables: Callable[[], Iterator[SampleTable]], unit: float
) -> Iterator[Notice]:
    """Say which of the other joints of a log move, and how far, in its first table.

    Where they move, the two-link model lacks their torque. `positions` has by joint the name of
    its angle, in `unit` rad; `tables` reads them.
    """
    table, moved = None, dict[str, float]()
    with suppress(LogError):  # the joints that are read tell of what is wrong
        table = next(filter(len, tables()), None)
    if table is None:
        return
    for joint, place in positions.items():
        values = table.columns[place][:LOOKED]
        finite = values[np.isfinite(values)]
        if finite.size and unit * np.ptp(finite) > BESIDE_STILL:
            moved[joint] = unit * float(np.ptp(finite))
    if not moved:
        return
    furthest = sorted(moved, key=lambda joint: -moved[joint])
    listed = joined([f"{joint} by {moved[joint]:.2g} rad" for joint in furthest], _NAMED)
    swing = moved[furthest[0]] > SWINGING
    remedies = (nevertheless("OTHER_JOINTS"),) if swing else ()
    numbers = {"count": len(moved), "joints": listed, "swing": swing}
    numbers["samples"] = min(len(table), LOOKED)
    yield Notice("OTHER_JOINTS", numbers=numbers, remedies=remedies)
