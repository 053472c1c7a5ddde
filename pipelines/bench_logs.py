"""The logs that `bench` identifies from: a periodic motion and the torque it takes, tiled without
end.

The motion of 10 s is a sum of harmonics, so that its derivatives and, by eq. (1), its torque are
closed forms; each repetition gets torque noise of its own, and the encoder's steps.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import zstandard

from algid.arm import FloatArray, inverse_dynamics
from algid.base.files import whole_file
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log, Origin
from algid.synth.cases import load_case
from algid.writers import write_log
from algid.writers.mcap import TOPIC, messages

RATE = 1000
PERIOD = 10.0  # s
START_NS = 1_700_000_000_000_000_000
ENCODER_STEP = 2 * np.pi / 2**20  # rad
TORQUE_STEP = 1e-3  # N m
TORQUE_NOISE = 0.01  # N m
_BLOCK = 25  # periods a block
_CHUNK_ROWS = 8000  # messages a chunk: below a megabyte
_MAGIC = b"\x89MCAP0\r\n"


def motion(seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles, velocities and accelerations (2, N) of one period: ten harmonics from 0.1 to 2 Hz a
    joint.
    """
    draw = np.random.default_rng(seed)
    t = np.arange(round(PERIOD * RATE)) / RATE
    order = np.arange(1, 21, 2)
    rate = 2 * np.pi * order / PERIOD
    amplitude = draw.uniform(0.3, 0.9, (2, order.size)) / np.sqrt(order)
    angle = rate * t[:, None]
    phase = draw.uniform(0, 2 * np.pi, (2, 1, order.size))
    theta, omega, alpha = (
        np.stack([wave @ row for wave, row in zip(waves, factor, strict=True)])
        for waves, factor in (
            (np.sin(angle + phase), amplitude),
            (np.cos(angle + phase), amplitude * rate),
            (-np.sin(angle + phase), amplitude * rate**2),
        )
    )
    return theta, omega, alpha


def blocks(rows: int, case: str = "case1") -> Iterator[Log]:
    """A log of `rows` samples in blocks; the same for the same length."""
    draw = np.random.default_rng(1)
    theta, omega, alpha = motion()
    clean = np.tile(
        inverse_dynamics(load_case(case).arm.constants(), theta, omega, alpha), (1, _BLOCK)
    )
    theta = np.tile(np.rint(theta / ENCODER_STEP) * ENCODER_STEP, (1, _BLOCK))
    for first in range(0, rows, theta.shape[1]):
        count = min(theta.shape[1], rows - first)
        noisy = clean[:, :count] + TORQUE_NOISE * draw.standard_normal((2, count))
        tau = np.rint(noisy / TORQUE_STEP) * TORQUE_STEP
        stamps = START_NS + (first + np.arange(count)) * (10**9 // RATE)
        yield Log(stamps, theta[:, :count], tau, Origin("", "", {}))


def parquet(path: Path, rows: int) -> Path:
    """The log as Parquet, once."""
    if not path.exists():
        write_log(path, blocks(rows))
    return path


def mcap(path: Path, rows: int) -> Path:
    """The log as MCAP, once: what a ROS 2 recorder writes, laid out a chunk at a time."""
    if not path.exists():
        with whole_file(path) as temporary, temporary.open("wb") as stream:
            _write_mcap(stream, blocks(rows))
    return path


def _write_mcap(stream: BinaryIO, log: Iterator[Log]) -> None:
    schema = (
        struct.pack("<H", 1) + _text(JOINT_STATE) + _text("ros2msg") + _text(JOINT_STATE_DEFINITION)
    )
    channel = struct.pack("<HH", 0, 1) + _text(TOPIC) + _text("cdr") + struct.pack("<I", 0)
    head = (
        _record(1, _text("ros2") + _text("algid bench")) + _record(3, schema) + _record(4, channel)
    )
    stream.write(_MAGIC + head)
    packer = zstandard.ZstdCompressor(level=1, threads=0)
    index, sequence, first_ns, last_ns = [], 0, 0, 0
    for block in log:
        for first in range(0, len(block), _CHUNK_ROWS):
            part = block.part(first, min(first + _CHUNK_ROWS, len(block)))
            index.append(_write_chunk(stream, part, sequence, packer))
            sequence += len(part)
            first_ns, last_ns = first_ns or int(part.stamp_ns[0]), int(part.stamp_ns[-1])
    stream.write(_record(0x0F, struct.pack("<I", 0)))
    summary = stream.tell()
    counts = struct.pack("<IHQ", 10, 0, sequence)
    figures = struct.pack("<QHIIIIQQ", sequence, 1, 1, 0, 0, len(index), first_ns, last_ns) + counts
    stream.write(
        _record(3, schema) + _record(4, channel) + _record(0x0B, figures) + b"".join(index)
    )
    stream.write(_record(2, struct.pack("<QQI", summary, 0, 0)) + _MAGIC)


def _write_chunk(
    stream: BinaryIO, part: Log, sequence: int, packer: zstandard.ZstdCompressor
) -> bytes:
    """Write the samples of `part` as a chunk of messages and its message index.

    Gives its chunk index record.
    """
    plain, size = _messages(part, sequence)
    span = struct.pack("<QQ", int(part.stamp_ns[0]), int(part.stamp_ns[-1]))
    packed = packer.compress(plain)
    body = (
        span
        + struct.pack("<QI", len(plain), 0)
        + _text("zstd")
        + struct.pack("<Q", len(packed))
        + packed
    )
    start, chunk = stream.tell(), _record(6, body)
    entries = np.stack([part.stamp_ns, size * np.arange(len(part))], axis=1).astype("<u8").tobytes()
    index = _record(7, struct.pack("<HI", 0, len(entries)) + entries)
    stream.write(chunk + index)
    places = struct.pack("<QQIHQQ", start, len(chunk), 10, 0, start + len(chunk), len(index))
    return _record(8, span + places + _text("zstd") + struct.pack("<QQ", len(packed), len(plain)))


def _messages(part: Log, sequence: int) -> tuple[bytes, int]:
    """The samples of `part` as message records, and the bytes of one."""
    content = messages(part)
    size = content.dtype.itemsize
    fields = [
        ("code", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log", "<u8"),
    ]
    rows = np.zeros(len(part), np.dtype([*fields, ("publish", "<u8"), ("data", f"V{size}")]))
    rows["code"], rows["length"] = 5, 22 + size
    rows["sequence"] = sequence + np.arange(len(part))
    rows["log"] = rows["publish"] = part.stamp_ns
    rows["data"] = content.view(f"V{size}")
    return rows.tobytes(), rows.itemsize


def _record(code: int, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


def _text(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def bag(path: Path, rows: int) -> Path:
    """The log as a rosbag2 folder, once."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    if not path.exists():
        store = get_typestore(Stores.ROS2_HUMBLE)
        with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(TOPIC, JOINT_STATE, typestore=store)
            for block in blocks(rows):
                for stamp, payload in zip(block.stamp_ns.tolist(), messages(block), strict=True):
                    writer.write(connection, stamp, payload.tobytes())
    return path
