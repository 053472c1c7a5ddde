"""A profile to edit: every key there is, filled in as far as a log states it."""

from __future__ import annotations

import re
from typing import Any

from algid.base.text import as_toml, visible
from algid.base.units import names_of
from algid.inspection.checks import Inspection
from algid.readers.table import CHANNELS

_HEAD = """\
# What the log's names, units and signs mean: edit what is wrong.
# Lines behind # are defaults or not known.
# topic = "/joint_states"    # of bags
# joints = ["shoulder", "elbow"]  # first joint first
# clock = "log"              # of bags: the recorder's times, not the messages' own
# time = "t"                 # of tables
# time_unit = "s"            # of tables: s, ms, us, ns
# zero = "hanging"           # θ1 is zero hanging straight down, not horizontal; or "upright"
# second_angle = "absolute"  # θ2 from the horizontal or vertical, not from link 1
# drive = "base"             # the second motor stands at the base: its torque acts on θ1 + θ2
# passive = 2                # the joint without a motor: its torque is zero
# gravity = 9.81             # 0 for an arm that moves in a horizontal plane
# effort = "raw"             # what the driver logs as torque: "gravity-compensated", "external" …
# angle_unit = "deg"         # of every angle and, a second, every velocity without its own
# torque_unit = "mN m"       # of both torques, where they have none of their own
# rate = 500.0              # samples a second of a table without a time
# columns = ["t", "theta1"]  # names of the columns of a table without a header, in their order
# velocity = "observer"      # leave the log's velocities out; measured uses them
# signs = [1, 1]             # -1 turns a joint's angle, velocity and torque round
# offsets = [0.0, 0.0]       # rad, added to the angles
# start = 0.0                # s since the first sample: leave out what comes before
# end = 60.0                 # s since the first sample: leave out what comes after
# torque_file = "torques.csv"  # where the torques stand in another file
# prior = "arm.urdf"         # what CAD says of the arm, and by how many per cent it errs:
# prior_error = 20.0
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
_CHANNEL = """\
# topic = "/joint_states"  # where it is another
# source = "NAME"
# sign = -1
# offset = 0.0
"""
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


def draft_profile(found: Inspection) -> str:
    """The text of a profile for a log.

    For one that cannot be read yet, its names stand in comments.
    """
    reading, mapping = found.reading, found.mapping or {}
    main, *_ = *reading.topics, ""
    is_column = mapping.get("t") in [one.name for one in found.entries]
    text = _filled(
        _HEAD,
        topic=main,
        joints=reading.joints,
        time=mapping["t"] if is_column else "",
        time_unit=reading.time_unit,
    )
    if found.refused:
        text += f"# {visible(found.refused, 1000)}\n"
    for one in found.entries[:64]:
        text += f"# in the log: {visible(one.name, 80)} ({visible(one.type, 60)})\n"
    for name in CHANNELS:
        source = mapping.get(name, "")
        topic = next((one for one in reading.topics if source.startswith(f"{one}: ")), "")
        source, other = source.removeprefix(f"{topic}: "), topic != main
        own = _filled(_CHANNEL, source=source, topic=topic if other else "")
        text += f"\n[{name}]\n{own}{_UNITS[name[:-1]]}"
    return text


def _filled(text: str, **known: Any) -> str:
    """The text with what is known of some keys in the place of their commented lines."""
    for name, value in known.items():
        if value:
            line = f"{name} = {as_toml(value)}"
            text = re.sub(rf"(?m)^# {name} = .*", line.replace("\\", r"\\"), text, count=1)
    return text
