"""Long logs of messages, made by the array: two joints swing at 1 kHz."""

from __future__ import annotations

import sqlite3
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from algid.base.ros2 import JOINT_STATE
from tests.readers import mcaps
from tests.readers.mcaps import TOPIC, joint_state

CHUNK = 5000
Octets = NDArray[np.uint8]


def _bodies(first: int, rows: int, *, ros1: bool) -> Octets:
    """Joint states (rows, bytes) as ROS 2 or ROS 1 writes them."""
    marks = [9e99, 8e99, 7e99, 6e99, 5e99, 4e99]
    template = joint_state(0, position=marks[:2], velocity=marks[2:4], effort=marks[4:]).done()
    if ros1:
        names = b"".join(struct.pack("<I", 6) + name for name in (b"joint1", b"joint2"))
        lists = b"".join(struct.pack("<I2d", 2, *marks[two : two + 2]) for two in (0, 2, 4))
        template = struct.pack("<4I", 0, 0, 0, 0) + struct.pack("<I", 2) + names + lists
    octets = np.tile(np.frombuffer(template, np.uint8), (rows, 1))
    ticks = np.arange(first, first + rows, dtype=np.int64)
    start = 4
    for place, values in ((start, ticks // 1000), (start + 4, ticks % 1000 * 1_000_000)):
        octets[:, place : place + 4] = values.astype("<u4").view(np.uint8).reshape(rows, 4)
    for joint, mark in enumerate(marks):
        place = template.index(struct.pack("<d", mark))
        wave = (1 + joint) * np.sin(ticks * (0.001 + 0.0003 * joint))
        octets[:, place : place + 8] = wave.astype("<f8").view(np.uint8).reshape(rows, 8)
    return octets


def _messages(rows: int, *, ros1: bool = False) -> Iterator[tuple[str, int, bytes]]:
    for first in range(0, rows, CHUNK):
        bodies = _bodies(first, min(CHUNK, rows - first), ros1=ros1)
        for row, body in enumerate(bodies, start=first):
            yield TOPIC, row * 1_000_000, body.tobytes()


def write_mcap(path: Path, rows: int) -> None:
    """An MCAP file with message indexes and a summary."""
    mcaps.write_mcap(path, _messages(rows), compression=CompressionType.NONE, chunk_size=1 << 20)


def write_bag(path: Path, rows: int) -> None:
    """A ROS 1 bag without packing."""
    with Writer(path) as writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        connection = writer.add_connection(TOPIC, JOINT_STATE, typestore=store)
        for _, stamp, data in _messages(rows, ros1=True):
            writer.write(connection, stamp, data)


def write_db3(path: Path, rows: int) -> None:
    """A SQLite file as older rosbag2 writes it, without definitions."""
    with closing(sqlite3.connect(path)) as base:
        base.execute("PRAGMA synchronous = OFF")
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
            "serialization_format TEXT)"
        )
        base.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
            "data BLOB)"
        )
        base.execute("INSERT INTO topics VALUES (1, ?, ?, 'cdr')", (TOPIC, JOINT_STATE))
        base.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)",
            (one[1:] for one in _messages(rows)),
        )
        base.commit()


WRITERS = {"mcap": write_mcap, "bag": write_bag, "db3": write_db3}


_PEAK = """
import re, sys
from pathlib import Path
from algid.readers import open_log
rows = sum(map(len, open_log(sys.argv[1]).blocks()))
# of this program alone: ru_maxrss goes on from the one that starts it
status = Path("/proc/self/status").read_text()
print(rows, 1024 * int(re.search(r"VmHWM:\\s*(\\d+)", status)[1]))
"""


def peak_of_reading(path: Path) -> tuple[int, int]:
    """Samples of a log, and the bytes that a program of its own takes to go through its blocks."""
    done = subprocess.run(
        [sys.executable, "-c", _PEAK, str(path)], capture_output=True, text=True, check=True
    )
    rows, peak = map(int, done.stdout.split())
    return rows, peak
