"""The logs that are timed: made once, kept in a folder, the same on every machine."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType

from algid.arm import FloatArray, inverse_dynamics
from algid.base.files import whole_file
from algid.base.ros2 import HEADER
from algid.log import Log, Origin
from algid.synth.cases import load_case
from algid.writers import write_log
from pipelines.mutations import Topic, joint_states, write_topics
from tests.readers.mcaps import protobuf_schema

RATE = 1000
PERIOD = 10.0  # s
START_NS = 1_700_000_000_000_000_000
ENCODER_STEP = 2 * np.pi / 2**20  # rad
TORQUE_STEP = 1e-3  # N m
TORQUE_NOISE = 0.01  # N m
_BLOCK = 25  # periods a block
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


def motion(seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles, velocities and accelerations (2, N) of one period: ten harmonics from 0.1 to 2 Hz a
    joint, so that by eq. (1) the torque is a closed form.
    """
    draw = np.random.default_rng(seed)
    order = np.arange(1, 21, 2)
    rate = 2 * np.pi * order / PERIOD
    amplitude = (draw.uniform(0.3, 0.9, (2, order.size)) / np.sqrt(order))[:, None]
    phase = draw.uniform(0, 2 * np.pi, (2, 1, order.size))
    angle = rate * (np.arange(round(PERIOD * RATE)) / RATE)[:, None] + phase
    return (
        (amplitude * np.sin(angle)).sum(axis=2),
        (amplitude * rate * np.cos(angle)).sum(axis=2),
        (-amplitude * rate**2 * np.sin(angle)).sum(axis=2),
    )


def blocks(rows: int, seed: int = 0) -> Iterator[Log]:
    """A log of `rows` samples in blocks: the motion tiled, with the encoder's steps, each
    repetition with torque noise of its own.
    """
    draw = np.random.default_rng(seed + 1)
    exact = motion(seed)
    clean = np.tile(inverse_dynamics(load_case("case1").arm.constants(), *exact), (1, _BLOCK))
    theta = np.tile(np.rint(exact[0] / ENCODER_STEP) * ENCODER_STEP, (1, _BLOCK))
    for first in range(0, rows, theta.shape[1]):
        count = min(theta.shape[1], rows - first)
        noisy = clean[:, :count] + TORQUE_NOISE * draw.standard_normal((2, count))
        tau = np.rint(noisy / TORQUE_STEP) * TORQUE_STEP
        stamps = START_NS + (first + np.arange(count)) * (10**9 // RATE)
        yield Log(stamps, theta[:, :count], tau, Origin("", "", {}))


def log(path: Path, rows: int, seed: int = 0) -> Path:
    """The log as Parquet or MCAP, once."""
    if not path.exists():
        write_log(path, blocks(rows, seed))
    return path


def arm_log(rows: int) -> Log:
    """A log of encoder counts and torque steps: values repeat as those of a real arm do."""
    draw = np.random.default_rng(1)
    t = np.arange(rows) * 1e-3
    wave = np.stack([np.sin(0.7 * t) + 0.3 * np.sin(3.1 * t), np.cos(1.1 * t)])
    theta = np.rint(wave * 16384) / 16384
    tau = np.rint((8 * wave + draw.normal(0, 0.01, wave.shape)) / 3e-3) * 3e-3
    omega = np.rint(np.gradient(wave, 1e-3, axis=1) * 100) / 100
    return Log(START_NS + np.arange(rows) * 1_000_000, theta, tau, Origin("", "", {}), omega)


def zipped(path: Path, topics: Iterable[Topic]) -> None:
    """An MCAP file of zstd chunks of 768 KiB."""
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        write_topics(stream, topics, chunk_size=768 * 1024, compression=CompressionType.ZSTD)


def joint_and_imu(path: Path, rows: int) -> None:
    """Joint states with an Imu message between every five."""
    log = arm_log(rows)
    stamps = log.stamp_ns.tolist()
    imu = zip((stamp + 1000 for stamp in stamps[::5]), imu_payloads(len(stamps[::5])), strict=True)
    definition = _IMU_DEFINITION.encode()
    zipped(path, [joint_states(log), ("/imu/data", "cdr", _IMU, "ros2msg", definition, imu)])


def imu_payloads(rows: int) -> Iterator[bytes]:
    """Imu messages in CDR."""
    frame = b"imu_link\0"
    head = struct.pack("<BBBBiII", 0, 1, 0, 0, 1_700_000_000, 5, len(frame)) + frame
    head += bytes(-(len(head) - 4) % 8)
    for row in np.rint(np.random.default_rng(2).normal(size=(rows, 37)) * 1000) / 1000:
        yield head + row.tobytes()


def protobuf_states(path: Path, rows: int) -> None:
    """Joint states as protobuf messages with a Timestamp."""
    data, state = protobuf_schema()
    log = arm_log(rows)
    omega = log.omega
    assert omega is not None

    def content(row: int, stamp_ns: int) -> bytes:
        seconds, nanos = divmod(stamp_ns, 10**9)
        one = state(
            timestamp={"seconds": seconds, "nanos": nanos},
            name=["j1", "j2"],
            position=log.theta[:, row],
            velocity=omega[:, row],
            effort=log.tau[:, row],
        )
        return bytes(one.SerializeToString())

    stamps = log.stamp_ns.tolist()
    contents = ((stamp_ns, content(row, stamp_ns)) for row, stamp_ns in enumerate(stamps))
    zipped(path, [("/arm", "protobuf", "arm.State", "protobuf", data, contents)])
