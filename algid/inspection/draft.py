"""A profile to edit: every key there is, with what a log tells filled in."""

from __future__ import annotations

import json
from pathlib import Path

from algid.inspection.report import Entry, look
from algid.readers import open_log
from algid.readers.table import CHANNELS

_HEAD = """\
# What the log's names, units and signs mean. Lines behind # are defaults or not known: edit what is wrong.
# zero = "hanging"           # θ1 is nought hanging straight down, not along the horizontal
# second_angle = "absolute"  # θ2 from the horizontal or vertical, not from link 1
# gravity = 9.81             # 0 for an arm that moves in a horizontal plane
# velocity = false           # leave the log's velocities out
# signs = [1, 1]             # -1 turns a joint's angle, velocity and torque round
# offsets = [0.0, 0.0]       # rad, added to the angles
"""
_UNITS = {
    "theta": '# unit = "deg"  # rad, deg, rev, counts (with counts = counts in a turn)\n# unwrap = true\n',
    "omega": '# unit = "deg"  # a second; or rpm\n',
    "tau": '# unit = "A"  # "N m", "mN m", A, mA\n# torque_constant = 0.1  # N m/A\n# gear_ratio = 1.0\n',
}


def draft_profile(path: Path) -> str:
    """The text of a profile for a log; for one that cannot be read yet, its names stand in comments.

    Raises
    ------
    LogError
        If there is no such log, or its format is unknown.
    """
    log = look(path, lambda: open_log(path).origin.mapping)
    mapping = log.found or {}
    known = _source(mapping, log.format) if mapping else f"# {_safe(log.refused or '')}\n"
    return _HEAD + known + _listed(log.entries) + _channels(mapping, log.format)


def _source(mapping: dict[str, str], kind: str) -> str:
    if kind in ("mcap", "rosbag2"):
        topic = mapping["theta1"].partition(": ")[0]
        return f"topic = {_quoted(topic)}\n# clock = \"log\"  # the recorder's times, not the messages' own\n"
    return f'time = {_quoted(mapping["t"])}\n# time_unit = "s"  # s, ms, us, ns\n'


def _listed(entries: tuple[Entry, ...]) -> str:
    return "".join(f"# in the log: {_safe(one.name)[:80]} ({_safe(one.type)[:60]})\n" for one in entries[:64])


def _channels(mapping: dict[str, str], kind: str) -> str:
    text = ""
    for name in CHANNELS:
        source = mapping.get(name, "")
        place = source.partition(": ")[2] if kind in ("mcap", "rosbag2") else source
        line = f"source = {_quoted(place)}\n" if place else "# source = \n"
        text += f"\n[{name}]\n{line}# sign = -1\n# offset = 0.0\n{_UNITS[name[:-1]]}"
    return text


def _quoted(text: str) -> str:
    """As a TOML basic string, whose escapes are JSON's."""
    return json.dumps(text).replace("\x7f", "\\u007f")


def _safe(text: str) -> str:
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in text)
