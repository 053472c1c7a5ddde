"""Which topic, and which fields of its messages, are the joints': told by a profile or by the messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from algid.readers.mcap.shape import Shape
from algid.readers.table import VELOCITIES

JOINT_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
DYNAMIC_JOINT_STATE = ("control_msgs/msg/DynamicJointState", "control_msgs/DynamicJointState")
_QUANTITIES = {"theta": "position", "tau": "effort", "omega": "velocity"}
_STAMPS = ("header.stamp", "stamp", "timestamp", "time", "header.timestamp")
_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("secs", "nsecs"))


@dataclass(frozen=True)
class Fields:
    """By canonical channel the path of its number; and the paths of a stamp's seconds and nanoseconds."""

    paths: Mapping[str, str]
    stamp: tuple[str, str] | None


def stamp_paths(shape: Shape) -> tuple[str, str] | None:
    """Where messages of this shape carry their own stamp."""
    for base in _STAMPS:
        for seconds, nanoseconds in _PARTS:
            pair = (f"{base}.{seconds}", f"{base}.{nanoseconds}")
            if all(shape.find(path) is not None for path in pair):
                return pair
    return None


def joint_names(shape: Shape) -> list[str]:
    """The joints that a message of this shape has both a position and an effort for."""
    lists = [texts for path, texts in shape.texts.items() if path in ("name", "names", "joint_names")]
    names = [str(place) for place in range(64)] if not lists or not any(lists) else list(lists[0])
    return [name for name in names if _paths(shape, name, "theta") and _paths(shape, name, "tau")]


def joint_fields(shape: Shape, joints: tuple[str, str]) -> dict[str, str]:
    """By canonical channel the path of its number for two joints; without velocities where one lacks them."""
    found = {}
    for quantity in _QUANTITIES:
        for number, joint in enumerate(joints, start=1):
            path = _paths(shape, joint, quantity)
            if path:
                found[f"{quantity}{number}"] = path
    if not all(name in found for name in VELOCITIES):
        found = {name: path for name, path in found.items() if name not in VELOCITIES}
    return found


def in_order(names: list[str]) -> tuple[str, str]:
    """Two joints in their order along the arm: by the number at their names' ends, else as they stand."""
    first, second = names
    digits = [name[len(name.rstrip("0123456789")) :] for name in names]
    if all(digits) and first.rstrip("0123456789") == second.rstrip("0123456789") and int(digits[0]) > int(digits[1]):
        return second, first
    return first, second


def _paths(shape: Shape, joint: str, quantity: str) -> str | None:
    field = _QUANTITIES[quantity]
    for path in (f"{field}[{joint}]", f"interface_values[{joint}].values[{field}]"):
        if shape.find(path) is not None:
            return path
    return None
