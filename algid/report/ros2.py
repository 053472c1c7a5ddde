"""ROS 2 messages in CDR, little endian: the two that an exported log needs."""

from __future__ import annotations

import struct

from algid.ros2 import HEADER

ESTIMATES = "algid_msgs/msg/Estimates"

_ENCAPSULATION = b"\x00\x01\x00\x00"
_BILLION = 1_000_000_000


def estimates_schema(names: list[str]) -> str:
    """Message definition with one float64 of each name."""
    fields = "".join(f"float64 {name}\n" for name in names)
    return f"std_msgs/Header header\n{fields}{HEADER}"


def field_names(columns: list[str]) -> list[str]:
    """Columns as ROS field names: ``k5+k3+z1+z2`` is ``k5_k3_z1_z2``."""
    return ["".join(c if c.isalnum() else "_" for c in column).lower().strip("_") for column in columns]


class JointTorque:
    """Writes JointState messages of two joints that carry nothing but effort."""

    def __init__(self, names: tuple[str, str]) -> None:
        body = bytearray(12)  # the stamp and an empty frame's length come first
        body += b"\x00" + b"\x00" * 3  # the empty string's end, then the sequence's alignment
        body[8:12] = struct.pack("<I", 1)
        body += struct.pack("<I", 2)
        for name in names:
            _align(body, 4)
            text = name.encode() + b"\x00"
            body += struct.pack("<I", len(text)) + text
        _align(body, 4)
        body += struct.pack("<II", 0, 0)  # no position, no velocity
        body += struct.pack("<I", 2)
        _align(body, 8)
        self._constant = bytes(body[8:])

    def message(self, stamp_ns: int, tau1: float, tau2: float) -> bytes:
        """One message of the torques in N m."""
        return _ENCAPSULATION + _stamp(stamp_ns) + self._constant + struct.pack("<dd", tau1, tau2)


def numbers_message(stamp_ns: int, values: list[float]) -> bytes:
    """One message of `estimates_schema`."""
    empty_frame = struct.pack("<I", 1) + b"\x00" + b"\x00" * 3
    return _ENCAPSULATION + _stamp(stamp_ns) + empty_frame + struct.pack(f"<{len(values)}d", *values)


def _stamp(stamp_ns: int) -> bytes:
    return struct.pack("<iI", stamp_ns // _BILLION, stamp_ns % _BILLION)


def _align(body: bytearray, size: int) -> None:
    body += b"\x00" * (-len(body) % size)
