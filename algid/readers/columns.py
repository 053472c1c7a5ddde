"""Columns of a flat log, chosen by a profile and by their names, for every flat format."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.units import CURRENT, TORQUE, unit_of
from algid.log import Reading
from algid.notices import Notice, Remedy
from algid.readers.column_names import (
    COMMANDED,
    CURRENTS,
    choose,
    on_motor_side,
    other_joints,
    take_apart,
    units_in_names,
)
from algid.readers.joints import reading_of
from algid.readers.table import JOINT_CHANNELS, REFERENCES, VELOCITIES

if TYPE_CHECKING:
    from algid.profile import Profile


@dataclass(frozen=True)
class ChannelSources:
    """By canonical channel its column and the unit that the file states; the unit of the time.

    `time_stated`: a name or a profile states the unit of time; otherwise it is only taken to be
    so. `others` has by joint the angle columns of the joints not used; `reading` has the joints
    used, and where that choice came from. `rate` in Hz is that of rows without a time.
    """

    sources: Mapping[str, str]
    units: Mapping[str, str]
    time_unit: str | None
    notices: tuple[Notice, ...] = ()
    time_stated: bool = False
    reading: Reading = field(default_factory=Reading)
    others: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None


def choose_columns(
    path: str,
    available: Sequence[str],
    profile: Profile,
    stated: Mapping[str, str],
    written: Collection[str] = (),
) -> ChannelSources:
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
    sources, joints = _sources(path, available, profile)
    units = units_in_names(sources, stated)
    notices: list[Notice] = []
    stems = {name: take_apart(column).stem for name, column in sources.items()}
    if stems.get("tau1") in COMMANDED and profile.effort != "command":
        columns = f"{sources['tau1']}, {sources['tau2']}"
        notices.append(Notice("COMMANDED_TORQUE", numbers={"columns": columns}))
    all_named = all(profile.channel(name).column for name in profile.needed)
    reading = Reading(joints_told="profile" if all_named else "names")
    if profile.joints or (joints and not all_named):
        reading, order = reading_of(joints or (), profile)
        notices += order
    notices += _of_units(path, sources, units, stated, profile)
    currents = [name for name in ("tau1", "tau2") if stems.get(name) in CURRENTS]
    notices += _of_motors(path, sources, currents, profile)
    units = {name: unit for name, unit in units.items() if unit_of(unit)}
    of_time = profile.time_unit or units.get("t")
    if all(sources[name] == name for name in ("t", *profile.needed)):
        units.setdefault("t", "s")  # algid's own names mean algid's own units
    angles = [sources[name] for name in ("theta1", "theta2") if name in sources]
    found = ChannelSources(
        sources,
        units,
        of_time or units.get("t"),
        tuple(notices),
        of_time is not None,
        reading,
        other_joints(available, angles),
    )
    if sources["t"]:
        return found
    sources["t"] = sources[profile.needed[0]]  # any column has a cell in each row that is counted
    return replace(found, time_unit="ns", time_stated=True, rate=profile.rate)


def _sources(
    path: str, available: Sequence[str], profile: Profile
) -> tuple[dict[str, str], tuple[str, str] | None]:
    """By canonical channel its column, and the joints' own names."""
    named = {}
    for name in profile.channels:
        if column := profile.channel(name).column:
            named[name] = column
    if profile.time:
        named["t"] = profile.time
    listed = ", ".join(repr(name[:40]) for name in available[:16])
    if len(available) > 16:
        listed += f" and {len(available) - 16} more"
    for name, column in named.items():
        if column not in available:
            raise LogError(
                f"{path}: {name} is to be taken from {column!r}, which is not there; "
                f"found {listed}; name another: {_naming([name])}"
            )
    try:
        choice = choose(available, profile.joints, named, profile.passive, profile.needed)
    except LookupError as error:
        two = Remedy({"joints": None}, "choose two")
        raise LogError(
            f"{path}: {error}; {two}; or name each column: {_naming(['theta1'])} …"
        ) from error
    every = choice.columns | named
    sources = {name: column for name, column in every.items() if name in ("t", *profile.channels)}
    if profile.passive and f"tau{3 - profile.passive}" in sources:
        # a joint without a motor needs no torque of its own: what stands in its place is not
        # looked at
        sources.setdefault(f"tau{profile.passive}", sources[f"tau{3 - profile.passive}"])
    for joint, torque in (("1", profile.tau1), ("2", profile.tau2)):
        if torque.q_des and f"q_des{joint}" in profile.channels and "tau1" in profile.channels:
            # what the controller follows makes the torque
            sources.setdefault(f"q_des{joint}", torque.q_des)
    for pair, read in ((REFERENCES, True), (VELOCITIES, profile.velocity)):
        if not (read and sources.keys() >= set(pair)):
            sources = {name: column for name, column in sources.items() if name not in pair}
    if profile.rate is not None:
        sources.setdefault("t", "")
    missing = [name for name in ("t", *profile.needed) if name not in sources]
    if missing:
        text = f"{path}: no column for {', '.join(missing)}; found {listed}; "
        text += f"name them: {_naming(missing)}"
        if "t" in missing:
            rate = "; or give the samples a second of a log without a time"
            text += str(Remedy({"rate": None}, rate))
        if {"tau1", "tau2"} <= set(missing):
            text += str(Remedy({"torque_file": None}, "; or take them from another file"))
            text += (
                "; a PD law makes them of q_des, kp and kd of [tau1] and [tau2] (algid guide logs)"
            )
        raise LogError(text)
    return sources, choice.joints


def _naming(channels: Sequence[str]) -> Remedy:
    """Settings that name the columns of channels."""
    return Remedy({"time" if name == "t" else f"{name}.source": None for name in channels})


def _of_units(
    path: str,
    sources: Mapping[str, str],
    units: Mapping[str, str],
    stated: Mapping[str, str],
    profile: Profile,
) -> Iterator[Notice]:
    """What to say of units that no joint's signal has, and where file, name and user differ.

    Raises
    ------
    LogError
        Where a unit is none of a joint, and the user names no other.
    """
    for name, unit in units.items():
        column = {"column": sources[name], "name": name}
        given = profile.time_unit if name == "t" else profile.channel(name).unit
        beside = unit_of(stated.get(sources[name], unit))
        if unit_of(unit) is None:
            # a reference may be in any unit: it is an instrument, of which the scale says nothing
            if name == "t" or name in REFERENCES:
                continue
            if given is None:
                usual = "N m" if name.startswith("tau") else "rad"
                right = Remedy({f"{name}.unit": usual}, "say its unit if that is wrong")
                raise LogError(
                    f"{path}: the column {sources[name]!r} for {name} is in {unit!r}, which is no "
                    f"unit of a joint; {right}"
                )
            numbers = {"case": "foreign", **column, "unit": unit, "given": given}
        elif given not in (None, unit) and not (given in TORQUE and unit in CURRENT):
            numbers = {"case": "stated", **column, "unit": unit}
            numbers |= {"taken": given, "why": "as configured"}
        elif given is None and beside not in (None, unit):
            numbers = {"case": "stated", **column, "unit": beside}
            numbers |= {"taken": unit, "why": "as its name says"}
        else:
            continue
        yield Notice("OTHER_UNIT", numbers=numbers)


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
