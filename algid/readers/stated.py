"""What a log states beside its signals: units, conventions, a rate, several arms.

Units in attributes, and in keys of metadata, are applied. What else of a known vocabulary is
stated and not used is told by one notice, with the settings that apply it: a sentence of a comment
may mean something else.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, TypeGuard

from algid.base.limits import LIMITS
from algid.base.units import ANGLE, CURRENT, NANOSECONDS, TORQUE, VELOCITY, is_foreign, unit_of
from algid.log import KEY, IntArray, Reading, usual_period
from algid.notices import Notice, Remedy
from algid.readers.names import CURRENTS, STEMS, TIMES, take_apart, words

if TYPE_CHECKING:
    from algid.profile import Profile

_WORDS: dict[str, frozenset[str]] = {
    "theta": frozenset((*STEMS["theta"], "joint_angles", "joint_positions")),
    "omega": frozenset((*STEMS["omega"], "speeds")),
    "tau": frozenset((*STEMS["tau"], "motor_torques", "joint_torques")),
    "t": frozenset((*TIMES, "times", "timestamps", "stamps")),
}
"""What a key of metadata may call the columns of a quantity."""
_UNIT_KEY = re.compile(r"units?[.:_ /](.+)|(.+)[.:_ /]units?", re.IGNORECASE)
_KEY = re.compile(r"[\W\d]*(\w+) ?[:=] ?\"?([\w.-]+)(?: ?hz)?\"?$", re.IGNORECASE)
_CONVENTIONS = {
    "zero": ("horizontal", "hanging", "upright"),
    "second_angle": ("relative", "absolute"),
    "drive": ("joint", "base"),
    "effort": (
        "raw", "gravity-compensated", "friction-compensated", "external", "command", "current",
    ),
}  # fmt: skip
"""Settings of a profile whose words a file may state."""
_MISSING = re.compile(r"\b(?:_FillValue|missing_value)\b", re.IGNORECASE)
_RATES = {"fs", "rate", "sampling_rate", "sample_rate", "sampling_frequency", "frequency_hz"}
_MOST = 8
"""Values that are listed."""
_SAME_RATE = 0.1
"""Relative: a recorder's jitter, and what it rounds."""
_COMMON = frozenset(
    words(
        """
        a amp amps s in m turn turns count counts inc increments tick ticks sec secs second seconds
        rev revs milli millis micro micros nano nanos rad radians
        """
    )
)
"""Units that are also words: units only in brackets, or behind these words."""
_BEFORE_UNIT = ("in", "unit", "units", "is", "are")
GROUPS = frozenset(
    words(
        """
        robot robot_id robot_name arm_id arm_name frame_id episode episode_index episode_id
        run run_id trial trial_id session session_id
        """
    )
)
"""Columns that say to which arm or recording a row belongs."""
GOOD = frozenset(("valid", "is_valid", "data_valid"))
BAD = frozenset(("error_code", "err_code", "fault_code"))
"""Columns that say which rows are no measurements: where the first are zero, or the second not."""


def units_in(metadata: Mapping[str, str], columns: Sequence[str]) -> dict[str, str]:
    """Units by column in metadata: ``units`` (a JSON object), ``tau1.unit``, ``unit:tau1``.

    A name is a column's, its stem's (``tau``), or a word for the quantity (``torques``).
    """
    units: dict[str, str] = {}
    for key, value in islice(metadata.items(), LIMITS.metadata_keys):
        named: Mapping[str, object] = {}
        if key.lower() in ("unit", "units"):
            named = _object(value)
        elif match := _UNIT_KEY.fullmatch(key):
            named = {match[1] or match[2]: value}
        for name, unit in islice(named.items(), LIMITS.metadata_keys):
            if _is_unit(unit):
                units |= dict.fromkeys(_called(name, columns), unit.strip())
    return units


def _object(text: str) -> dict[str, object]:
    """What a JSON object holds; empty where a text is none."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _is_unit(text: object) -> TypeGuard[str]:
    return isinstance(text, str) and (unit_of(text) is not None or is_foreign(text))


def _called(name: str, columns: Sequence[str]) -> list[str]:
    """The columns that a name stands for."""
    plain = name.strip().lower()
    if plain in (lower := [one.lower() for one in columns]):
        return [columns[lower.index(plain)]]
    part = take_apart(plain)
    found = []
    for column in columns:
        own = take_apart(column)
        if own.stem == part.stem:
            if part.joint in (None, own.joint):
                found.append(column)
        elif part.joint is None and (own.stem in CURRENTS) == (part.stem in CURRENTS):
            called = (part.stem, f"{part.stem}s")
            if any(own.stem in one and not one.isdisjoint(called) for one in _WORDS.values()):
                found.append(column)
    return found


def in_json_schema(text: str) -> tuple[dict[str, str], list[str]]:
    """By name the unit that a JSON schema has for a property, as metadata; its descriptions."""
    units, lines = {}, []
    properties = _object(text).get("properties")
    for name, one in properties.items() if isinstance(properties, dict) else ():
        if isinstance(one, dict):
            for key in ("unit", "units"):
                if isinstance(one.get(key), str):
                    units[f"{name}.unit"] = one[key]
            lines.append(f"{name}: {one.get('description', '')}")
    return units, lines


def lines_of(metadata: Mapping[str, str]) -> Iterator[str]:
    """Metadata as lines of text, without the units that `units_in` applies."""
    for key, value in islice(metadata.items(), LIMITS.metadata_keys):
        if key in ("pandas", "ARROW:schema", KEY):
            continue
        known = key.lower() in ("unit", "units") and _object(value)
        if not (known or _UNIT_KEY.fullmatch(key)):
            yield f"{key}: {value}"


def unused(said: Iterable[str], reading: Reading, profile: Profile) -> Iterator[Notice]:
    """One notice of the `said` lines of text that state what is not used."""
    found: dict[str, Remedy] = {}
    for line in islice(said, LIMITS.stated_lines):
        text = " ".join(line[: LIMITS.stated_letters].split())
        settings = _convention(text, profile) or _other_units(text, reading)
        if settings or _MISSING.search(text):
            found[text[:60]] = Remedy(settings, "if that is right")
    if found:
        yield Notice(
            "STATED_UNUSED",
            numbers={"case": "line", "said": "; ".join(map(repr, found))},
            remedies=tuple(one for one in dict.fromkeys(found.values()) if one.settings),
        )


def _convention(text: str, profile: Profile) -> dict[str, object]:
    """The setting of a profile that a line states, and nobody set."""
    match = _KEY.search(text)
    if match is None:
        return {}
    key, value = match[1].lower(), match[2].lower()
    known = value in _CONVENTIONS.get(key, ()) and value != getattr(profile, key)
    if known and key not in profile.model_fields_set and value != "raw":
        return {key: value}
    return {}


def stated_rate(said: Iterable[str]) -> float | None:
    """Samples a second that a line states."""
    for line in said:
        match = _KEY.search(line)
        if match and match[1].lower() in _RATES:
            try:
                return float(match[2])
            except ValueError:
                continue
    return None


def other_rate(stated: float | None, stamp_ns: IntArray) -> tuple[Notice, ...]:
    """What to say of a stated rate that the first stamps (N,) contradict."""
    period = usual_period(stamp_ns) if stamp_ns.size > 1 else 0.0
    if not stated or period <= 0 or abs(stated * period - 1) < _SAME_RATE:
        return ()
    said = f"{stated:g} Hz"
    numbers = {"case": "rate", "said": said, "rate": 1 / period}
    return (Notice("STATED_UNUSED", numbers=numbers),)


def _other_units(text: str, reading: Reading) -> dict[str, object]:
    """Settings for the units in a line in which the signals are not read.

    A unit behind a number is that of a quantity, ``30 deg``.
    """
    letters = text.replace(",", " ").split()
    settings: dict[str, object] = {}
    for place, word in enumerate(letters):
        before = letters[place - 1].lower() if place else ""
        bare = word.strip("[](){};.\"'*")
        if re.fullmatch(r"[-+~±]?\d.*", before) or bare in ("", "a"):
            continue
        sure = before in _BEFORE_UNIT or before[-1:] in ":=" or word[:1] in "[("
        pair = f"{bare} {letters[place + 1].strip('])}.')}" if place + 1 < len(letters) else bare
        unit = unit_of(pair) if " " in pair else None
        if unit is None and (sure or bare.lower() not in _COMMON):
            unit = unit_of(bare)
        if unit is not None:
            settings |= _for_unit(unit, bare, text, reading)
        elif sure and is_foreign(bare) and bare not in _COMMON:
            of_word = set(re.findall(r"\w+", text.lower()))
            for name in reading.channels:
                if name[:-1] in _WORDS and not of_word.isdisjoint(_WORDS[name[:-1]]):
                    settings[f"{name}.unit"] = None
    return settings


def _for_unit(unit: str, written: str, text: str, reading: Reading) -> dict[str, object]:
    """Settings that read every signal that can have a unit in it."""
    if unit in NANOSECONDS:
        timed = not _WORDS["t"].isdisjoint(re.findall(r"\w+", text.lower()))
        of_column = reading.clock == "column" and timed and unit != (reading.time_unit or "s")
        return {"time_unit": unit} if of_column else {}
    quantities = ("tau",)
    if unit in VELOCITY or unit == "counts":
        quantities = ("omega",) if "/" in written or unit not in ANGLE else ("theta",)
    elif unit not in TORQUE and unit not in CURRENT:
        return {}
    return {
        f"{name}.unit": unit
        for name, channel in reading.channels.items()
        if name.startswith(quantities)
        and channel.unit != unit
        and channel.factor
        and channel.told not in ("flag", "profile")
    }


def several(name: str, values: Iterable[object]) -> Notice:
    """What to say of a column or field by which rows are of several arms or recordings."""
    numbers = {"case": "columns", "column": name, "values": sorted(map(str, values))[:_MOST]}
    return Notice("STATED_UNUSED", numbers=numbers)


def settings_unused(
    profile: Profile, reading: Reading, mapping: Mapping[str, str]
) -> Iterator[Notice]:
    """One notice of the settings that a profile has and no step of reading consumed."""
    given = {name for name in profile.model_fields_set if getattr(profile, name) is not None}
    if reading.clock == "column":
        useless = {"topic", "clock"}
        useless |= {f"{name}.topic" for name in profile.channels if profile.channel(name).topic}
        if reading.time_unit == "ns" != profile.time_unit:
            useless.add("time_unit")
        if not mapping["t"].startswith("rows at"):
            useless.add("rate")
        if set(profile.columns or ()).isdisjoint(mapping.values()):
            useless.add("columns")
    else:
        useless = {"time", "time_unit", "rate", "columns"}
    if "omega1" in profile.channels and "omega1" not in mapping:
        useless |= {"omega1", "omega2"} | ({"velocity"} if profile.velocity else set())
    if "q_des1" in profile.channels and "q_des1" not in mapping:
        useless |= {"q_des1", "q_des2"}
    names = [name for name in useless if name.partition(".")[0] in given]
    if names:
        yield Notice(
            "STATED_UNUSED",
            numbers={"case": "setting", "said": ", ".join(sorted(names))},
        )
