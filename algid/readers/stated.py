"""Units that a file states apart from its columns' names: above a table, or in metadata.

A statement is a name and a unit, ``tau1 in mNm``, ``angles: deg``, ``tau1, tau2 [N m]``; the name
is a column's, its stem's (``tau``), or a word for the quantity (``torques``). What names no
column, or no unit, is ordinary text.
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
    rf"(?:\s(?:(?:is|are|given|measured|recorded)\s){{0,3}}in\s|:|=|[\[(])\s*"
    rf"(?P<unit>{_UNIT})(?=\s*(?:[\])]|[,;.](?:\s|$)|$|\s))",
    re.IGNORECASE,
)
_UNITS_LINE = re.compile(r"^\s*units?\s*[:=]\s*(?P<list>.+)$", re.IGNORECASE)
_WORDS: dict[str, set[str]] = {
    "theta": {*STEMS["theta"], "joint angles", "joint positions"},
    "omega": {*STEMS["omega"], "speeds"},
    "tau": {*STEMS["tau"], "motor_torques", "joint_torques"},
    "t": {*TIMES, "times", "timestamps", "stamps"},
}
_UNITS: dict[str, Mapping[str, float]] = {
    "theta": ANGLE,
    "tau": {**TORQUE, **CURRENT},
    "t": NANOSECONDS,
}


def in_text(lines: Iterable[str], columns: Sequence[str]) -> dict[str, str]:
    """By column the unit that one of the `lines` states.

    The first statement that names it holds.
    """
    return _in_text(lines, _Named(columns))


def _in_text(lines: Iterable[str], columns: _Named) -> dict[str, str]:
    units: dict[str, str] = {}
    statements = 0
    for line in islice(lines, LIMITS.stated_lines):
        text = " ".join(line[: LIMITS.stated_letters].split())
        listed = _UNITS_LINE.match(text)
        for stated, unit in (
            _listed(listed["list"], columns) if listed else _statements(text, columns)
        ):
            statements += 1
            if statements > LIMITS.unit_statements:
                return units
            for column in stated:
                units.setdefault(column, unit)
    return units


def in_metadata(metadata: Mapping[str, str], columns: Sequence[str]) -> dict[str, str]:
    """Units by column in schema metadata: ``units`` (JSON, text), ``tau1.unit``, ``unit:tau1``."""
    named = _Named(columns)
    units: dict[str, str] = {}
    for key, value in islice(metadata.items(), LIMITS.metadata_keys):
        if key.lower() in ("unit", "units"):
            units |= _of_units_key(value, named)
            continue
        one = re.fullmatch(r"(?:units?[.:_ /](.+)|(.+)[.:_ /]units?)", key, re.IGNORECASE)
        if one and _is_unit(value):
            units |= dict.fromkeys(named.of(one[1] or one[2]), value.strip())
    return units


def _of_units_key(value: str, columns: _Named) -> dict[str, str]:
    """Units by column in the value of the key ``units``: an object of units by name, or text."""
    try:
        content = json.loads(value)
    except (ValueError, RecursionError):
        content = None
    mapped: dict[str, str] = {}
    if isinstance(content, dict):
        for name, unit in islice(content.items(), LIMITS.metadata_keys):
            if _is_unit(unit):
                mapped |= dict.fromkeys(columns.of(name), unit)
    return mapped or _in_text([f"units: {value}", value], columns)


Stated = Iterator[tuple[Sequence[str], str]]
"""Columns, and the unit that is stated for them."""


def _statements(line: str, columns: _Named) -> Stated:
    """Columns and units.

    Of several names before one unit those that can have it: ``t, q1, tau1 in mNm``.
    """
    for match in _STATEMENT.finditer(line):
        unit = match["unit"].rstrip(".")
        if _is_unit(unit):
            *others, last = re.split(r" ?(?:,|&|\band\b) ?", match["names"])
            yield columns.of(last), unit
            for name in others:
                yield [one for one in columns.of(name) if _can_have(one, unit)], unit


def _can_have(column: str, unit: str) -> bool:
    """Whether a column is of a quantity that is measured in a unit."""
    return unit_of(unit) in _UNITS.get(_quantity(column) or "", {})


def _listed(text: str, columns: _Named) -> Stated:
    """Units alone: one a column in their order, or one a quantity."""
    units = [part.strip() for part in re.split(r"[,;]", text)]
    if not all(map(_is_unit, units)):
        yield from _statements(text, columns)
    elif len(units) == len(columns.names):
        for column, unit in zip(columns.names, units, strict=True):
            yield [column], unit
    else:
        for quantity, known in _UNITS.items():
            own = {unit for unit in units if unit_of(unit) in known and "/" not in unit}
            if len(own) == 1:
                yield columns.of_quantity(quantity), own.pop()


def _is_unit(text: object) -> TypeGuard[str]:
    return isinstance(text, str) and (unit_of(text) is not None or is_foreign(text))


class _Named:
    """The columns of a log, found by what a statement may call them; each is taken apart once."""

    def __init__(self, columns: Sequence[str]) -> None:
        self.names = columns
        self._columns: dict[object, list[str]] = {}
        for column in columns:
            part, quantity = take_apart(column), _quantity(column)
            current = part.stem in CURRENTS
            for key in {
                column.lower(),
                (part.stem, part.joint),
                (part.stem,),
                (quantity, current, ""),
            }:
                self._columns.setdefault(key, []).append(column)

    def of(self, name: str) -> Sequence[str]:
        """The columns that a name stands for: by name, by stem, or by quantity."""
        plain = name.strip().lower()
        if plain in self._columns:
            return self._columns[plain]
        part = take_apart(plain)
        if part.joint is not None:
            return self._columns.get((part.stem, part.joint), [])
        if (part.stem,) in self._columns:
            return self._columns[(part.stem,)]
        quantity = _called(part.stem, f"{part.stem}s")
        return (
            [] if quantity is None else self._columns.get((quantity, part.stem in CURRENTS, ""), [])
        )

    def of_quantity(self, quantity: str) -> Sequence[str]:
        """The columns of a quantity, measured or as a current."""
        measured = self._columns.get((quantity, False, ""), [])
        return measured + self._columns.get((quantity, True, ""), [])


def _quantity(column: str) -> str | None:
    """The quantity that a column's name tells."""
    return _called(take_apart(column).stem)


def _called(*names: str) -> str | None:
    """The quantity that goes by one of the names."""
    for quantity, words in _WORDS.items():
        if not words.isdisjoint(names):
            return quantity
    return None
