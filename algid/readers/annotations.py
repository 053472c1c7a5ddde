"""What a log states beside its signals: units, conventions, a rate, several arms.

Units in attributes, and in keys of metadata, are applied. What else of a known vocabulary is
stated and not used is told by one notice, with the settings that apply it: a sentence of a comment
may mean something else.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from algid.base.units import CURRENT, NANOSECONDS, TORQUE, is_foreign, unit_of
from algid.log import KEY, IntArray, Reading, usual_period
from algid.notices import Notice, Remedy
from algid.readers.column_names import CURRENTS, STEMS, TIMES, take_apart, words
from algid.readers.table import REFERENCES, VELOCITIES

if TYPE_CHECKING:
    from algid.profile import Profile

_UNIT_KEY = re.compile(r"units?[.:_ /](.+)|(.+)[.:_ /]units?", re.IGNORECASE)
_KEY = re.compile(r"[\W\d]*(\w+) ?[:=] ?\"?([\w.-]+)(?: ?hz)?\"?$", re.IGNORECASE)
_CONVENTIONS = {
    "zero": ("horizontal", "hanging", "upright"),
    "second_angle": ("relative", "absolute"),
    "drive": ("joint", "base"),
    "effort": (
        "gravity-compensated", "friction-compensated", "external", "command", "current",
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
_TIME_WORDS = frozenset((*TIMES, "times", "timestamps", "stamps"))
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
    for key, value in metadata.items():
        named: Mapping[str, object] = {}
        if key.lower() in ("unit", "units"):
            named = object_in(value)
        elif match := _UNIT_KEY.fullmatch(key):
            named = {match[1] or match[2]: value}
        for name, unit in named.items():
            if isinstance(unit, str) and (unit_of(unit) is not None or is_foreign(unit)):
                units |= dict.fromkeys(_called(name, columns), unit.strip())
    return units


def object_in(text: str) -> dict[str, Any]:
    """What a JSON object holds; empty where a text is none."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _called(name: str, columns: Sequence[str]) -> list[str]:
    """The columns that a name stands for: the one so called, or those of a joint or a quantity."""
    plain = name.strip().lower()
    if exact := [column for column in columns if column.lower() == plain]:
        return exact[:1]
    part = take_apart(plain)
    stems = {part.stem, part.stem.removeprefix("joint_")}
    stems |= {stem.removesuffix("s") for stem in stems}
    for known in (*STEMS.values(), TIMES) if part.joint is None else ():
        if not stems.isdisjoint(known):
            stems |= {one for one in known if (one in CURRENTS) == (part.stem in CURRENTS)}
    parts = {column: take_apart(column) for column in columns}
    return [
        column
        for column, own in parts.items()
        if own.stem in stems and part.joint in (None, own.joint)
    ]


def lines_of(metadata: Mapping[str, str]) -> Iterator[str]:
    """Metadata as lines of text, without the units that `units_in` applies."""
    for key, value in metadata.items():
        if key in ("pandas", "ARROW:schema", KEY):
            continue
        known = key.lower() in ("unit", "units") and object_in(value)
        if not (known or _UNIT_KEY.fullmatch(key)):
            yield f"{key}: {value}"


def unused(said: Iterable[str], reading: Reading, profile: Profile) -> Iterator[Notice]:
    """One notice of the `said` lines of text that state what is not used."""
    found: dict[str, Remedy] = {}
    for line in said:
        text = " ".join(line.split())
        key, value = _stated(text)
        settings = dict(_other_units(text, reading))
        if value in _CONVENTIONS.get(key, ()) and key not in profile.model_fields_set:
            settings = {key: value}
        if settings or _MISSING.search(text):
            found[text[:60]] = Remedy(settings, "if that is right")
    if found:
        yield Notice(
            "STATED_UNUSED",
            numbers={"case": "line", "said": "; ".join(map(repr, found))},
            remedies=tuple(one for one in dict.fromkeys(found.values()) if one.settings),
        )


def _stated(line: str) -> tuple[str, str]:
    """Key and value of a line, ``zero = hanging``, in lower case; empty where there is none."""
    match = _KEY.search(line)
    return (match[1].lower(), match[2].lower()) if match else ("", "")


def stated_rate(said: Iterable[str]) -> float | None:
    """Samples a second that a line states."""
    for line in said:
        key, value = _stated(line)
        if key in _RATES and re.fullmatch(r"\d+\.?\d*", value):
            return float(value)
    return None


def other_rate(stated: float | None, stamp_ns: IntArray) -> tuple[Notice, ...]:
    """What to say of a stated rate that the first stamps (N,) contradict."""
    period = usual_period(stamp_ns) if stamp_ns.size > 1 else 0.0
    if not stated or period <= 0 or abs(stated * period - 1) < _SAME_RATE:
        return ()
    numbers = {"case": "rate", "said": f"{stated:g} Hz", "rate": 1 / period}
    return (Notice("STATED_UNUSED", numbers=numbers),)


def _other_units(text: str, reading: Reading) -> Iterator[tuple[str, object]]:
    """Settings for the units that a line names, and in which no signal is read.

    A unit behind a number is that of a quantity, ``30 deg``. One that is a word of English too
    counts in brackets, or behind a word such as ``in``.
    """
    letters, spoken = text.replace(",", " ").split(), set(re.findall(r"\w+", text.lower()))
    for before, word, behind in zip(["", *letters], letters, [*letters[1:], ""], strict=False):
        bare = word.strip("[](){};.\"'*")
        sure = before.lower() in _BEFORE_UNIT or before[-1:] in tuple(":=") or word[:1] in "[("
        if re.match(r"[-+~±]?\d", before) or bare in ("", "a"):
            continue
        unit = unit_of(f"{bare} {behind.strip('])}.')}") if behind else None
        if unit is None and (sure or bare.lower() not in _COMMON):
            unit = unit_of(bare)
        quantity = "omega" if "/" in bare or unit == "rpm" else "theta"
        if unit in TORQUE or unit in CURRENT:
            quantity = "tau"
        elif unit in NANOSECONDS:
            timed = not _TIME_WORDS.isdisjoint(spoken)
            if timed and reading.clock == "column" and unit != (reading.time_unit or "s"):
                yield "time_unit", unit
            continue
        elif unit is None:
            if not (sure and is_foreign(bare) and bare not in _COMMON):
                continue
            named = (one for one in ("theta", "tau") if not spoken.isdisjoint(STEMS[one]))
            quantity = next(named, "nothing")
        for name, channel in reading.channels.items():
            own = channel.factor and channel.told not in ("flag", "profile")
            if name.startswith(quantity) and own and channel.unit != unit:
                yield f"{name}.unit", unit


def several(name: str, values: Iterable[object]) -> Notice:
    """What to say of a column or field by which rows are of several arms or recordings."""
    numbers = {"case": "columns", "column": name, "values": sorted(map(str, values))[:_MOST]}
    return Notice("STATED_UNUSED", numbers=numbers)


def settings_unused(
    profile: Profile, reading: Reading, mapping: Mapping[str, str]
) -> Iterator[Notice]:
    """One notice of the settings that a profile has and no step of reading consumed."""
    by_column = reading.clock == "column"
    idle = {
        "topic": by_column,
        "clock": by_column,
        "time": not by_column,
        "time_unit": not by_column or reading.time_unit == "ns" != profile.time_unit,
        "rate": not mapping["t"].startswith("rows at"),
        "columns": set(profile.columns or ()).isdisjoint(mapping.values()),
    }
    for name in profile.channels:
        idle[name] = name in (*VELOCITIES, *REFERENCES) and name not in mapping
        idle[f"{name}.topic"] = by_column and bool(profile.channel(name).topic)
    idle["velocity"] = idle.get("omega1", False) and profile.velocity == "measured"
    given = profile.model_dump(exclude_unset=True)
    # a channel's table that is empty, as a drafted profile has it, says nothing
    gone = {name for name, value in given.items() if value is None or value == {}}
    known = given.keys() - gone
    names = [name for name, is_idle in idle.items() if is_idle and name.partition(".")[0] in known]
    if names:
        yield Notice(
            "STATED_UNUSED",
            numbers={"case": "setting", "said": ", ".join(sorted(names))},
        )
