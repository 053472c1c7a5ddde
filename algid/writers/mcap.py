"""MCAP logs as of a ROS 2 recorder: sensor_msgs/msg/JointState, /joint_states, CDR, zstd.

The angles that a controller was to follow are the positions of /joint_references.

The messages of a block are laid out at once as rows of one structured array, since only the stamp
and the numbers differ between them.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.files import whole_file
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION, check_stamps
from algid.log import KEY, Companion, Log, Truth

TOPIC = "/joint_states"
REFERENCES = "/joint_references"
JOINTS = ("joint1", "joint2")
_CHUNK = 768 * 1024
_QOS = """\
- history: 1
  depth: 10
  reliability: 1
  durability: 2
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""


def write(
    path: Path, blocks: Iterable[Log], *, truth: Truth | None = None, force: bool = True
) -> None:
    """Write the blocks of a log; the truth goes into the metadata record "algid".

    Raises
    ------
    OutputError
        If the file cannot be written there, or exists and `force` is not set, or a stamp is none
        of a ROS 2 header's.
    """
    from mcap.writer import CompressionType, Writer

    channels, count = dict[str, int](), 0
    with whole_file(path, force=force) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK, compression=CompressionType.ZSTD)
        writer.start("ros2", "algid")
        schema = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
        for block in blocks:
            check_stamps(path, block.stamp_ns)
            written = {TOPIC: messages(block)}
            if block.reference is not None:
                written[REFERENCES] = _filled(block, position=block.reference)
            for topic in written:
                if topic not in channels:
                    qos = {"offered_qos_profiles": _QOS}
                    channels[topic] = writer.register_channel(topic, "cdr", schema, qos)
            for place, stamp in enumerate(block.stamp_ns.tolist()):
                for topic, rows in written.items():
                    content = rows[place].tobytes()
                    writer.add_message(channels[topic], stamp, content, stamp, count)
                count += 1
        if truth is not None:
            writer.add_metadata(KEY, {KEY: Companion(truth, {}).dumps()})
        writer.finish()  # type: ignore[no-untyped-call]


def messages(block: Log) -> NDArray[np.void]:
    """The samples of a block as JointState messages in CDR (N,); `check_stamps` must hold."""
    return _filled(block, position=block.theta, velocity=block.omega, effort=block.tau)


def _filled(block: Log, **signals: NDArray[np.floating[Any]] | None) -> NDArray[np.void]:
    """Messages with the signals that there are.

    CDR counts a number's alignment from behind the four bytes of the encapsulation.
    """
    fields: list[Any] = [
        ("encapsulation", "u1", 4),
        ("sec", "<i4"),
        ("nanosec", "<u4"),
        ("frame_length", "<u4"),
        ("frame", "V4"),
        ("names", "<u4"),
    ]
    for joint in JOINTS:
        fields += [(f"{joint}_length", "<u4"), (joint, "S8")]
    for name in ("position", "velocity", "effort"):
        fields.append((f"{name}_count", "<u4"))
        if signals.get(name) is not None:
            fields += [(f"{name}_padding", "V4")] * (np.dtype(fields).itemsize % 8 == 0)
            fields.append((name, "<f8", 2))
    rows = np.zeros(len(block), fields)
    rows["encapsulation"] = (0, 1, 0, 0)
    rows["sec"] = block.stamp_ns // 10**9
    rows["nanosec"] = block.stamp_ns % 10**9
    rows["frame_length"] = 1
    rows["names"] = len(JOINTS)
    for joint in JOINTS:
        rows[f"{joint}_length"] = len(joint) + 1
        rows[joint] = joint.encode()
    for name, values in signals.items():
        if values is not None:
            rows[f"{name}_count"] = 2
            rows[name] = values.T
    return rows
