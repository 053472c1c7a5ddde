"""Meaning of column names that labs, drivers and plotting tools give to angles and torques.

A name is taken apart into a stem, a joint and a unit, ``pos_meas1 [deg]`` → ``pos_meas``, 1,
``deg``. The stems of each quantity are ranked: measured before unspecified before filtered,
commanded torque last. Commanded angles are the reference, and never angles.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

from algid.base.limits import LIMITS
from algid.base.text import counted
from algid.base.units import is_foreign, unit_of
from algid.readers.joints import along_the_arm


def words(text: str) -> tuple[str, ...]:
    """The words of a text, in their order."""
    return tuple(text.split())


STEMS: dict[str, tuple[str, ...]] = {
    "theta": words(
        """
        theta theta_meas pos_meas q_meas position_measured measured_position actual_q
        position pos q angle joint_position joint_pos joint_angle jointposition
        positions angles ang phi pos_filt q_filt position_filtered theta_filt
        observation_position observation_state
        """
    ),
    "omega": words(
        """
        omega vel_meas dq_meas velocity_measured measured_velocity actual_qd
        velocity vel dq qd qdot q_dot dtheta thetadot theta_dot
        joint_velocity joint_vel velocities speed vel_filt dq_filt velocity_filtered
        observation_velocity
        """
    ),
    "tau": words(
        """
        tau tau_meas tau_j tau_est torque_measured measured_torque actual_tau actual_torque
        torque trq effort joint_torque joint_effort torques efforts tau_filt
        torque_filtered tau_con tau_cmd tau_des tau_d tau_j_d torque_cmd target_torque
        motor_torque observation_effort observation_torque
        actual_current current currents motor_current joint_current i_q iq
        """
    ),
    "q_des": words(
        """
        q_des q_desired q_d q_ref q_reference q_cmd q_target target_q
        theta_des theta_desired theta_d theta_ref theta_cmd theta_target
        pos_des pos_desired pos_ref pos_cmd pos_target target_pos
        position_desired desired_position position_reference reference_position
        position_command commanded_position target_position position_target
        """
    ),
}
COMMANDED = frozenset(words("tau_con tau_cmd tau_des tau_d tau_j_d torque_cmd target_torque"))
CURRENTS = frozenset(words("actual_current current currents motor_current joint_current i_q iq"))
TIMES = words(
    """
    stamp_ns t time timestamp stamp __time _time time_s time_ms time_us time_ns
    timestamp_s timestamp_ms timestamp_us timestamp_ns t_s t_ms t_us t_ns time_sec
    seconds secs sec elapsed elapsed_time log_time header.stamp header/stamp
    milliseconds millis microseconds micros nanoseconds nanos
    """
)
_NO_JOINTS = frozenset(
    words(
        """
        cmd command commanded ref reference des desired target goal set setpoint error err raw
        max min limit old new filt filtered meas measured actual est
        """
    )
)
"""Words before or behind a stem that name no joint."""
_STEMS = sorted(set(chain.from_iterable(STEMS.values())), key=lambda stem: (-len(stem), stem))
"""The stems of every quantity, the longest first."""
_MOTOR_SIDE = frozenset({"motor", "rotor", "drive"})
_BRACKET_UNIT = re.compile(r"^(.*\S)\s*[\[(]\s*([^\[\]()]*[^\[\]()\d\s][^\[\]()]*)\s*[\])]$")
_SUFFIX_UNIT = re.compile(
    r"^(.*[^_\W])_(deg(?:rees?)?|m?rad|rev|turns|counts|ticks|[mk]?nm|ncm|kgf?cm|kgf?m|"
    r"lbf?ft|lbf?in|ozf?in|ma|rpm|inch(?:es)?|"
    r"grad|volts?|s|secs?|seconds|[mun]s(?:ec)?|millis|micros|nanos|(?:milli|micro|nano)seconds)$"
)
_JOINT_NAMED = re.compile(r"^(.*/[^/]+)/(\w+)$")
_JOINT_PLACED = re.compile(r"^.*/(position|velocity|effort)[.\[/](\d+)\]?$")
_STATE = re.compile(
    r"^(?:\w+[./])*\w*state[./]?(?:\[(?P<joint>\d{1,3})\][./](?P<stem>\w+)"
    r"|(?<=[./])(?P<list>\w+)\[(?P<place>\d{1,3})\])$"
)
_JOINT_FIRST = re.compile(r"^(?:joint|axis|motor|link|j)[_ ]?(\d{1,3})[_./ ]+(.+)$")
_COUNTED = re.compile(r"(?:^|_)(?:joint|axis|dof|actuator)(?=_|\d|$)")
"""Words that a joint's number stands beside, and that name no joint."""
_LAST_NUMBER = re.compile(r"(?:_|\[)(\d+)\]?$")
_JOINT_LAST = re.compile(r"^(.*?[^\W\d])[_./ ]*\[?(\d{1,3})\]?$")


class Name(NamedTuple):
    """A column's name taken apart; `joint` is a number as text, or the joint's own name.

    `unit` is in algid's writing; one that no joint's signal has, such as inch, as it stands.
    Plain names, of `rank` 0, count before those of state structures, and these before joints' names
    beside words.
    """

    stem: str
    joint: str | None
    unit: str | None
    rank: int = 0

    @property
    def own(self) -> str:
        """The joint's own name, ``elbow`` of ``/joint_states/elbow``."""
        return (self.joint or "").rpartition("/")[2]

    @property
    def topic(self) -> str:
        """What stands before the joint's own name."""
        return (self.joint or "").rpartition("/")[0]


class ChannelChoice(NamedTuple):
    """Columns chosen for a log, by canonical channel; the joints' own names, if they have any."""

    columns: dict[str, str]
    joints: tuple[str, str] | None = None


@lru_cache(maxsize=1 << 13)
def take_apart(column: str) -> Name:
    """Stem, joint and unit of a column's name; case and blanks do not matter.

    A name longer than any of a joint's is its own stem: the patterns' time grows with its square.
    """
    text, unit = column.strip().strip('"').strip().lower(), None
    if len(text) > LIMITS.name_letters:
        return Name(text, None, None)
    for pattern in (_BRACKET_UNIT, _SUFFIX_UNIT):
        match = pattern.match(text)
        if match and (unit_of(match[2]) or is_foreign(match[2])):
            text, unit = match[1].strip(), unit_of(match[2]) or match[2]
            break
    if text in TIMES and (known := unit_of(text)):  # "millis" says its unit itself
        unit = known
    if (match := _JOINT_NAMED.match(text)) and match[2] in _STEMS:
        return Name(match[2], match[1], unit)
    if match := _JOINT_PLACED.match(text):
        return Name(match[1], match[2], unit)
    stem, joint = text, None
    for pattern, at, number in ((_JOINT_FIRST, 2, 1), (_JOINT_LAST, 1, 2)):
        if match := pattern.match(text):
            stem = match[at].replace(" ", "_").replace(".", "_")
            joint = match[number].lstrip("0") or "0"
            break
    if stem in _STEMS:
        return Name(stem, joint, unit)
    if match := _STATE.match(text):  # state.q[0] (libfranka), motor_state[0].q
        return Name(match["stem"] or match["list"], match["joint"] or match["place"], unit, 1)
    # a joint and a stem: shoulder_pos, torque elbow; with a number that counts them: dof_pos_2
    spelled = "_" + re.sub(r"\W+", "_", stem).strip("_") + "_"
    for known in _STEMS:
        if spelled.endswith(f"_{known}_"):
            own = spelled[: -len(known) - 2]
        elif spelled.startswith(f"_{known}_"):
            own = spelled[len(known) + 2 :]
        else:
            continue
        words = [word for word in (*_COUNTED.sub("_", own).split("_"), joint) if word]
        if words and _NO_JOINTS.isdisjoint(words):
            return Name(known, "_".join(words), unit, 2)
        break
    return Name(stem, joint, unit)


def on_motor_side(column: str) -> bool:
    """Whether a column's name says that it is the motor's signal, before any gear."""
    return not _MOTOR_SIDE.isdisjoint(re.findall(r"[a-z]+", column.lower()))


def choose(
    columns: Iterable[str],
    joints: tuple[str, str] | None = None,
    named: Collection[str] = (),
    passive: int | None = None,
    needed: Sequence[str] = ("theta1", "theta2", "tau1", "tau2"),
) -> ChannelChoice:
    """Canonical channels found among `columns`; those not found are left out.

    Parameters
    ----------
    columns : iterable of str
        Every column of the file.
    joints : pair of str, optional
        The two joints to take where a log has more: numbers, or names as in
        ``/joint_states/elbow/position`` or ``elbow_pos``.
    named : collection of str
        Canonical channels whose columns are given: what is chosen for them need not be plain.
    passive : 1, 2 or None
        The joint without a motor, whose torque need not be there.
    needed : sequence of str
        The canonical channels that make a log, or the half of one that stands in two files.

    Raises
    ------
    LookupError
        If a quantity stands there for more than two joints and `joints` does not choose, if there
        are no such joints, or if two columns have one name but for its writing.
    """
    names = {column: take_apart(column) for column in columns}
    wanted, tries = set(needed) - set(named), list[tuple[dict[str, str], dict[str, Name]]]()
    for rank in range(3):
        parts = {column: name for column, name in names.items() if name.rank <= rank}
        tries.append((_pairs(parts, joints), parts))
        if wanted <= tries[-1][0].keys():
            break
    chosen, parts = max(tries, key=lambda one: len(wanted & one[0].keys()))
    if joints and needed[0] in wanted - chosen.keys():
        there = dict.fromkeys(one.own for one in names.values() if one.joint and one.stem in _STEMS)
        raise LookupError(
            f"no columns of the joints {', '.join(joints)}; joints there are: "
            f"{', '.join(list(there)[:16]) or 'none that their names show'}"
        )
    if passive and "tau1" not in chosen:  # the driven joint's torque, or the only one
        driven = chosen.get(f"theta{3 - passive}")
        for stem in STEMS["tau"]:
            torques = [column for column, name in parts.items() if name.stem == stem]
            own = [one for one in torques if driven and parts[one].joint == parts[driven].joint]
            if len(own or torques) == 1:
                (chosen[f"tau{3 - passive}"],) = own or torques
                break
    angles = [parts[chosen[name]].joint for name in ("theta1", "theta2") if name in chosen]
    for channel, column in list(chosen.items()):
        name = parts[column]
        # drivers mix counting from zero and from one between quantities: the order counts then
        theirs = angles[int(channel[-1]) - 1] if angles else name.joint
        if name.joint not in (None, theirs) and not {name.joint, theirs} <= {"0", "1", "2"}:
            del chosen[channel]  # the torque of another joint is not theirs
        elif name.joint and channel not in (*named, "q_des1", "q_des2"):
            for twin, other in parts.items():
                if twin != column and name[:2] == other[:2]:
                    raise LookupError(
                        f"{column!r} and {twin!r} are both {name.stem} of joint {name.joint}"
                    )
    quantity = "theta" if angles else "tau"
    pair = (chosen.get(f"{quantity}1"), chosen.get(f"{quantity}2"))
    both = [name for column, name in parts.items() if column in pair]
    own = [name.own for name in both]
    if len(set(own)) < len(own):  # /left/arm/q and /right/arm/q
        own = [name.joint or "" for name in both]
    numbered = len(own) < 2 or all(name.isdecimal() for name in own)
    if time := time_among(names):
        chosen["t"] = time
    return ChannelChoice(chosen, None if numbered else (own[0], own[1]))


def _pairs(parts: Mapping[str, Name], joints: tuple[str, str] | None) -> dict[str, str]:
    """Columns by canonical channel, of quantities present for two joints, or for the given two."""
    chosen: dict[str, str] = {}
    for quantity, stems in STEMS.items():
        for stem in stems:
            of_stem = {}
            for column, name in parts.items():
                if name.stem == stem and name.joint:
                    of_stem[name.joint] = column
            if len(of_stem) > 2 and not joints:
                if quantity == "q_des":
                    continue  # the log is read without it
                there = ", ".join(list(of_stem)[:8])
                raise LookupError(
                    f"{stem!r} stands there for {counted(len(of_stem), 'joint')}: {there}"
                )
            if joints:
                pairs = [_of_joint(of_stem, joint) for joint in joints]
            else:
                short = {joint.rpartition("/")[2]: column for joint, column in of_stem.items()}
                of_stem = short if len(short) == len(of_stem) else of_stem
                order = along_the_arm(list(of_stem))[0] if len(of_stem) == 2 else ()
                pairs = [[of_stem[joint]] for joint in order]
            if [len(own) for own in pairs] == [1, 1]:
                chosen |= {f"{quantity}{place}": own[0] for place, own in enumerate(pairs, 1)}
                break
    return chosen


def _of_joint(of_stem: Mapping[str, str], joint: str) -> list[str]:
    """The columns by joint of one that a user names: ``Joint_2`` is joint 2 of ``Joint_2_pos``.

    So is its column, ``dof_pos_2``.
    """
    name = joint.strip().lower()
    names, part = {name, take_apart(f"{name} position").joint or name}, take_apart(name)
    if part.joint and part.stem in _STEMS:
        names.add(part.joint)
    columns = []
    for key, column in of_stem.items():
        own = key.rpartition("/")[2]
        number = _LAST_NUMBER.search(own) if name.isdecimal() else None
        if not names.isdisjoint((key, own, number and number[1])):
            columns.append(column)
    return columns


_NO_NAMES = frozenset(
    ("", "ch", "channel", "col", "column", "data", "f", "field", "signal", "v", "value", "var", "x")
)
"""Stems that number the columns of a table, which say of none that it is a joint's angle."""


def other_joints(columns: Iterable[str], angles: Collection[str]) -> dict[str, str]:
    """Angle columns by joint of the joints that are not read, named alike those in `angles`."""
    parts = {column: take_apart(column) for column in columns}
    read = [parts[column] for column in angles]
    joints = {name.joint for name in read}
    kinds = {(name.stem, name.topic) for name in read if name.stem not in _NO_NAMES}
    others = {}
    for column, name in parts.items():
        if name.joint and name.joint not in joints and (name.stem, name.topic) in kinds:
            others[name.own] = column
    return others


def time_among(columns: Iterable[str]) -> str | None:
    """The column that is a time by its name; of two alike the first one counts."""
    found = list[tuple[bool, int, str]]()
    for column in columns:
        part = take_apart(column)
        whole = column.strip().strip('"').strip().lower()
        for bare, name in enumerate((whole, part.stem if part.joint is None else "")):
            if name in TIMES:
                found.append((bare > 0, TIMES.index(name), column))
    return min(found, key=lambda one: one[:2])[2] if found else None
