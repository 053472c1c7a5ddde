"""ROS 2 messages that algid writes: their names, definitions and headers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.errors import OutputError

JOINT_STATE = "sensor_msgs/msg/JointState"

HEADER = """\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

JOINT_STATE_DEFINITION = f"""\
# State of torque controlled joints: one entry a joint, the same order in every array.
std_msgs/Header header

string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}"""

MOST_NS = 2**31 * 10**9
"""A header counts seconds since 1970 as int32, which ends in 2038."""


def headed(path: Path, stamp_ns: NDArray[np.int64], fields: Sequence[Any]) -> NDArray[np.void]:
    """Messages in CDR, one a stamp in ns: a header of an empty frame, and zeros for the `fields`.

    They are rows (N,) of one structured array, since only stamps and numbers differ between them.

    Raises
    ------
    OutputError
        If a stamp is negative, or 2^31 s or more; it names `path`.
    """
    wrong = stamp_ns[(stamp_ns < 0) | (stamp_ns >= MOST_NS)]
    if wrong.size:
        raise OutputError(
            f"{path}: ROS 2 messages hold times from 1970 to 2038 (0 to 2^31 s), found "
            f"{wrong[0] * 1e-9:.17g} s; "
            "write Parquet or CSV, or times that count from zero"
        )
    # the frame is its end alone, and what aligns what follows
    header = [("encapsulation", "u1", 4), ("sec", "<i4"), ("nanosec", "<u4"), ("length", "<u4")]
    rows = np.zeros(stamp_ns.size, [*header, ("frame", "V4"), *fields])
    rows["encapsulation"], rows["length"] = (0, 1, 0, 0), 1
    rows["sec"], rows["nanosec"] = np.divmod(stamp_ns, 10**9)
    return rows
