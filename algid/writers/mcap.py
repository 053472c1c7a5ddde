"""MCAP logs as of a ROS 2 recorder: sensor_msgs/msg/JointState, /joint_states, CDR, zstd.

The angles that a controller was to follow are the positions of /joint_references.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.files import whole_file
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION, headed
from algid.log import KEY, Companion, Log, Truth
from algid.writers import UNITS

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

_UNITS = {"position": UNITS["theta"], "effort": UNITS["tau"]}
_METADATA = {"offered_qos_profiles": _QOS, "units": json.dumps(_UNITS)}


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
            written = messages(path, block)
            for topic in written:
                if topic not in channels:
                    channels[topic] = writer.register_channel(topic, "cdr", schema, _METADATA)
            for place, stamp in enumerate(block.stamp_ns.tolist()):
                for topic, rows in written.items():
                    content = rows[place].tobytes()
                    writer.add_message(channels[topic], stamp, content, stamp, count)
                count += 1
        if truth is not None:
            writer.add_metadata(KEY, {KEY: Companion(truth, {}).dumps()})
        writer.finish()  # type: ignore[no-untyped-call]


def messages(path: Path, block: Log) -> dict[str, NDArray[np.void]]:
    """The messages (N,) of a block by topic, for the file `path`. Raises `OutputError`."""
    signals = {"position": block.theta, "velocity": block.omega, "effort": block.tau}
    written = {TOPIC: _states(path, block, signals)}
    if block.reference is not None:
        written[REFERENCES] = _states(path, block, {"position": block.reference})
    return written


def _states(
    path: Path, block: Log, signals: Mapping[str, NDArray[np.floating[Any]] | None]
) -> NDArray[np.void]:
    """JointState messages (N,) with the signals that there are.

    CDR counts a number's alignment from behind the four bytes of the encapsulation, which are a
    fifth of the header's.
    """
    fields: list[Any] = [("names", "<u4")]
    for joint in JOINTS:
        fields += [(f"{joint}_length", "<u4"), (joint, "S8")]
    for name in ("position", "velocity", "effort"):
        fields.append((f"{name}_count", "<u4"))
        if signals.get(name) is not None:
            fields += [(f"{name}_padding", "V4")] * (np.dtype(fields).itemsize % 8 == 4)
            fields.append((name, "<f8", 2))
    rows = headed(path, block.stamp_ns, fields)
    rows["names"] = len(JOINTS)
    for joint in JOINTS:
        rows[f"{joint}_length"] = len(joint) + 1
        rows[joint] = joint.encode()
    for name, values in signals.items():
        if values is not None:
            rows[f"{name}_count"] = 2
            rows[name] = values.T
    return rows
