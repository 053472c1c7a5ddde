"""MCAP logs as of a ROS 2 recorder: sensor_msgs/msg/JointState, /joint_states, CDR, zstd.

The angles that a controller was to follow are the positions of /joint_references.

All messages of a chunk are laid out at once as rows of one structured array, since only the stamp
and the numbers differ between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.files import whole_file
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION, check_stamps
from algid.log import KEY, Companion, Log, Truth
from algid.writers.blocks import as_blocks

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
    log: Log | Iterable[Log],
    *,
    truth: Truth | None = None,
    chunk_size: int = _CHUNK,
    force: bool = True,
) -> None:
    """Write a log, or the blocks of one; the truth goes into the metadata record "algid".

    A chunk holds `chunk_size` bytes of messages of one block at most.

    Raises
    ------
    OutputError
        If the file cannot be written there, or exists and `force` is not set, or a stamp is none
        of a ROS 2 header's.
    """
    from mcap.records import Channel, Schema

    from algid.writers.chunks import ChunkedFile, message_bytes

    blocks = as_blocks(log)
    topics: tuple[str, ...] = (TOPIC,)
    first_block = next(blocks, None)
    if first_block is not None:
        blocks = chain([first_block], blocks)
        if first_block.reference is not None:
            topics = (TOPIC, REFERENCES)
    with whole_file(path, force=force) as temporary, temporary.open("wb") as stream:
        file = ChunkedFile(
            stream,
            profile="ros2",
            library="algid",
            schema=Schema(1, JOINT_STATE_DEFINITION.encode(), "ros2msg", JOINT_STATE),
            channels=tuple(
                Channel(number, topic, "cdr", {"offered_qos_profiles": _QOS}, 1)
                for number, topic in enumerate(topics, start=1)
            ),
        )
        for block in blocks:
            check_stamps(path, block.stamp_ns)
            rows = max(1, chunk_size // message_bytes(_layout(block.omega is not None)))
            for first in range(0, len(block), rows):
                part = block.part(first, min(first + rows, len(block)))
                file.add(part.stamp_ns, messages(part))
                if part.reference is not None:
                    file.add(part.stamp_ns, references(part), 1)
        if truth is not None:
            file.add_metadata(KEY, {KEY: Companion(truth, {}).dumps()})
        file.finish()


def messages(block: Log) -> NDArray[np.void]:
    """The samples of a block as JointState messages in CDR (N,); `check_stamps` must hold."""
    signals = {"position": block.theta, "velocity": block.omega, "effort": block.tau}
    return _filled(block, signals)


def references(block: Log) -> NDArray[np.void]:
    """The angles to follow of a block that has them, as messages of positions alone (N,)."""
    return _filled(block, {"position": block.reference})


def _filled(
    block: Log, signals: Mapping[str, NDArray[np.floating[Any]] | None]
) -> NDArray[np.void]:
    known = {name: values for name, values in signals.items() if values is not None}
    rows = np.zeros(len(block), _layout("velocity" in known, "effort" in known))
    rows["encapsulation"] = (0, 1, 0, 0)
    rows["sec"] = block.stamp_ns // 10**9
    rows["nanosec"] = block.stamp_ns % 10**9
    rows["frame_length"] = 1
    rows["names"] = 2
    for number, joint in enumerate(JOINTS, start=1):
        rows[f"length{number}"] = len(joint) + 1
        rows[f"joint{number}"] = joint.encode()
    for name, values in known.items():
        rows[f"{name}_count"] = 2
        rows[name] = values.T
    return rows


def _layout(velocity: bool, effort: bool = True) -> np.dtype[np.void]:
    """The CDR layout: alignment counts from behind the four bytes of the encapsulation."""
    fields: list[tuple[str, object, int]] = [
        ("encapsulation", ("u1", 4), 4),
        ("sec", "<i4", 4),
        ("nanosec", "<u4", 4),
        ("frame_length", "<u4", 4),
        ("frame", "S1", 4),
        ("names", "<u4", 4),
        ("length1", "<u4", 4),
        ("joint1", "S7", 8),
        ("length2", "<u4", 4),
        ("joint2", "S7", 8),
    ]
    for name in ("position", "velocity", "effort"):
        full = {"position": True, "velocity": velocity, "effort": effort}[name]
        fields.append((f"{name}_count", "<u4", 4))
        if full:
            place = sum(width for *_, width in fields) - 4
            if place % 8:
                fields.append((f"{name}_padding", "V4", 4))
            fields.append((name, ("<f8", 2), 16))
    names, kinds, widths = zip(*fields, strict=True)
    ends = np.cumsum(widths)
    return np.dtype(
        {
            "names": list(names),
            "formats": list(kinds),
            "offsets": (ends - widths).tolist(),
            "itemsize": int(ends[-1]),
        }
    )
