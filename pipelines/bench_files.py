"""The logs that `bench_ingest` reads: made once, kept in a folder, the same on every machine."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from algid.base.files import whole_file
from algid.base.ros2 import HEADER, JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log, Origin
from algid.writers import write_log
from algid.writers.mcap import messages

ROWS = 1_000_000
START_NS = 1_700_000_000_000_000_000
_IMU = "sensor_msgs/msg/Imu"

_IMU_DEFINITION = f"""\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
{HEADER}================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
PROTOBUF_ROWS = 100_000


def arm_log(rows: int = ROWS) -> Log:
    """A log of encoder counts and torque steps: values repeat as those of a real arm do."""
    draw = np.random.default_rng(1)
    t = np.arange(rows) * 1e-3
    wave = np.stack([np.sin(0.7 * t) + 0.3 * np.sin(3.1 * t), np.cos(1.1 * t)])
    theta = np.rint(wave * 16384) / 16384
    tau = np.rint((8 * wave + draw.normal(0, 0.01, wave.shape)) / 3e-3) * 3e-3
    omega = np.rint(np.gradient(wave, 1e-3, axis=1) * 100) / 100
    return Log(START_NS + np.arange(rows) * 1_000_000, theta, tau, Origin("", "", {}), omega)


def joint_and_imu(path: Path) -> None:
    """1,000,000 JointState with an Imu message between every five, zstd chunks of 768 KiB."""
    log = arm_log()
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, chunk_size=768 * 1024, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="algid bench")
        joints = _channel(writer, "/joint_states", JOINT_STATE, JOINT_STATE_DEFINITION)
        imu = _channel(writer, "/imu/data", _IMU, _IMU_DEFINITION)
        other = imu_payloads(ROWS // 5)
        for row, (stamp, payload) in enumerate(
            zip(log.stamp_ns.tolist(), messages(log), strict=True)
        ):
            writer.add_message(joints, stamp, payload.tobytes(), stamp, row)
            if row % 5 == 0:
                writer.add_message(imu, stamp + 1000, next(other), stamp + 1000, row // 5)
        writer.finish()  # type: ignore[no-untyped-call]


def imu_payloads(rows: int) -> Iterator[bytes]:
    """Imu messages in CDR."""
    draw = np.random.default_rng(2)
    frame = b"imu_link\0"
    head = struct.pack("<BBBBiII", 0, 1, 0, 0, 1_700_000_000, 5, len(frame)) + frame
    head += bytes(-(len(head) - 4) % 8)
    for row in np.rint(draw.normal(size=(rows, 37)) * 1000) / 1000:
        yield head + row.tobytes()


def with_cameras(path: Path, gigabytes: float = 2.0) -> None:
    """Joint states at 1 kHz beside two cameras' images at 30 Hz that do not compress."""
    image = np.random.default_rng(3).bytes(1 << 20)
    frames = int(gigabytes * 1e9 / len(image))
    log = arm_log(frames * 16)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, chunk_size=4 << 20, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="algid bench")
        joints = _channel(writer, "/joint_states", JOINT_STATE, JOINT_STATE_DEFINITION)
        camera = _channel(
            writer, "/camera/image", "sensor_msgs/msg/CompressedImage", "uint8[] data\n"
        )
        head = struct.pack("<BBBBI", 0, 1, 0, 0, len(image))
        for row, (stamp, payload) in enumerate(
            zip(log.stamp_ns.tolist(), messages(log), strict=True)
        ):
            writer.add_message(joints, stamp, payload.tobytes(), stamp, row)
            if row % 16 == 0:
                writer.add_message(camera, stamp, head + image, stamp, row // 16)
        writer.finish()  # type: ignore[no-untyped-call]


def flat_files(folder: Path) -> None:
    """The same million samples as CSV and as Parquet."""
    for kind in ("csv", "parquet"):
        if not (folder / f"arm.{kind}").exists():
            write_log(folder / f"arm.{kind}", arm_log())


def _channel(writer: Writer, topic: str, name: str, definition: str) -> int:
    schema = writer.register_schema(name=name, encoding="ros2msg", data=definition.encode())
    return writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)


def protobuf_states(path: Path, rows: int = PROTOBUF_ROWS) -> None:
    """Joint states as protobuf messages with a Timestamp."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

    file = descriptor_pb2.FileDescriptorProto(name="arm.proto", package="arm", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    message = file.message_type.add(name="State")
    message.field.add(
        name="timestamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp"
    )
    for number, (name, kind) in enumerate(
        (("name", 9), ("position", 1), ("velocity", 1), ("effort", 1)), 2
    ):
        message.field.add(name=name, number=number, type=kind, label=3)
    stamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(stamp)
    pool.Add(file)
    state = message_factory.GetMessageClass(pool.FindMessageTypeByName("arm.State"))
    data = descriptor_pb2.FileDescriptorSet(file=[stamp, file]).SerializeToString()
    log = arm_log(rows)
    assert log.omega is not None
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, chunk_size=768 * 1024, compression=CompressionType.ZSTD)
        writer.start(library="algid bench")
        schema = writer.register_schema(name="arm.State", encoding="protobuf", data=data)
        channel = writer.register_channel(
            topic="/arm", message_encoding="protobuf", schema_id=schema
        )
        for row, stamp_ns in enumerate(log.stamp_ns.tolist()):
            one = state(name=["j1", "j2"])
            one.timestamp.seconds, one.timestamp.nanos = divmod(stamp_ns, 10**9)
            one.position.extend(log.theta[:, row])
            one.velocity.extend(log.omega[:, row])
            one.effort.extend(log.tau[:, row])
            writer.add_message(channel, stamp_ns, one.SerializeToString(), stamp_ns, row)
        writer.finish()  # type: ignore[no-untyped-call]
