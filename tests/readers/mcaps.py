"""MCAP files for the tests: written by the `mcap` package, message by message."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log

TOPIC = "/joint_states"


@dataclass
class Cdr:
    """A CDR message under construction, little endian or big."""

    order: str = "<"
    data: bytes = b""

    def put(self, kind: str, *values: Any) -> Cdr:
        """Append numbers of a struct type, each aligned to its size."""
        for value in values:
            width = struct.calcsize(kind)
            self.data += bytes(-len(self.data) % width) + struct.pack(self.order + kind, value)
        return self

    def text(self, value: str) -> Cdr:
        """Append a string."""
        self.put("I", len(value.encode()) + 1)
        self.data += value.encode() + b"\0"
        return self

    def list(self, kind: str, values: Sequence[float]) -> Cdr:
        """Append a sequence of numbers."""
        return self.put("I", len(values)).put(kind, *values)

    def done(self, representation: int | None = None) -> bytes:
        """The message with its encapsulation."""
        number = (1 if self.order == "<" else 0) if representation is None else representation
        return bytes([0, number, 0, 0]) + self.data


def joint_state(
    stamp_ns: int,
    names: Sequence[str] = ("joint1", "joint2"),
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    *,
    frame: str = "",
    order: str = "<",
) -> Cdr:
    """A sensor_msgs/msg/JointState."""
    message = Cdr(order).put("i", stamp_ns // 10**9).put("I", stamp_ns % 10**9).text(frame)
    message.put("I", len(names))
    for name in names:
        message.text(name)
    return message.list("d", position).list("d", velocity).list("d", effort)


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
    omega = log.omega if log.omega is not None else np.empty((0, len(log)))
    return [
        (
            TOPIC,
            stamp,
            joint_state(
                stamp,
                position=log.theta[:, row].tolist(),
                velocity=omega[:, row].tolist(),
                effort=log.tau[:, row].tolist(),
                **options,
            ).done(),
        )
        for row, stamp in enumerate(log.stamp_ns.tolist())
    ]


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
