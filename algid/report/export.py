"""A result as a ROS 2 log, which Foxglove and PlotJuggler open beside the original.

==================  ==========================  =============================================
topic               message                     holds
==================  ==========================  =============================================
/algid/measured     sensor_msgs/msg/JointState  position θ, rad; velocity ω, rad/s; effort τ, N m
/algid/predicted    sensor_msgs/msg/JointState  the same, with the torque that the model predicts
/algid/residual     sensor_msgs/msg/JointState  the same, with measured less predicted torque
/algid/estimates    algid_msgs/msg/Estimates    the paper's series, a field each, and condition
/algid/loaded       algid_msgs/msg/Estimates    the same of the loaded log
==================  ==========================  =============================================

Angles and torques are those of the log, velocities those that the estimator used: one file is
enough in Foxglove. Several logs keep a topic each: the second one's are `/algid/log2/predicted`
and so on.

ROS 2 messages in CDR, little endian, laid out as rows of structured arrays: only the stamp and the
numbers differ between them.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from algid.base.blocks import stacked
from algid.base.files import whole_file
from algid.base.progress import Progress
from algid.base.ros2 import HEADER, JOINT_STATE, JOINT_STATE_DEFINITION, check_stamps
from algid.log import Log, Origin
from algid.report.series import blocks, by_log, facts_of
from algid.results import read_result
from algid.writers.mcap import messages

if TYPE_CHECKING:
    from mcap.writer import Writer

START_KEY = b"start_ns"
ESTIMATES = "algid_msgs/msg/Estimates"
ROWS = 1 << 14
BILLION = 1_000_000_000


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
        if (folder / "torque.parquet").is_file():
            _write_torques(writer, folder / "torque.parquet", progress)
        for name in ("estimates", "loaded"):
            write_series(writer, folder / f"{name}.parquet", f"/algid/{name}")
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _write_torques(writer: Writer, path: Path, progress: Progress | None) -> None:
    """Write measured, predicted and residual torque of each log, with its motion."""
    schema = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
    _, total, metadata = facts_of(path)
    channels: dict[str, int] = {}
    done = 0
    for log, block in by_log(blocks(path, rows=ROWS)):
        stamps = _stamps(path, block, metadata, log)
        signals = {}
        for name, end in (("theta", ""), ("omega", ""), ("tau", ""), ("tau", "_predicted")):
            signals[name + end] = stacked(block, (f"{name}1{end}", f"{name}2{end}"), axis=0)
        tau, predicted = signals["tau"], signals["tau_predicted"]
        for name, torque in (
            ("measured", tau), ("predicted", predicted), ("residual", tau - predicted)
        ):  # fmt: skip
            topic = f"/algid/log{log + 1}/{name}" if log else f"/algid/{name}"
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            own = Log(stamps, signals["theta"], torque, Origin("", "", {}), signals["omega"])
            _write(writer, channels[topic], stamps, messages(own))
        done += stamps.size
        if progress is not None:
            progress("export", done, total)


def write_series(writer: Writer, path: Path, topic: str) -> None:
    """Write a Parquet series, a message a row and a field a column but ``t``.

    Nothing where there is no file.
    """
    if not path.is_file():
        return
    columns, _, metadata = facts_of(path)
    names = [name for name in columns if name != "t"]
    # as fields of ROS: k5+k3+z1+z2 is k5_k3_z1_z2
    fields = [re.sub(r"[^\w]", "_", name).lower().strip("_") for name in names]
    definition = "".join(f"float64 {name}\n" for name in fields)
    definition = f"std_msgs/Header header\n{definition}{HEADER}"
    schema = writer.register_schema(ESTIMATES, "ros2msg", definition.encode())
    channel = writer.register_channel(topic, "cdr", schema)
    # the empty frame's length, its end, and what aligns the numbers
    layout = np.dtype([
        ("encapsulation", "u1", 4), ("sec", "<i4"), ("nanosec", "<u4"), ("length", "<u4"),
        ("frame", "V4"), ("numbers", "<f8", len(names)),
    ])  # fmt: skip
    for block in blocks(path, ("t", *names), ROWS):
        stamps = _stamps(path, block, metadata, 0)
        rows = np.zeros(stamps.size, layout)
        rows["encapsulation"], rows["length"] = (0, 1, 0, 0), 1
        rows["sec"], rows["nanosec"] = stamps // BILLION, stamps % BILLION
        rows["numbers"] = stacked(block, names, axis=1)
        _write(writer, channel, stamps, rows)


def _stamps(
    path: Path, block: dict[str, Any], metadata: dict[bytes, bytes], log: int
) -> NDArray[np.int64]:
    """Stamps in ns: whole nanoseconds, which float64 seconds resolve for a hundred days."""
    starts = dict(enumerate(json.loads(metadata.get(START_KEY, b"[]"))))
    stamps = starts.get(log, 0) + np.rint(block["t"] * 1e9).astype(np.int64)
    check_stamps(path, stamps)
    return stamps


def _write(writer: Writer, channel: int, stamps: NDArray[np.int64], rows: NDArray[np.void]) -> None:
    for stamp, row in zip(stamps.tolist(), rows, strict=True):
        writer.add_message(channel, stamp, row.tobytes(), stamp)
