"""Which of two joints is the first along the arm, told by their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

from algid.log import Notice

_FROM_BASE_TO_TIP = (
    ("base", "root", "waist"),
    ("shoulder", "upperarm", "upper_arm", "hip", "thigh", "proximal", "inner", "boom", "first", "primary", "pan"),
    ("elbow", "forearm", "lowerarm", "lower_arm", "fore_arm", "knee", "shank", "distal", "outer", "stick", "second"),
    ("wrist", "ankle", "hand", "foot", "tip", "bucket", "third"),
)
_ALSO_SECOND = ("secondary", "tilt")
_RANKS = {word: rank for rank, words in enumerate(_FROM_BASE_TO_TIP) for word in words} | dict.fromkeys(_ALSO_SECOND, 2)
_LETTERS = {"a": 1, "b": 2, "i": 1, "ii": 2, "one": 1, "two": 2}


def along_the_arm(names: Sequence[str]) -> tuple[tuple[str, str], Literal["names", "order"]]:
    """The two joints from the base outwards, and whether their names told so or only their order in the log.

    Names tell by the one number in which they differ, by a place on an arm or leg (shoulder before elbow, base
    before anything), or by the letters a and b.
    """
    first, second = names
    ranks = _ranks(first, second)
    if ranks is None:
        return (first, second), "order"
    return ((first, second) if ranks[0] < ranks[1] else (second, first)), "names"


def order_notice(names: Sequence[str], chosen: tuple[str, str], told: Literal["names", "order"]) -> tuple[Notice, ...]:
    """What to say of the order: nothing where names and log agree."""
    first, second = chosen
    if told == "order":
        text = f"joint 1 is {first!r} and joint 2 {second!r}, as they stand in the log: their names do not tell"
    elif list(names) != list(chosen):
        text = f"joint 1 is {first!r} and joint 2 {second!r} by their names; the log has them the other way round"
    else:
        return ()
    other = f'--joints {second},{first} swaps them (profile: joints = ["{second}", "{first}"])'
    return (Notice("JOINT_ORDER", f"{text}; {other}", note=told == "names"),)


def _ranks(first: str, second: str) -> tuple[int, int] | None:
    """Comparable places of the two names along the arm; None where the names do not tell."""
    words = [_words(first), _words(second)]
    if len(words[0]) == len(words[1]):
        differing = [pair for pair in zip(*words, strict=True) if pair[0] != pair[1]]
        if len(differing) == 1:
            for ranked in (_number, _LETTERS.get):
                found = [ranked(word) for word in differing[0]]
                if found[0] is not None and found[1] is not None:
                    return found[0], found[1]
    places = [_place(one) for one in words]
    if places[0] is not None and places[1] is not None and places[0] != places[1]:
        return places[0], places[1]
    at_base = [place == 0 for place in places]
    return None if at_base[0] == at_base[1] else (int(at_base[1]), int(at_base[0]))


def _words(name: str) -> list[str]:
    """Words and numbers of a name: ``leftArm_joint02`` is left, arm, joint, 02."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.findall(r"[^\W\d_]+|\d+", spaced.lower())


def _number(word: str) -> int | None:
    return int(word) if word.isdigit() else None


def _place(words: list[str]) -> int | None:
    """The place of the first word, or pair of words, that stands for one."""
    pairs = [f"{one}_{two}" for one, two in pairwise(words)]
    return next((_RANKS[word] for word in [*pairs, *words] if word in _RANKS), None)
