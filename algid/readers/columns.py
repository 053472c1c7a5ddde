"""Columns of a flat log, chosen by a profile and by their names, for every flat format."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.units import CURRENT, TORQUE, unit_of
from algid.log import Reading
from algid.notices import Notice, Remedy
from algid.readers.joints import reading_of
from algid.readers.names import (
    COMMANDED,
    CURRENTS,
    ChannelChoice,
    choose,
    on_motor_side,
    other_joints,
    take_apart,
)
from algid.readers.table import CHANNELS, JOINT_CHANNELS, REFERENCES, VELOCITIES

if TYPE_CHECKING:
    from algid.profile import Profile


@dataclass(frozen=True)
class Columns:
    """By canonical channel its column; the units that names state; the unit of time, where known.

    `time_stated`: a name or a profile states the unit of time; otherwise it is only taken to be
    so. `others` has by joint the column of its angle, of the joints that are not read; `reading`
    says which are and who said so.
    """

    sources: Mapping[str, str]
    units: Mapping[str, str]
    time_unit: str | None
    notices: tuple[Notice, ...] = ()
    time_stated: bool = False
    reading: Reading = field(default_factory=Reading)
    others: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    """Hz, of rows that are counted: there is no time."""
    said: tuple[str, ...] = ()
    """What the file states in words: comments, and metadata."""

    def dated(self) -> Columns:
        """The same with a time that holds dates or durations, which come in ns."""
        return replace(self, time_unit="ns", time_stated=True)


def assign(
    path: str,
    available: Sequence[str],
    profile: Profile,
    stated: Mapping[str, str],
    written: Collection[str] = (),
) -> Columns:
    """Choose the columns of a flat log: those a profile names, the rest by their names.

    Parameters
    ----------
    path : str
    available : sequence of str
        Every column of the file.
    profile : Profile
    stated : mapping
        Units by column that the file states elsewhere than in the columns' names.
    written : collection of str
        Columns that algid wrote into the file.

    Raises
    ------
    LogError
        If a column is missing, or stands there for more joints than two; if a unit is no unit of a
        joint's signal.
    """
    gone = [name for name in written if name not in available]
    if gone:
        raise LogError(
            f"{path}: the columns {', '.join(gone)} that were written are not there: the file was "
            "changed or damaged; write it again, or remove its truth if it was changed on purpose"
        )
    named = {}
    for name in profile.channels:
        column = profile.channel(name).column
        if column:
            named[name] = column
    if profile.time:
        named["t"] = profile.time
    sources, choice = _sources(path, available, named, profile)
    beside = {name: stated[column] for name, column in sources.items() if column in stated}
    torques = _chosen(sources, ("tau1", "tau2"))
    units, foreign = _units(sources, choice, beside)
    currents = []
    for name in ("tau1", "tau2"):
        if name in sources and take_apart(sources[name]).stem in CURRENTS:
            currents.append(name)
            if units.get(name) not in CURRENT:
                units[name] = "A"
    all_named = set(profile.needed) <= named.keys()
    reading = Reading(joints_told="profile" if all_named else "names")
    order: tuple[Notice, ...] = ()
    if profile.joints or (choice.joints and not all_named):
        reading, order = reading_of(choice.joints or (), profile)
    said = []
    if torques and take_apart(torques[0]).stem in COMMANDED and profile.effort != "command":
        said.append(Notice("COMMANDED_TORQUE", numbers={"columns": ", ".join(torques)}))
    said += order
    said += _of_foreign_units(path, sources, foreign, profile)
    said += _of_motors(path, sources, currents, profile)
    said += _of_other_units(sources, units, beside, profile)
    of_time = profile.time_unit or units.get("t")
    if sources["t"] == "t" and all(sources[name] == name for name in profile.needed):
        units.setdefault("t", "s")  # algid's own names mean algid's own units
    others = other_joints(available, _chosen(sources, ("theta1", "theta2")))
    if not sources["t"]:
        # any column has a cell in each row that is counted
        sources["t"] = sources[profile.needed[0]]
        return Columns(sources, units, "ns", tuple(said), True, reading, others, profile.rate)
    return Columns(
        sources, units, of_time or units.get("t"), tuple(said), of_time is not None, reading, others
    )


def _units(
    sources: Mapping[str, str], choice: ChannelChoice, beside: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Units by channel, those that algid knows and others.

    A column's name says them, or else what the file states `beside`.
    """
    units: dict[str, str] = {}
    of_names: dict[str, str] = {}
    foreign: dict[str, str] = {}
    for name, column in choice.columns.items():
        if sources.get(name) == column:
            if name in choice.units:
                of_names[name] = choice.units[name]
            if name in choice.foreign:
                foreign[name] = choice.foreign[name]
    for name, unit in beside.items():
        known = unit_of(unit)
        if known is None:
            foreign[name] = unit
        else:
            units[name] = known
    return units | of_names, foreign


def _sources(
    path: str, available: Sequence[str], named: Mapping[str, str], profile: Profile
) -> tuple[dict[str, str], ChannelChoice]:
    """By canonical channel its column, and what the names alone would choose."""
    for name, column in named.items():
        if column not in available:
            raise LogError(
                f"{path}: {name} is to be taken from {column!r}, which is not there; "
                f"found {_listed(available)}; name another: {_naming([name])}"
            )
    try:
        choice = choose(available, profile.joints, named, profile.passive, profile.needed)
    except LookupError as error:
        two = Remedy({"joints": None}, "choose two")
        raise LogError(
            f"{path}: {error}; {two}; or name each column: {_naming(['theta1'])} …"
        ) from error
    read = {"t"} | set(profile.channels)
    every = choice.columns | dict(named)
    sources = {name: column for name, column in every.items() if name in read}
    if profile.passive and f"tau{3 - profile.passive}" in sources:
        # a joint without a motor needs no torque of its own: what stands in its place is not
        # looked at
        sources.setdefault(f"tau{profile.passive}", sources[f"tau{3 - profile.passive}"])
    for name, law in (("q_des1", profile.tau1.q_des), ("q_des2", profile.tau2.q_des)):
        if law and {name, "tau1"} <= read:  # what the controller follows makes the torque
            sources.setdefault(name, law)
    if not sources.keys() >= set(REFERENCES):
        _leave_out(sources, REFERENCES)
    if not (profile.velocity and sources.keys() >= set(VELOCITIES)):
        _leave_out(sources, VELOCITIES)
    if profile.rate is not None:
        sources.setdefault("t", "")
    missing = [] if "t" in sources else ["t"]
    missing += [name for name in profile.needed if name not in sources]
    if missing:
        text = f"{path}: no column for {', '.join(missing)}; found {_listed(available)}"
        raise LogError(
            f"{text}; name them: {_naming(missing)}{_or_a_rate(missing)}{_or_a_law(missing)}"
        )
    return sources, choice


def _chosen(sources: Mapping[str, str], channels: Sequence[str]) -> list[str]:
    """The columns of those channels that have one."""
    return [sources[name] for name in channels if name in sources]


def _leave_out(sources: dict[str, str], channels: Iterable[str]) -> None:
    for name in channels:
        sources.pop(name, None)


def _or_a_rate(missing: Sequence[str]) -> str:
    """What else to say of a log without a time."""
    if "t" not in missing:
        return ""
    return str(Remedy({"rate": None}, "; or give the samples a second of a log without a time"))


def _or_a_law(missing: Sequence[str]) -> str:
    """What else makes torques where both are `missing`."""
    if not {"tau1", "tau2"} <= set(missing):
        return ""
    other = Remedy({"torque_file": None}, "; or take them from another file")
    law = "a PD law makes them of q_des, kp and kd of [tau1] and [tau2] (algid guide logs)"
    return f"{other}; {law}"


def _naming(channels: Sequence[str]) -> Remedy:
    """Settings that name the columns of channels."""
    return Remedy({"time" if name == "t" else f"{name}.source": None for name in channels})


def _listed(available: Sequence[str]) -> str:
    names = ", ".join(repr(name[:40]) for name in available[:16])
    if len(available) > 16:
        names += f" and {len(available) - 16} more"
    return names


def _of_foreign_units(
    path: str, sources: Mapping[str, str], foreign: Mapping[str, str], profile: Profile
) -> Iterator[Notice]:
    """What to say of units that no joint's signal has.

    They are refused unless the user names the right one.

    Raises
    ------
    LogError
        Where the user names no unit of a joint for them.
    """
    # a reference may be in any unit: it is an instrument, of which the scale says nothing
    for name in foreign:
        if name not in CHANNELS or name in REFERENCES:
            continue
        given = profile.channel(name).unit
        if given is None:
            usual = "N m" if name.startswith("tau") else "rad"
            right = Remedy({f"{name}.unit": usual}, "say its unit if that is wrong")
            raise LogError(
                f"{path}: the column {sources[name]!r} for {name} is in {foreign[name]!r}, which "
                f"is no unit of a joint; {right}"
            )
        column = {"column": sources[name], "name": name}
        yield Notice(
            "OTHER_UNIT",
            numbers={"case": "foreign", **column, "unit": foreign[name], "given": given},
        )


def _of_motors(
    path: str, sources: Mapping[str, str], currents: Sequence[str], profile: Profile
) -> Iterator[Notice]:
    """What to say of motors' signals.

    Beside joints' they are refused unless the user gives the gear.

    Raises
    ------
    LogError
        Where the user gives no gear ratio.
    """
    for name in currents:
        given = profile.channel(name).unit
        if given in TORQUE:
            numbers = {"column": sources[name], "name": name, "given": given}
            yield Notice("OTHER_UNIT", numbers={"case": "current"} | numbers)
    of_joints = False
    open_ones = []
    for name in JOINT_CHANNELS:
        if name not in sources:
            continue
        geared = "gear_ratio" in profile.channel(name).model_fields_set
        if not on_motor_side(sources[name]):
            of_joints = True
        elif name not in currents and not geared:
            open_ones.append(name)
    if not open_ones:
        return
    named = ", ".join(f"{name} ({sources[name]})" for name in open_ones)
    gears = Remedy(
        {f"{name}.gear_ratio": None for name in open_ones},
        "tell the gear, turns of the motor in one of the joint, 1 for a direct drive",
    )
    if of_joints:
        raise LogError(f"{path}: {named}: signals of motors beside those of joints; {gears}")
    yield Notice("OTHER_UNIT", numbers={"case": "motor", "columns": named}, remedies=(gears,))


def _of_other_units(
    sources: Mapping[str, str],
    units: Mapping[str, str],
    beside: Mapping[str, str],
    profile: Profile,
) -> Iterator[Notice]:
    """Notices where the file's unit differs from the user's, or the stated one from the name's."""
    for name, unit in units.items():
        given = profile.time_unit if name == "t" else profile.channel(name).unit
        other = unit_of(beside.get(name, unit))
        if given not in (None, unit) and not (given in TORQUE and unit in CURRENT):
            numbers = {"unit": unit, "taken": given, "why": "as configured"}
        elif given is None and other not in (None, unit):
            numbers = {"unit": other, "taken": unit, "why": "as its name says"}
        else:
            continue
        yield Notice(
            "OTHER_UNIT",
            numbers={"case": "stated", "name": name, "column": sources[name], **numbers},
        )
