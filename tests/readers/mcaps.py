"""MCAP files for the tests: written by the `mcap` package, message by message."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.typesys import Stores, get_typestore

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log

TOPIC = "/joint_states"


STORES = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
"""The types of ROS 1 and 2."""


def state_of(
    store: Any,
    stamp_ns: int,
    names: Sequence[str] = ("joint1", "joint2"),
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    **head: Any,
) -> Any:
    """A joint state of either; `head` is what its header has beside the stamp."""
    kinds = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", JOINT_STATE)
    time, header, state = (store.types[kind] for kind in kinds)
    stamp = time(*divmod(stamp_ns, 10**9))
    lists = (np.array(values, float) for values in (position, velocity, effort))
    return state(header(stamp=stamp, **{"frame_id": "", **head}), list(names), *lists)


def joint_state(stamp_ns: int, *values: Any, order: str = "<", **more: Any) -> bytes:
    """A joint state in CDR, little endian or big."""
    message = state_of(STORES[1], stamp_ns, *values, **more)
    return bytes(STORES[1].serialize_cdr(message, JOINT_STATE, little_endian=order == "<"))


Schema = tuple[str, str, bytes]
"""Name, encoding and data."""
STATE: Schema = JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode()
ANY: Schema = "any", "jsonschema", b'{"type":"object"}'


def write_mcap(
    path: Path,
    messages: Iterable[tuple[str, int, bytes]],
    schemas: Mapping[str, Schema] | Schema = STATE,
    *,
    metadata: Mapping[str, str] | None = None,
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int = 4096,
    **options: Any,
) -> Path:
    """Write messages (topic, log time, bytes) of one schema, or of those by topic, else `STATE`."""
    said = dict(metadata or {})
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for topic, stamp, data in messages:
            if topic not in channels:
                own = schemas if isinstance(schemas, tuple) else schemas.get(topic, STATE)
                encoding = {"jsonschema": "json", "protobuf": "protobuf"}.get(own[1], "cdr")
                schema = writer.register_schema(*own)
                channels[topic] = writer.register_channel(topic, encoding, schema, said)
            writer.add_message(channels[topic], stamp, data, stamp)
        if said:
            writer.add_metadata("log", said)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


NO_INDEX: dict[str, Any] = {
    "index_types": IndexType.NONE,
    "use_statistics": False,
    "use_summary_offsets": False,
}


def messages_of(log: Log, **options: Any) -> list[tuple[str, int, bytes]]:
    """The log's samples as JointState messages."""
    found = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        theta, tau = log.theta[:, row], log.tau[:, row]
        omega = () if log.omega is None else log.omega[:, row]
        data = joint_state(stamp, position=theta, velocity=omega, effort=tau, **options)
        found.append((TOPIC, stamp, data))
    return found


def protobuf_file(*fields: tuple[str, int, int], name: str = "State") -> Any:
    """A file of protobuf with one message: names, numbers of types and labels of its fields."""
    from google.protobuf import descriptor_pb2

    file = descriptor_pb2.FileDescriptorProto(name="arm.proto", package="arm", syntax="proto3")
    message = file.message_type.add(name=name)
    for number, (field, kind, label) in enumerate(fields, start=1):
        message.field.add(name=field, number=number, type=kind, label=label)
    return file


def protobuf_types(file: Any, name: str = "arm.State") -> tuple[bytes, Any]:
    """The descriptor set of a file, and the class of one of its messages."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

    stamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(stamp)
    pool.Add(file)
    made = message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    return descriptor_pb2.FileDescriptorSet(file=[stamp, file]).SerializeToString(), made


def protobuf_schema() -> tuple[bytes, Any]:
    """A file descriptor set of a joint state, and the message class."""
    lists = ((name, 1, 3) for name in ("position", "velocity", "effort"))
    file = protobuf_file(("timestamp", 11, 1), ("name", 9, 3), *lists, ("mode", 17, 1))
    file.dependency.append("google/protobuf/timestamp.proto")
    file.message_type[0].field[0].type_name = ".google.protobuf.Timestamp"
    return protobuf_types(file)


def chunks_of(path: Path) -> list[Any]:
    """The chunk indexes of a file as the `mcap` package reads them."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    return list(summary.chunk_indexes)


def poked(content: bytes, place: int, kind: str, *values: int) -> bytes:
    """The content with other numbers at a place, counted from the end where negative."""
    changed = bytearray(content)
    struct.pack_into(kind, changed, place % len(content), *values)
    return bytes(changed)
