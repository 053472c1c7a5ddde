"""Columns of a flat log, chosen by a profile and by their names, for every flat format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.units import TORQUE, unit_of
from algid.notices import Notice, Remedy
from algid.readers.column_names import (
    COMMANDED,
    CURRENTS,
    choose,
    on_motor_side,
    take_apart,
)
from algid.readers.table import JOINT_CHANNELS, REFERENCES, VELOCITIES

if TYPE_CHECKING:
    from algid.profile import Profile


def choose_columns(
    path: str, available: Sequence[str], profile: Profile
) -> tuple[dict[str, str], tuple[str, str] | None]:
    """By canonical channel its column, and the joints' own names.

    A profile names columns, else their names tell. Of rows without a time there is no "t".

    Raises
    ------
    LogError
        If a column is missing, or stands there for more joints than two.
    """
    by_user = {name: profile.channel(name).column for name in profile.channels}
    by_user["t"] = profile.time
    named = {name: column for name, column in by_user.items() if column}
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
    sources = choice.columns | named
    if profile.passive and (driven := sources.get(f"tau{3 - profile.passive}")):
        # of a joint without a motor nothing is looked at
        sources.setdefault(f"tau{profile.passive}", driven)
    for reference, torque in zip(REFERENCES, (profile.tau1, profile.tau2), strict=True):
        if torque.q_des and "tau1" in profile.channels:
            # what the controller follows makes the torque
            sources.setdefault(reference, torque.q_des)
    for pair in (REFERENCES, VELOCITIES):
        if not sources.keys() >= set(pair) or (
            pair is VELOCITIES and profile.velocity == "observer"
        ):
            sources = {name: column for name, column in sources.items() if name not in pair}
    sources = {name: one for name, one in sources.items() if name in ("t", *profile.channels)}
    needed = profile.needed if profile.rate is not None else ("t", *profile.needed)
    missing = [name for name in needed if name not in sources]
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


def doubts(
    path: str, sources: Mapping[str, str], stated: Mapping[str, str], profile: Profile
) -> Iterator[Notice]:
    """What to say of commands, of units that differ in a name and beside it, and of motors.

    `stated` are units by column that the file states elsewhere than in the columns' names. Motors'
    signals are told where nobody tells their gear, currents where they are taken for torques.

    Raises
    ------
    LogError
        If motors' signals stand beside those of joints.
    """
    if take_apart(sources.get("tau1", "")).stem in COMMANDED and profile.effort != "command":
        columns = f"{sources['tau1']}, {sources['tau2']}"
        yield Notice("COMMANDED_TORQUE", numbers={"columns": columns})
    of_joints, of_motors = list[str](), list[str]()
    for name, column in sources.items():
        user = profile.time_unit if name == "t" else profile.channel(name).unit
        said, beside = unit_of(take_apart(column).unit or ""), unit_of(stated.get(column, ""))
        numbers = {"case": "stated", "column": column, "name": name, "unit": said or beside}
        if name == "t" and user and numbers["unit"] not in (None, user):
            numbers |= {"taken": user, "why": "as configured"}
            yield Notice("OTHER_UNIT", numbers=numbers)
        elif said and beside and said != beside and not user:
            numbers |= {"unit": beside, "taken": said, "why": "as its name says"}
            yield Notice("OTHER_UNIT", numbers=numbers)
        if name not in JOINT_CHANNELS:
            continue
        current = name.startswith("tau") and take_apart(column).stem in CURRENTS
        if current and user in TORQUE:
            numbers = {"case": "current", "column": column, "name": name, "given": user}
            yield Notice("OTHER_UNIT", numbers=numbers)
        if not on_motor_side(column):
            of_joints.append(name)
        elif not (current or "gear_ratio" in profile.channel(name).model_fields_set):
            of_motors.append(name)
    if not of_motors:
        return
    named = ", ".join(f"{name} ({sources[name]})" for name in of_motors)
    gears = Remedy(
        {f"{name}.gear_ratio": None for name in of_motors},
        "tell the gear, turns of the motor in one of the joint, 1 for a direct drive",
    )
    if of_joints:
        raise LogError(f"{path}: {named}: signals of motors beside those of joints; {gears}")
    yield Notice("OTHER_UNIT", numbers={"case": "motor", "columns": named}, remedies=(gears,))
