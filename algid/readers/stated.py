"""Units that a file states beside its columns' names: in lines above a table, in a schema's metadata.

A statement is a name and a unit, ``tau1 in mNm``, ``angles: deg``, ``tau1, tau2 [N m]``; the name is a column's, its
stem's (``tau``), or a word for the quantity (``torques``). What names no column, or no unit, is ordinary text.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TypeGuard

from algid.limits import LIMITS
from algid.readers.names import CURRENTS, STEMS, TIMES, take_apart
from algid.units import ANGLE, CURRENT, NANOSECONDS, TORQUE, is_foreign, unit_of

_NAME = r"[^\W\d][\w.\[\]]{0,79}"
_UNIT = r"[^\W\d_°%][\w°µ·⋅*/.^%-]{0,19}(?: ?m)?|[°%][\w/]{0,9}"
_STATEMENT = re.compile(
    rf"(?<![\w.])(?P<names>{_NAME}(?:\s?(?:,|&|\band\b)\s?{_NAME}){{0,9}})\s?"
    rf"(?:\s(?:(?:is|are|given|measured|recorded)\s){{0,3}}in\s|:|=|[\[(])\s*(?P<unit>{_UNIT})(?=\s*(?:[\])]|[,;.](?:\s|$)|$|\s))",
    re.IGNORECASE,
)
_UNITS_LINE = re.compile(r"^\s*units?\s*[:=]\s*(?P<list>.+)$", re.IGNORECASE)
_WORDS = {
    "theta": {*STEMS["theta"], "joint angles", "joint positions"},
    "omega": {*STEMS["omega"], "speeds"},
    "tau": {*STEMS["tau"], "motor_torques", "joint_torques"},
    "t": {*TIMES, "times", "timestamps", "stamps"},
}
_UNITS: dict[str, Mapping[str, float]] = {"theta": ANGLE, "tau": {**TORQUE, **CURRENT}, "t": NANOSECONDS}


def in_text(lines: Iterable[str], columns: Sequence[str]) -> dict[str, str]:
    """By column the unit that one of the `lines` states; the first statement that names it holds."""
    found: dict[str, str] = {}
    for line in islice(lines, LIMITS.stated_lines):
        text = " ".join(line[: LIMITS.stated_letters].split())
        listed = _UNITS_LINE.match(text)
        for column, unit in _listed(listed["list"], columns) if listed else _statements(text, columns):
            found.setdefault(column, unit)
    return found


def in_metadata(metadata: Mapping[str, str], columns: Sequence[str]) -> dict[str, str]:
    """By column the unit that a schema's metadata state: ``units`` as JSON or text, ``tau1.unit``, ``unit:tau1``."""
    found: dict[str, str] = {}
    for key, value in metadata.items():
        if key.lower() in ("unit", "units"):
            try:
                content = json.loads(value)  # an object of units by name, or text
            except (ValueError, RecursionError):
                content = None
            units = (
                {name: unit for name, unit in content.items() if _is_unit(unit)} if isinstance(content, dict) else {}
            )
            mapped = {column: unit for name, unit in units.items() for column in _columns_of(name, columns)}
            found |= mapped or in_text([f"units: {value}", value], columns)
            continue
        named = re.fullmatch(r"(?:units?[.:_ /](.+)|(.+)[.:_ /]units?)", key, re.IGNORECASE)
        if named and _is_unit(value):
            found |= dict.fromkeys(_columns_of(named[1] or named[2], columns), value.strip())
    return found


def _statements(line: str, columns: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Columns and units; of several names before one unit those that can have it: ``t, q1, tau1 in mNm``."""
    for found in _STATEMENT.finditer(line):
        unit = found["unit"].rstrip(".")
        if _is_unit(unit):
            *others, last = re.split(r" ?(?:,|&|\band\b) ?", found["names"])
            yield from ((column, unit) for column in _columns_of(last, columns))
            for name in others:
                for column in _columns_of(name, columns):
                    if unit_of(unit) in _UNITS.get(_quantity(column) or "", {}):
                        yield column, unit


def _listed(text: str, columns: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Units alone: one a column in their order, or one a quantity."""
    units = [part.strip() for part in re.split(r"[,;]", text)]
    if not all(map(_is_unit, units)):
        yield from _statements(text, columns)
    elif len(units) == len(columns):
        yield from zip(columns, units, strict=True)
    else:
        for quantity, known in _UNITS.items():
            own = {unit for unit in units if unit_of(unit) in known and "/" not in unit}
            if len(own) == 1:
                unit = own.pop()
                yield from ((column, unit) for column in columns if _quantity(column) == quantity)


def _is_unit(text: object) -> TypeGuard[str]:
    return isinstance(text, str) and (unit_of(text) is not None or is_foreign(text))


def _columns_of(name: str, columns: Sequence[str]) -> list[str]:
    """The columns that a name stands for: one of that name, those of its stem, or those of its quantity."""
    plain = name.strip().lower()
    if same := [column for column in columns if column.lower() == plain]:
        return same
    part = take_apart(plain)
    if part.joint is not None:
        wanted = (part.stem, part.joint)
        return [column for column in columns if ((own := take_apart(column)).stem, own.joint) == wanted]
    if stem := [column for column in columns if take_apart(column).stem == part.stem]:
        return stem
    quantity = next((one for one, words in _WORDS.items() if part.stem in words or f"{part.stem}s" in words), None)
    return [
        column
        for column in columns
        if quantity is not None
        and _quantity(column) == quantity
        and (take_apart(column).stem in CURRENTS) == (part.stem in CURRENTS)
    ]


def _quantity(column: str) -> str | None:
    """The quantity that a column's name tells."""
    stem = take_apart(column).stem
    return next((quantity for quantity, words in _WORDS.items() if stem in words), None)
