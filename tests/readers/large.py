"""Long logs of messages at 1 kHz, and what reading one takes."""

from __future__ import annotations

import sqlite3
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer

from algid.base.ros2 import JOINT_STATE
from tests.readers import mcaps
from tests.readers.mcaps import STORES, TOPIC, state_of


def _messages(rows: int, *, ros1: bool = False) -> Iterator[tuple[str, int, bytes]]:
    """Joint states as ROS 2 or ROS 1 writes them: only their stamps differ."""
    store, head = (STORES[0], {"seq": 0}) if ros1 else (STORES[1], {})
    message = state_of(store, 0, ("joint1", "joint2"), [1, 2], [3, 4], [5, 6], **head)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    body = bytes(serialize(message, JOINT_STATE))
    for row in range(rows):
        stamp = struct.pack("<II", row // 1000, row % 1000 * 1_000_000)
        yield TOPIC, row * 1_000_000, body[:4] + stamp + body[12:]


def write_mcap(path: Path, rows: int) -> None:
    """An MCAP file with message indexes and a summary."""
    mcaps.write_mcap(path, _messages(rows), compression=CompressionType.NONE, chunk_size=1 << 20)


def write_bag(path: Path, rows: int) -> None:
    """A ROS 1 bag without packing."""
    with Writer(path) as writer:
        connection = writer.add_connection(TOPIC, JOINT_STATE, typestore=STORES[0])
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
