"""What the joints of a longer arm did that are not read: where they move, the two-link model lacks their torque."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from algid.arm import FloatArray
from algid.errors import LogError
from algid.log import Notice
from algid.readers.mcap.catalogue import Catalogue
from algid.readers.mcap.framing import File
from algid.readers.mcap.topic import Fields, Topic
from algid.words import counted

_LOOKED = 1 << 14
"""Messages that are looked at."""
_STILL = 0.02
"""In rad, or m: how far a joint that is held may creep."""
_NAMED = 4


def moving_joints(file: File, found: Catalogue, topic: Topic, others: Mapping[str, str]) -> tuple[Notice, ...]:
    """Say which of the other joints of a topic move, and how far; `others` has by joint the path of its position."""
    if not others:
        return ()
    joints = {f"joint {number}": joint for number, joint in enumerate(others)}
    paths = dict(zip(joints, others.values(), strict=True))
    beside = Topic(topic.name, topic.type, Fields(paths, None), "log")
    try:
        table = next((one for one in beside.tables(str(file.path), file, found, _LOOKED) if len(one)), None)
    except LogError:  # the joints that are read tell of what is wrong
        return ()
    if table is None:
        return ()
    travel = {joints[name]: _travel(values) for name, values in table.columns.items()}
    moved = sorted((joint for joint in travel if travel[joint] > _STILL), key=lambda joint: -travel[joint])
    if not moved:
        return ()
    told = ", ".join(f"{joint} by {travel[joint]:.2g} rad" for joint in moved[:_NAMED])
    more = f" and {len(moved) - _NAMED} more" if len(moved) > _NAMED else ""
    text = (
        f"{counted(len(moved), 'other joint moves', 'other joints move')} meanwhile: {told}{more} (in the first "
        f"{counted(len(table), 'message')}); what that does to the torques is in no two-link model: hold them still"
    )
    return (Notice("OTHER_JOINTS", text),)


def _travel(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0
