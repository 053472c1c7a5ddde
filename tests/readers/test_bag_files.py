"""ROS 1 bags and SQLite files that lie or break off: read up to the break and told, or refused."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.test_bag import TYPE, message, two

LOG = noise_log(400, start_ns=EPOCH_NS)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
Packing = Writer.CompressionFormat | None


def ros1(path: Path, packing: Packing = None, threshold: int = 4096, imu: bool = False) -> Path:
    """The log as a ROS 1 bag of small chunks, with another topic in some of them."""
    writer = Writer(path)
    writer.chunk_threshold = threshold
    if packing is not None:
        writer.set_compression(packing)
    with writer:
        channel = writer.add_connection("/joint_states", TYPE, typestore=ROS1)
        other = writer.add_connection("/tick", "std_msgs/msg/Time", typestore=ROS1) if imu else None
        moment = ROS1.types["builtin_interfaces/msg/Time"]
        for row, stamp in enumerate(LOG.stamp_ns.tolist()):
            writer.write(
                channel, stamp, ROS1.serialize_ros1(message(ROS1, LOG, row, first=True), TYPE)
            )
            for tick in range(60 if row % 50 == 0 else 0):
                if other is None:
                    break
                data = ROS1.types["std_msgs/msg/Time"](data=moment(sec=tick, nanosec=5))
                writer.write(other, stamp, ROS1.serialize_ros1(data, "std_msgs/msg/Time"))
    return path


def poked(path: Path, place: int, form: str, value: int) -> None:
    content = bytearray(path.read_bytes())
    struct.pack_into(form, content, place, value)
    path.write_bytes(content)


def codes(log: Log) -> dict[str, bool]:
    return {notice.code: notice.lossy for notice in log.notices}


def head_field(content: bytes, name: bytes) -> int:
    """Where the value of a field of the bag's own header stands."""
    return content.index(name + b"=") + len(name) + 1


@pytest.mark.parametrize("share", [0.2, 0.9, 0.999])
def test_a_bag_without_its_index_is_refused_with_its_mend(share: float, tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    content = path.read_bytes()
    mend = r"rosbag reindex a\.bag may mend it"
    path.write_bytes(content[: round(share * len(content))])
    with pytest.raises(LogError, match=rf"can be read \(.+\); {mend}"):
        read_log(path)
    path.write_bytes(content)
    poked(path, head_field(content, b"index_pos"), "<Q", 0)  # a recorder that was killed
    with pytest.raises(LogError, match=rf"not indexed.*; {mend}"):
        read_log(path)


def test_an_index_that_lists_fewer_messages_than_it_counts_is_told(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    content = path.read_bytes()
    chunk = content.index(b"count=", content.rindex(b"op=\x04")) + 6  # of the last chunk's index
    (count,) = struct.unpack_from("<I", content, chunk)
    pairs = content.rindex(struct.pack("<II", 0, count))  # of what is told of the last chunk
    poked(path, pairs + 4, "<I", count + 3)
    found = read_log(path)
    assert same(found, LOG)
    assert codes(found) == {"DAMAGED": True}


def test_a_bag_is_read_up_to_its_first_damaged_chunk(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", Writer.CompressionFormat.LZ4)
    content = path.read_bytes()
    third = [place for place in range(len(content)) if content.startswith(b"op=\x05", place)][2]
    place = content.index(b"\x04\x22\x4d\x18", third)  # an LZ4 frame
    path.write_bytes(content[: place + 40] + bytes(60) + content[place + 100 :])
    found = read_log(path)
    assert 20 < len(found) < 100
    assert same(found, LOG.part(0, len(found)))
    (notice,) = found.notices
    assert (notice.code, notice.lossy) == ("DAMAGED", True)
    assert f"{len(LOG) - len(found)} messages are missing" in notice.text


def database(tmp_path: Path) -> tuple[Path, Log]:
    log = two(tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.db3")
    return file, log


def changed(file: Path, *statements: str) -> None:
    with closing(sqlite3.connect(file)) as base:
        for statement in statements:
            base.execute(statement)
        base.commit()


def test_rows_without_a_time_are_counted(tmp_path: Path) -> None:
    file, log = database(tmp_path)
    changed(
        file,
        "UPDATE messages SET timestamp = 'noon' WHERE rowid = 7",
        "UPDATE messages SET data = 5 WHERE rowid = 9",
    )
    found = read_log(file)
    assert len(found) == len(log) - 2
    (notice,) = found.notices
    assert (notice.code, notice.lossy) == ("DAMAGED", True)
    assert notice.text == "the file counts 200 messages and holds 198"


def test_messages_of_no_topic_are_told(tmp_path: Path) -> None:
    file, log = database(tmp_path)
    changed(file, "UPDATE messages SET topic_id = 99 WHERE rowid > 150")
    found = read_log(file)
    assert len(found) == 150
    assert codes(found) == {"MESSAGES_LEFT_OUT": True}
    assert (
        found.notices[0].text
        == f"{len(log) - 150} messages of no topic that the table 'topics' lists; left out"
    )


ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"


@pytest.mark.parametrize(
    ("statements", "told"),
    [
        (
            [
                "ALTER TABLE messages RENAME TO m",
                f"CREATE VIEW messages AS {ENDLESS} SELECT 1 AS topic_id, x AS timestamp FROM c",
            ],
            "no table 'messages'",
        ),
        (["DROP TABLE topics"], "no table 'topics'"),
        (["ALTER TABLE messages RENAME COLUMN data TO payload"], "no such column: data"),
    ],
)
def test_a_database_that_is_no_bag_is_refused(
    statements: list[str], told: str, tmp_path: Path
) -> None:
    file, _ = database(tmp_path)
    changed(file, *statements)
    with pytest.raises(LogError, match=told) as refused:
        read_log(file)
    assert "\n" not in str(refused.value)


def test_a_type_whose_definition_the_file_lacks(tmp_path: Path) -> None:
    """Files of older rosbag2 hold no definitions: the usual types are those of the rosbags
    package.
    """
    file, log = database(tmp_path)
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind, lists = "std_msgs/msg/Float64MultiArray", store.types["std_msgs/msg/Float64MultiArray"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    rows = [
        (
            2,
            stamp,
            bytes(store.serialize_cdr(lists(layout=layout, data=np.array([*theta, *tau])), kind)),
        )
        for stamp, theta, tau in zip(log.stamp_ns.tolist(), log.theta.T, log.tau.T, strict=True)
    ]
    with closing(sqlite3.connect(file)) as base:
        base.execute("DELETE FROM message_definitions")
        base.execute("DELETE FROM messages")
        base.execute("INSERT INTO topics VALUES (2, '/arm', ?, 'cdr', '', '')", (kind,))
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        base.commit()
    places = dict(
        zip(("theta1", "theta2", "tau1", "tau2"), (f"data[{one}]" for one in range(4)), strict=True)
    )
    profile = {"topic": "/arm", **{name: {"source": source} for name, source in places.items()}}
    found = read_log(file, Profile.model_validate(profile))
    assert np.array_equal(found.theta, log.theta)
    assert np.array_equal(found.tau, log.tau)


OPENERS: list[Callable[[Path], Path]] = [
    lambda folder: ros1(folder / "a.bag"),
    lambda folder: database(folder)[0],
]


@pytest.mark.parametrize("made", OPENERS)
def test_a_bag_that_is_damaged_anywhere_is_refused_told_or_harmless(
    made: Callable[[Path], Path], tmp_path: Path
) -> None:
    path = made(tmp_path)
    content = path.read_bytes()
    draw = np.random.default_rng(3)
    for _ in range(60):
        damaged = bytearray(content)
        for place in draw.integers(0, len(content), 3).tolist():
            damaged[place] = int(draw.integers(256))
        path.write_bytes(damaged)
        try:
            read_log(path)
        except LogError as error:
            lines = str(error).splitlines()
            if len(lines) != 1:
                pytest.fail(str(error))
