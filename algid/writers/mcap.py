"""MCAP logs as of a ROS 2 recorder: sensor_msgs/msg/JointState, /joint_states, CDR, zstd.

The angles that a controller was to follow are the positions of /joint_references.

All messages of a chunk are laid out at once as rows of one structured array, since only the stamp
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
    path: Path,
    blocks: Iterable[Log],
    *,
    truth: Truth | None = None,
    chunk_size: int = _CHUNK,
    force: bool = True,
) -> None:
    """Write the blocks of a log; the truth goes into the metadata record "algid".

    A chunk holds about `chunk_size` bytes of messages of one block at most.

    Raises
    ------
    OutputError
        If the file cannot be written there, or exists and `force` is not set, or a stamp is none
        of a ROS 2 header's.
    """
    from mcap.records import Channel, Schema

    from algid.writers.chunks import HEAD_BYTES, ChunkedFile

    schema = Schema(1, JOINT_STATE_DEFINITION.encode(), "ros2msg", JOINT_STATE)
    states, followed = (
        Channel(number, topic, "cdr", {"offered_qos_profiles": _QOS}, schema.id)
        for number, topic in enumerate((TOPIC, REFERENCES), start=1)
    )
    with whole_file(path, force=force) as temporary, temporary.open("wb") as stream:
        file = ChunkedFile(stream, schema)
        for block in blocks:
            check_stamps(path, block.stamp_ns)
            rows = max(1, chunk_size // (HEAD_BYTES + messages(block.part(0, 1)).itemsize))
            for first in range(0, len(block), rows):
                part = block.part(first, min(first + rows, len(block)))
                file.add(states, part.stamp_ns, messages(part))
                if part.reference is not None:
                    file.add(followed, part.stamp_ns, _filled(part, position=part.reference))
        file.finish({KEY: {KEY: Companion(truth, {}).dumps()}} if truth is not None else {})


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
