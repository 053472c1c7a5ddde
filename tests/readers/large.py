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
from numpy.typing import NDArray

from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
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


def _behind(head: Octets, bodies: Octets, **numbers: tuple[int, NDArray[np.generic]]) -> Octets:
    """Each of the bodies behind a head, into which numbers are put at their places."""
    rows = bodies.shape[0]
    heads = np.tile(head, (rows, 1))
    for place, values in numbers.values():
        raw = values.view(np.uint8).reshape(rows, -1)
        heads[:, place : place + raw.shape[1]] = raw
    return np.hstack([heads, bodies])


def _spans(rows: int) -> Iterator[tuple[int, int]]:
    for first in range(0, rows, CHUNK):
        yield first, min(CHUNK, rows - first)


def _text(value: str | bytes) -> bytes:
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(raw)) + raw


def _record(code: int, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


def write_mcap(path: Path, rows: int) -> None:
    """An MCAP file with message indexes and a summary."""
    schema = _record(
        3, b"\1\0" + _text(JOINT_STATE) + _text("ros2msg") + _text(JOINT_STATE_DEFINITION)
    )
    channel = _record(4, b"\1\0\1\0" + _text(TOPIC) + _text("cdr") + struct.pack("<I", 0))
    indexes: list[bytes] = []
    with path.open("wb") as stream:
        stream.write(
            b"\x89MCAP0\r\n" + _record(1, _text("ros2") + _text("large")) + schema + channel
        )
        for first, count in _spans(rows):
            bodies = _bodies(first, count, ros1=False)
            stamps = np.arange(first, first + count, dtype="<i8") * 1_000_000
            head = np.frombuffer(
                struct.pack("<BQHIQQ", 5, 22 + bodies.shape[1], 1, 0, 0, 0), np.uint8
            )
            records = _behind(head, bodies, log=(15, stamps), publish=(23, stamps))
            inside = records.tobytes()
            times = struct.pack("<QQ", int(stamps[0]), int(stamps[-1]))
            chunk = (
                times
                + struct.pack("<QI", len(inside), 0)
                + _text("")
                + struct.pack("<Q", len(inside))
                + inside
            )
            place = stream.tell()
            stream.write(_record(6, chunk))
            offsets = np.arange(count, dtype="<i8") * records.shape[1]
            index = _record(
                7, struct.pack("<HI", 1, 16 * count) + np.stack([stamps, offsets], 1).tobytes()
            )
            at = stream.tell()
            stream.write(index)
            body = (
                times + struct.pack("<QQIHQQ", place, at - place, 10, 1, at, len(index)) + _text("")
            )
            indexes.append(_record(8, body + struct.pack("<QQ", len(inside), len(inside))))
        stream.write(_record(15, bytes(4)))
        start = stream.tell()
        last = (rows - 1) * 1_000_000
        counts = struct.pack("<QHIIIIQQ", rows, 1, 1, 0, 0, len(indexes), 0, last) + struct.pack(
            "<IHQ", 10, 1, rows
        )
        stream.write(schema + channel + b"".join(indexes) + _record(11, counts))
        stream.write(_record(2, struct.pack("<QQI", start, 0, 0)) + b"\x89MCAP0\r\n")


def _fields(**fields: bytes) -> bytes:
    parts = [
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in fields.items()
    ]
    return struct.pack("<I", sum(map(len, parts))) + b"".join(parts)


def _part(data: bytes, **fields: bytes) -> bytes:
    return _fields(**fields) + struct.pack("<I", len(data)) + data


_ROS1_DEFINITION = (
    b"Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    + b"=" * 80
    + b"\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
)


def write_bag(path: Path, rows: int) -> None:
    """A ROS 1 bag without packing."""
    told = _fields(
        type=b"sensor_msgs/JointState", md5sum=b"0" * 32, message_definition=_ROS1_DEFINITION
    )[4:]
    connection = _part(told, op=b"\x07", conn=bytes(4), topic=TOPIC.encode())
    infos: list[bytes] = []
    with path.open("wb") as stream:
        stream.write(b"#ROSBAG V2.0\n")
        place = stream.tell()

        def head(index: int) -> bytes:
            counts = {
                "conn_count": struct.pack("<I", 1),
                "chunk_count": struct.pack("<I", len(infos)),
            }
            return _part(b" " * 4000, op=b"\x03", index_pos=struct.pack("<Q", index), **counts)

        stream.write(head(0))
        for first, count in _spans(rows):
            bodies = _bodies(first, count, ros1=True)
            ticks = np.arange(first, first + count, dtype=np.int64)
            stamps = np.stack([ticks // 1000, ticks % 1000 * 1_000_000], 1).astype("<u4")
            lead = _fields(op=b"\x02", conn=bytes(4), time=bytes(8)) + struct.pack(
                "<I", bodies.shape[1]
            )
            records = _behind(np.frombuffer(lead, np.uint8), bodies, time=(len(lead) - 12, stamps))
            inside = connection + records.tobytes()
            at = stream.tell()
            size = struct.pack("<I", len(inside))
            stream.write(_part(inside, op=b"\x05", compression=b"none", size=size))
            entries = np.empty((count, 3), "<u4")
            entries[:, :2], entries[:, 2] = (
                stamps,
                len(connection) + np.arange(count) * records.shape[1],
            )
            several = struct.pack("<I", count)
            stream.write(
                _part(entries.tobytes(), op=b"\x04", ver=b"\1\0\0\0", conn=bytes(4), count=several)
            )
            times = {"start_time": stamps[0].tobytes(), "end_time": stamps[-1].tobytes()}
            position = struct.pack("<Q", at)
            infos.append(
                _part(
                    struct.pack("<II", 0, count),
                    op=b"\x06",
                    ver=b"\1\0\0\0",
                    chunk_pos=position,
                    count=b"\1\0\0\0",
                    **times,
                )
            )
        index = stream.tell()
        stream.write(connection + b"".join(infos))
        stream.seek(place)
        stream.write(head(index))


CUT = """
WITH RECURSIVE row(r) AS (SELECT 0 UNION ALL SELECT r + 1 FROM row WHERE r + 1 < :n)
INSERT INTO messages(topic_id, timestamp, data)
SELECT 1, (:first + r) * 1000000, substr(:bodies, 1 + r * :size, :size) FROM row
"""


def write_db3(path: Path, rows: int) -> None:
    """A SQLite file as older rosbag2 writes it, without definitions."""
    with closing(sqlite3.connect(path)) as base:
        base.execute("PRAGMA journal_mode = OFF")
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
        for first, count in _spans(rows):
            bodies = _bodies(first, count, ros1=False)
            spans = {"first": first, "n": count, "size": bodies.shape[1]}
            base.execute(CUT, {"bodies": bodies.tobytes(), **spans})
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
