"""A result as a ROS 2 log, which Foxglove and PlotJuggler open beside the original.

==================  ==========================  =============================================
topic               message                     holds
==================  ==========================  =============================================
/algid/measured     sensor_msgs/msg/JointState  position θ, rad; velocity ω, rad/s; effort τ, N m
/algid/predicted    sensor_msgs/msg/JointState  effort: torque that the model predicts, N m
/algid/residual     sensor_msgs/msg/JointState  effort: measured less predicted torque, N m
/algid/estimates    algid_msgs/msg/Estimates    the paper's series, a field each, and condition
/algid/loaded       algid_msgs/msg/Estimates    the same of the loaded log
==================  ==========================  =============================================

Angles and torques are those of the log, velocities those that the estimator used: one file is
enough in Foxglove. Several logs keep a topic each: the second one's are `/algid/log2/predicted`
and so on.

ROS 2 messages in CDR, little endian: the two that an exported log needs.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.blocks import stacked
from algid.base.errors import ResultError
from algid.base.files import whole_file
from algid.base.progress import Progress
from algid.base.ros2 import HEADER, JOINT_STATE, JOINT_STATE_DEFINITION, check_stamps
from algid.report.series import blocks, by_log, facts_of
from algid.results import read_result

if TYPE_CHECKING:
    from mcap.writer import Writer

START_KEY = b"start_ns"
JOINTS = ("joint1", "joint2")
SIGNALS = (
    "log",
    "t",
    "theta1",
    "theta2",
    "omega1",
    "omega2",
    "tau1",
    "tau2",
    "tau1_predicted",
    "tau2_predicted",
)
MEASURED, PREDICTED = SIGNALS[2:8], SIGNALS[8:]
ROWS = 1 << 14


def export_mcap(folder: Path, progress: Progress | None = None) -> Path:
    """Write `estimates.mcap` into the result folder `folder`, telling how far it has come.

    The messages bear the log's own stamps where each Parquet file tells its logs' first ones, in
    ns, as a JSON list in its metadata ``start_ns``; otherwise time counts from zero.

    Raises
    ------
    ResultError
        If the folder's files are missing or unreadable.
    OutputError
        If the log cannot be written.
    """
    from mcap.writer import CompressionType, Writer

    result = read_result(folder)
    path = folder / "estimates.mcap"
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library=f"algid {result.version}")
        _write_torques(writer, folder / "torque.parquet", len(result.logs), progress)
        for name in ("estimates", "loaded"):
            write_series(writer, folder / f"{name}.parquet", f"/algid/{name}")
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def start_stamps(path: Path, logs: int) -> list[int]:
    """First stamp in ns of each of the file's logs; zero where it does not tell.

    Raises
    ------
    ResultError
        If the file cannot be read, or tells anything else.
    """
    starts = facts_of(path)[2].get(START_KEY)
    try:
        known = list(map(int, json.loads(starts or "[]")))
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise ResultError(
            f"{path}: {START_KEY.decode()}: expected stamps in ns, found {starts!r:.60}; identify "
            "again with this version"
        ) from error
    return (known + [0] * logs)[:logs]


def _write_torques(writer: Writer, path: Path, logs: int, progress: Progress | None) -> None:
    if not path.is_file():
        return
    starts = start_stamps(path, logs)
    schema = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
    torque, whole = JointStates(JOINTS).message, JointStates(JOINTS, whole=True).message
    channels: dict[str, int] = {}
    done, total = 0, facts_of(path)[1]
    for log, block in by_log(blocks(path, SIGNALS, ROWS)):
        stamps = _stamps(path, block["t"], starts[log] if log < len(starts) else 0)
        place = "/algid" if log == 0 else f"/algid/log{log + 1}"
        measured = stacked(block, MEASURED, axis=1)
        predicted = stacked(block, PREDICTED, axis=1)
        for name, message, signals in (
            ("measured", whole, measured),
            ("predicted", torque, predicted),
            ("residual", torque, measured[:, -2:] - predicted),
        ):
            topic = f"{place}/{name}"
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            for stamp, values in zip(stamps, signals.tolist(), strict=True):
                writer.add_message(channels[topic], stamp, message(stamp, values), stamp)
        done += len(stamps)
        if progress is not None:
            progress("export", done, total)


def write_series(writer: Writer, path: Path, topic: str) -> None:
    """Write a Parquet series, a message a row and a field a column but ``t``.

    Nothing where there is no file.
    """
    if not path.is_file():
        return
    [start] = start_stamps(path, 1)
    names = [name for name in facts_of(path)[0] if name != "t"]
    definition = estimates_schema(field_names(names))
    schema = writer.register_schema(ESTIMATES, "ros2msg", definition.encode())
    channel = writer.register_channel(topic, "cdr", schema)
    for block in blocks(path, ["t"] + names, ROWS):
        rows = stacked(block, names, axis=1).tolist()
        for stamp, row in zip(_stamps(path, block["t"], start), rows, strict=True):
            writer.add_message(channel, stamp, numbers_message(stamp, row), stamp)


def _stamps(path: Path, t: FloatArray, start: int) -> list[int]:
    """Stamps in ns.

    They are whole nanoseconds, which float64 seconds resolve for a hundred days.
    """
    stamps = start + np.rint(t * 1e9).astype(np.int64)
    check_stamps(path, stamps)
    listed: list[int] = stamps.tolist()
    return listed


ESTIMATES = "algid_msgs/msg/Estimates"

_TWO = b"\x02\x00"
_ENCAPSULATION = b"\x00\x01\x00\x00"
_BILLION = 1_000_000_000


def estimates_schema(names: list[str]) -> str:
    """Message definition with one float64 of each name."""
    fields = "".join(f"float64 {name}\n" for name in names)
    return f"std_msgs/Header header\n{fields}{HEADER}"


def field_names(columns: list[str]) -> list[str]:
    """Columns as ROS field names: ``k5+k3+z1+z2`` is ``k5_k3_z1_z2``."""
    return [re.sub(r"[^\w]", "_", column).lower().strip("_") for column in columns]


class JointStates:
    """Write JointState messages of two joints: effort only, or with position and velocity."""

    def __init__(self, names: tuple[str, str], *, whole: bool = False) -> None:
        body = bytearray(12)  # the stamp and an empty frame's length come first
        body += b"\x00" + b"\x00" * 3  # the empty string's end, then the sequence's alignment
        body[8:12] = struct.pack("<I", 1)
        body += struct.pack("<I", 2)
        for name in names:
            _align(body, 4)
            text = name.encode() + b"\x00"
            body += struct.pack("<I", len(text)) + text
        _align(body, 4)
        body += b"" if whole else struct.pack("<II", 0, 0)  # no position, no velocity
        body += struct.pack("<I", 2)
        _align(body, 8)
        self._constant = bytes(body[8:])
        # each pair but the first tells its length
        self._values = struct.Struct("<dd2s6xdd2s6xdd" if whole else "<dd")
        self._whole = whole

    def message(self, stamp_ns: int, values: Sequence[float]) -> bytes:
        """One message of two torques, or of two angles, two velocities and two torques."""
        fields = [*values[:2], _TWO, *values[2:4], _TWO, *values[4:]] if self._whole else values
        return _ENCAPSULATION + _stamp(stamp_ns) + self._constant + self._values.pack(*fields)


def numbers_message(stamp_ns: int, values: list[float]) -> bytes:
    """One message of `estimates_schema`."""
    empty_frame = struct.pack("<I", 1) + b"\x00" + b"\x00" * 3
    return (
        _ENCAPSULATION + _stamp(stamp_ns) + empty_frame + struct.pack(f"<{len(values)}d", *values)
    )


def _stamp(stamp_ns: int) -> bytes:
    return struct.pack("<iI", stamp_ns // _BILLION, stamp_ns % _BILLION)


def _align(body: bytearray, size: int) -> None:
    body += b"\x00" * (-len(body) % size)
