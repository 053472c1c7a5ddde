"""The logs that `bench` identifies from: a periodic motion and the torque it takes, tiled without end.

The motion of 10 s is a sum of harmonics, so that its derivatives and, by eq. (1), its torque are closed forms;
each repetition gets torque noise of its own, and the encoder's steps.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import zstandard

from algid.arm import FloatArray, inverse_dynamics
from algid.log import Log, Origin
from algid.outfiles import whole_file
from algid.synth.cases import load_case
from algid.writers import write_log
from algid.writers.mcap import DEFINITION, TOPIC, TYPE, payloads

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
    """Angles, velocities and accelerations (2, N) of one period: ten harmonics from 0.1 to 2 Hz a joint."""
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
    clean = np.tile(inverse_dynamics(load_case(case).arm.constants(), theta, omega, alpha), (1, _BLOCK))
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
    """The log as MCAP, once: what algid's own writer writes, laid out a chunk at a time and without an index."""
    if not path.exists():
        with whole_file(path) as temporary, temporary.open("wb") as stream:
            _write_mcap(stream, blocks(rows))
    return path


def _write_mcap(stream: BinaryIO, log: Iterator[Log]) -> None:
    stream.write(_MAGIC)
    _record(stream, 1, _text("ros2") + _text("algid bench"))
    _record(stream, 3, struct.pack("<H", 1) + _text(TYPE) + _text("ros2msg") + _text(DEFINITION))
    _record(stream, 4, struct.pack("<HH", 0, 1) + _text(TOPIC) + _text("cdr") + struct.pack("<I", 0))
    packer = zstandard.ZstdCompressor(level=1)
    sequence = 0
    for block in log:
        for first in range(0, len(block), _CHUNK_ROWS):
            part = block.part(first, min(first + _CHUNK_ROWS, len(block)))
            _record(stream, 6, _chunk(part, sequence, packer))
            sequence += len(part)
    _record(stream, 0x0F, struct.pack("<I", 0))
    _record(stream, 2, struct.pack("<QQI", 0, 0, 0))
    stream.write(_MAGIC)


def _chunk(part: Log, sequence: int, packer: zstandard.ZstdCompressor) -> bytes:
    """Content of a chunk record that holds the samples of `part` as messages."""
    messages = list(payloads(part))
    size = len(messages[0])
    fields = [("code", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8")]
    rows = np.zeros(len(part), np.dtype([*fields, ("publish", "<u8"), ("data", f"V{size}")]))
    rows["code"], rows["length"] = 5, 22 + size
    rows["sequence"] = sequence + np.arange(len(part))
    rows["log"] = rows["publish"] = part.stamp_ns
    rows["data"] = np.frombuffer(b"".join(messages), f"V{size}")
    plain = rows.tobytes()
    head = struct.pack("<QQQI", int(part.stamp_ns[0]), int(part.stamp_ns[-1]), len(plain), 0)
    packed = packer.compress(plain)
    return head + _text("zstd") + struct.pack("<Q", len(packed)) + packed


def _record(stream: BinaryIO, code: int, content: bytes) -> None:
    stream.write(struct.pack("<BQ", code, len(content)) + content)


def _text(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded
