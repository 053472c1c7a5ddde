"""The ROS 2 messages that algid writes: their names and definitions."""

from __future__ import annotations

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
