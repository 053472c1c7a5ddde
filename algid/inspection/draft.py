"""A profile to edit: every key there is, with what a log tells filled in."""

from __future__ import annotations

import json
from pathlib import Path

from algid.inspection.report import look
from algid.log import Origin, Reading
from algid.readers import open_log
from algid.readers.formats import FORMATS
from algid.readers.table import CHANNELS
from algid.units import names_of

_HEAD = """\
# What the log's names, units and signs mean: edit what is wrong.
# Lines behind # are defaults or not known.
# zero = "hanging"           # θ1 is zero hanging straight down, not horizontal; or "upright"
# second_angle = "absolute"  # θ2 from the horizontal or vertical, not from link 1
# drive = "base"             # the second motor stands at the base: its torque acts on θ1 + θ2
# passive = 2                # the joint without a motor: its torque is zero
# gravity = 9.81             # 0 for an arm that moves in a horizontal plane
# effort = "raw"             # what the driver logs as torque: "gravity-compensated", "external" …
# rate = 500.0              # samples a second of a table without a time
# columns = ["t", "theta1"]  # names of the columns of a table without a header, in their order
# velocity = false           # leave the log's velocities out
# signs = [1, 1]             # -1 turns a joint's angle, velocity and torque round
# offsets = [0.0, 0.0]       # rad, added to the angles
# start = 0.0                # s since the first sample: leave out what comes before
# end = 60.0                 # s since the first sample: leave out what comes after
# torque_file = "torques.csv"  # where the torques stand in another file
# segment = 1                # one run alone, where the log's time starts again
# accept = ["DEGREES"]       # codes of checks that may warn, but not refuse
"""
_ENCODER = (
    "# gear_ratio = 1.0  # turns of the encoder in one of the joint\n# counts = 4096.0  # "
    "encoder counts in one turn\n"
)
_ANGLES = ", ".join(names_of("angle"))
_VELOCITIES = ", ".join(names_of("velocity"))
_TORQUES = ", ".join(names_of("torque", "current"))
_UNITS = {
    "theta": f'# unit = "deg"  # {_ANGLES}\n{_ENCODER}# unwrap = true  # where it jumps by a '
    "turn\n",
    "omega": f'# unit = "deg"  # {_VELOCITIES}; angles a second\n{_ENCODER}',
    "tau": f'# unit = "N m"  # {_TORQUES}\n'
    "# torque_constant = 0.1  # N m/A at the motor, of a current\n"
    "# gear_ratio = 1.0  # turns of the motor in one of the joint\n"
    '# q_des = "NAME"  # the desired angle of a PD law that makes the torque, where none is '
    "logged\n"
    "# kp = 50.0  # N m/rad\n"
    "# kd = 2.0  # N m s/rad\n",
}
_UNITS["q_des"] = _UNITS["theta"]
_ON_TOPICS = tuple(form.name for form in FORMATS if form.messages)


def draft_profile(path: Path) -> str:
    """The text of a profile for a log.

    For one that cannot be read yet, its names stand in comments.

    Raises
    ------
    LogError
        If there is no such log, or its format is unknown.
    """
    log = look(path, lambda: open_log(path).origin)
    head = "" if log.found else f"# {_safe(log.refused or '')}\n"
    entries = "".join(
        f"# in the log: {_safe(one.name)[:80]} ({_safe(one.type)[:60]})\n"
        for one in log.entries[:64]
    )
    return (
        _HEAD + head + _source(log.found, log.format) + entries + _channels(log.found, log.format)
    )


def _source(origin: Origin | None, kind: str) -> str:
    """Lines of topic, joints, clock and time as in the log, behind # where they are not known."""
    reading = origin.reading if origin else Reading()
    joints = (
        f"joints = [{', '.join(map(_quoted, reading.joints))}]"
        if reading.joints
        else '# joints = ["shoulder", "elbow"]'
    )
    if kind in _ON_TOPICS:
        topic = (
            f"topic = {_quoted(reading.topics[0])}"
            if reading.topics
            else '# topic = "/joint_states"'
        )
        time = ('# time = "t"  # of tables', '# time_unit = "s"  # of tables: s, ms, us, ns')
        clock = "# clock = \"log\"  # the recorder's times, not the messages' own"
    else:
        topic, clock = (
            '# topic = "/joint_states"  # of bags',
            '# clock = "log"  # of bags: header or log',
        )
        unit = f'time_unit = "{reading.time_unit}"' if reading.time_unit else '# time_unit = "s"'
        name = f"time = {_quoted(origin.mapping['t'])}" if origin else '# time = "t"'
        time = (name, f"{unit}  # s, ms, us, ns")
    return "\n".join([topic, f"{joints}  # first joint first", clock, *time, ""])


def _channels(origin: Origin | None, kind: str) -> str:
    text = ""
    for name in CHANNELS:
        topic, source = "", origin.mapping.get(name, "") if origin else ""
        if kind in _ON_TOPICS:
            topic, _, source = source.partition(": ")
        own = topic and origin is not None and topic != origin.reading.topics[0]
        lines = [
            f"topic = {_quoted(topic)}"
            if own
            else '# topic = "/joint_states"  # where it is another',
            f"source = {_quoted(source)}" if source else '# source = "NAME"',
        ]
        text += (
            f"\n[{name}]\n"
            + "\n".join(lines)
            + f"\n# sign = -1\n# offset = 0.0\n{_UNITS[name[:-1]]}"
        )
    return text


def _quoted(text: str) -> str:
    """As a TOML basic string: escapes as in JSON, save those of two surrogates."""
    letters = (f"\\U{ord(one):08x}" if ord(one) > 0xFFFF else json.dumps(one)[1:-1] for one in text)
    return f'"{"".join(letters)}"'


def _safe(text: str) -> str:
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)
