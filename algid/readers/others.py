"""What the joints of a longer arm did that are not read: where they move, the two-link model lacks their torque."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from algid.arm import FloatArray
from algid.errors import LogError
from algid.log import Notice
from algid.readers.table import SampleTable
from algid.words import counted

_STILL = 0.02
"""In rad, or m: how far a joint that is held may creep."""
_NAMED = 4
Tables = Callable[[Mapping[str, str]], Iterator[SampleTable]]
"""Tables of a topic's fields, whose paths are given by the columns' names."""


def moving_joints(positions: Mapping[str, str], tables: Tables, unit: float = 1.0) -> tuple[Notice, ...]:
    """Say which of the other joints of a topic or table move, and how far, in its first table.

    `positions` has by joint the path of its position, in `unit` rad.
    """
    joints = {f"joint {number}": joint for number, joint in enumerate(positions)}  # no name of which is a stamp's
    if not joints:
        return ()
    try:
        table = next((one for one in tables({name: positions[joints[name]] for name in joints}) if len(one)), None)
    except LogError:  # the joints that are read tell of what is wrong
        return ()
    if table is None:
        return ()
    travel = {joints[name]: unit * _travel(values) for name, values in table.columns.items()}
    moved = sorted((joint for joint in travel if travel[joint] > _STILL), key=lambda joint: -travel[joint])
    if not moved:
        return ()
    told = ", ".join(f"{joint} by {travel[joint]:.2g} rad" for joint in moved[:_NAMED])
    more = f" and {len(moved) - _NAMED} more" if len(moved) > _NAMED else ""
    text = (
        f"{counted(len(moved), 'other joint moves', 'other joints move')} meanwhile: {told}{more} (in the first "
        f"{counted(len(table), 'sample')}); what that does to the torques is in no two-link model: hold them still"
    )
    return (Notice("OTHER_JOINTS", text),)


def _travel(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0
