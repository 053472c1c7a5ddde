"""ROS 2 messages that algid writes: their names, definitions and stamps."""

from __future__ import annotations

from pathlib import Path

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


def check_stamps(path: Path, stamp_ns: NDArray[np.int64]) -> None:
    """Refuse stamps (N,) in ns that no header holds.

    Raises
    ------
    OutputError
        If one is negative, or 2^31 s or more.
    """
    wrong = stamp_ns[(stamp_ns < 0) | (stamp_ns >= MOST_NS)]
    if wrong.size:
        raise OutputError(
            f"{path}: ROS 2 messages hold times from 1970 to 2038 (0 to 2^31 s), found "
            f"{wrong[0] * 1e-9:.17g} s; "
            "write Parquet or CSV, or times that count from zero"
        )
