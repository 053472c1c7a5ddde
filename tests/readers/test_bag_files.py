"""ROS 1 bags and SQLite files that lie, break off or never end: what is there is read, and what is
lost is told.
"""

from __future__ import annotations

import signal
import sqlite3
import struct
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from algid.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.bags import parts_of
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import write_mcap
from tests.readers.test_bag import PAIR, TYPE, message, states, two

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


@pytest.mark.parametrize(
    "packing", [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4]
)
@pytest.mark.parametrize("imu", [False, True])
def test_every_packing_reads_the_same_as_with_the_library(
    packing: Packing, imu: bool, tmp_path: Path
) -> None:
    path = ros1(tmp_path / "a.bag", packing, imu=imu)
    found = read_log(path)
    assert same(found, LOG)
    assert found.notices == ()
    with AnyReader([path]) as reader:
        wanted = [one for one in reader.connections if one.topic == "/joint_states"]
        theirs = [
            reader.deserialize(raw, one.msgtype)
            for one, _, raw in reader.messages(connections=wanted)
        ]
    efforts = [one.effort for one in theirs]  # type: ignore[attr-defined]
    assert np.array_equal(found.tau, np.array(efforts).T)


def head_field(content: bytes, name: bytes) -> int:
    """Where the value of a field of the bag's own header stands."""
    return content.index(name + b"=") + len(name) + 1


@pytest.mark.parametrize("chunks", [0, 1, 5, 1000])
def test_a_header_that_lies_about_its_chunks_loses_nothing(chunks: int, tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", imu=True)
    poked(path, head_field(path.read_bytes(), b"chunk_count"), "<I", chunks)
    found = read_log(path)
    assert same(found, LOG)
    assert codes(found) == ({"CUT_OFF": True} if chunks == 1000 else {"DAMAGED_INDEX": False})


@pytest.mark.parametrize(
    ("name", "form", "value"), [(b"conn_count", "<I", 7), (b"index_pos", "<Q", 5000)]
)
def test_a_header_that_lies_about_its_index_loses_nothing(
    name: bytes, form: str, value: int, tmp_path: Path
) -> None:
    path = ros1(tmp_path / "a.bag", imu=True)
    poked(path, head_field(path.read_bytes(), name), form, value)
    found = read_log(path)
    assert same(found, LOG)
    assert codes(found) == {"DAMAGED_INDEX": False}


@pytest.mark.parametrize("other", [4117, 20_000, 1 << 40])
def test_a_wrong_chunk_pointer_loses_nothing(other: int, tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    content = path.read_bytes()
    places = [place for place in range(len(content)) if content.startswith(b"chunk_pos=", place)]
    poked(path, places[3] + 10, "<Q", other)
    found = read_log(path)
    assert same(found, LOG)
    assert codes(found) == {"DAMAGED_INDEX": False}


def test_indexes_that_hide_the_joints_lose_nothing(tmp_path: Path) -> None:
    """The index behind a chunk lists none of its messages, while the end of the file tells of
    them.
    """
    path = ros1(tmp_path / "a.bag", imu=True)
    content = path.read_bytes()
    places = [place for place in range(len(content)) if content.startswith(b"op=\x04", place)]
    poked(path, content.index(b"conn=", places[2]) + 5, "<I", 1)
    found = read_log(path)
    assert same(found, LOG)
    assert codes(found) == {"DAMAGED_INDEX": False}


def test_an_index_of_wrong_offsets_is_not_believed(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    content = path.read_bytes()
    place = content.index(b"op=\x04")
    poked(
        path,
        content.index(struct.pack("<II", *divmod(int(LOG.stamp_ns[0]), 10**9)), place) + 8,
        "<I",
        40,
    )
    assert same(read_log(path), LOG)


def test_a_bag_that_was_not_closed_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    content = path.read_bytes()
    poked(path, head_field(content, b"index_pos"), "<Q", 0)
    poked(path, head_field(content, b"chunk_count"), "<I", 0)
    start = content.index(b"op=\x07", content.rindex(b"op=\x04"))
    path.write_bytes(path.read_bytes()[: start - 40])  # the index at the end was never written
    found = read_log(path)
    assert len(found) > len(LOG) - 20
    assert same(found, LOG.part(0, len(found)))
    assert codes(found)["CUT_OFF"]


def test_records_behind_a_chunk_that_was_never_closed_are_read(tmp_path: Path) -> None:
    """A recorder writes a chunk's head with no length, and mends it when the chunk is full."""
    path = ros1(tmp_path / "a.bag", threshold=1 << 30)
    content = bytearray(path.read_bytes())
    head = content.index(b"op=\x05")
    (length,) = struct.unpack_from("<I", content, head - 8)
    struct.pack_into("<I", content, head - 4 + length, 0)
    struct.pack_into("<I", content, content.index(b"size=", head) + 5, 0)
    cut = content.index(struct.pack("<d", LOG.tau[0, 300]))
    path.write_bytes(content[:cut])
    found = read_log(path)
    assert same(found, LOG.part(0, 300))
    assert codes(found) == {"CUT_OFF": True}


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("packing", [None, Writer.CompressionFormat.LZ4])
def test_a_bag_that_breaks_off_is_read_up_to_there(
    packing: Packing, share: float, tmp_path: Path
) -> None:
    path = ros1(tmp_path / "a.bag", packing)
    content = path.read_bytes()
    path.write_bytes(content[: round(share * len(content))])
    found = read_log(path)
    assert len(found) > (share - 0.15) * len(LOG)
    assert same(found, LOG.part(0, len(found)))
    assert codes(found)["CUT_OFF"]


def test_a_damaged_chunk_is_left_out_and_counted(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", Writer.CompressionFormat.LZ4)
    content = path.read_bytes()
    third = [place for place in range(len(content)) if content.startswith(b"op=\x05", place)][2]
    place = content.index(b"\x04\x22\x4d\x18", third)  # an LZ4 frame
    path.write_bytes(content[: place + 40] + bytes(60) + content[place + 100 :])
    found = read_log(path)
    (notice,) = found.notices
    assert (notice.code, notice.lossy) == ("DAMAGED_CHUNK", True)
    assert f"{len(LOG) - len(found)} messages are missing" in notice.text
    assert 0 < len(LOG) - len(found) < 40


def test_a_connection_that_is_given_another_meaning_ends_what_is_read(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    content = path.read_bytes()
    last = content.rindex(b"op=\x07")
    path.write_bytes(
        content[: last - 60] + content[last - 60 :].replace(b"/joint_states", b"/joint_statez")
    )
    with pytest.raises(LogError, match="connection 0 is defined anew and differently"):
        read_log(path)


@pytest.mark.parametrize("claim", [0, 100, 1 << 31])
def test_a_chunk_that_claims_another_size_is_told(claim: int, tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", Writer.CompressionFormat.BZ2)
    content = path.read_bytes()
    place = content.index(b"size=", content.index(b"op=\x05") - 20)
    poked(path, place + 5, "<I", claim)
    if claim > 1 << 28:
        with pytest.raises(LogError, match=r"a chunk claims 2,147,483,648 bytes, more than"):
            read_log(path)
    else:
        assert any(codes(read_log(path)).values())


def test_an_encrypted_bag_is_refused(tmp_path: Path) -> None:
    fields = [b"op=\x03", b"index_pos=" + bytes(8), b"encryptor=some/AesCbc"]
    head = b"".join(struct.pack("<I", len(one)) + one for one in fields)
    (tmp_path / "a.bag").write_bytes(
        b"#ROSBAG V2.0\n" + struct.pack("<I", len(head)) + head + struct.pack("<I", 0)
    )
    with pytest.raises(LogError, match=r"the bag is encrypted \(some/AesCbc\); decrypt it first"):
        read_log(tmp_path / "a.bag")


def test_times_durations_and_empty_parts_of_ros1_stand_where_the_library_has_them(
    tmp_path: Path,
) -> None:
    """In an MCAP file, as recorders of ROS 1 write it: the encoding is the bag's."""
    text = (
        "time stamp\nduration wait\nbyte[3] raw\nstd_msgs/Empty none\nfloat32[] q\nduration[] "
        "list\nfloat64[2] tau\n"
        "int32 LIMIT=5\nstring note\nuint8 tail\n" + "=" * 80 + "\nMSG: std_msgs/Empty\n"
    )
    note = b"xyz"
    messages = []
    for row in range(30):
        body = struct.pack("<IIii3b", 7, row, -1, 500, 1, 2, 3)
        body += struct.pack("<I2f", 2, row * 0.5, row * 0.25) + struct.pack("<I4i", 2, 1, 2, 3, 4)
        body += (
            struct.pack("<2d", 10.0 + row, 20.0 - row)
            + struct.pack("<I", len(note))
            + note
            + b"\x09"
        )
        messages.append(("/arm", row * 10**6, body))
    write_mcap(
        tmp_path / "a.mcap",
        messages,
        {"/arm": ("lab/Arm", "ros1msg", text.encode())},
        encoding="ros1",
    )
    places = {"theta1": "q[0]", "theta2": "q[1]", "tau1": "tau[0]", "tau2": "tau[1]"}
    profile = {"topic": "/arm", **{name: {"source": source} for name, source in places.items()}}
    found = read_log(tmp_path / "a.mcap", Profile.model_validate(profile))
    assert found.stamp_ns.tolist() == [7 * 10**9 + row for row in range(30)]
    assert found.theta.tolist() == [
        [row * 0.5 for row in range(30)],
        [row * 0.25 for row in range(30)],
    ]
    assert found.tau.tolist() == [
        [10.0 + row for row in range(30)],
        [20.0 - row for row in range(30)],
    ]
    odd = Profile.model_validate({**profile, "tau2": {"source": "tail"}})
    assert read_log(tmp_path / "a.mcap", odd).tau[1].tolist() == [9.0] * 30


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
    assert (notice.code, notice.lossy) == ("DAMAGED_CHUNK", True)
    assert "2 damaged rows left out; the first: b'" not in notice.text
    assert "2 messages are missing" in notice.text
    changed(file, "UPDATE messages SET timestamp = 'noon'")
    with pytest.raises(
        LogError,
        match=r"the file is damaged \('noon' for a time or a message in the table 'messages'",
    ):
        read_log(file)


def test_messages_of_no_topic_are_told(tmp_path: Path) -> None:
    file, log = database(tmp_path)
    changed(file, "UPDATE messages SET topic_id = 99 WHERE rowid > 150")
    found = read_log(file)
    assert len(found) == 150
    assert codes(found) == {"STRAY_MESSAGES": True}
    assert (
        found.notices[0].text
        == f"{len(log) - 150} messages of no topic that the table 'topics' lists; left out"
    )


ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"
HOSTILE: dict[str, tuple[list[str], str]] = {
    "messages a view": (
        ["ALTER TABLE messages RENAME TO m", (f"CREATE VIEW messages AS {ENDLESS} SELECT x AS id, "
                                              "1 AS topic_id, "
         "x AS timestamp, data FROM c, m")],
        r"expected the table 'messages' of a rosbag2 file, found a view in its place",
    ),
    "topics a view": (
        ["ALTER TABLE topics RENAME TO m", (f"CREATE VIEW topics AS {ENDLESS} SELECT x AS id, "
                                            "name, type, "
         "serialization_format FROM c, m")],
        r"expected the table 'topics' of a rosbag2 file, found a view in its place",
    ),
    "definitions a view": (
        ["DROP TABLE message_definitions", (f"CREATE VIEW message_definitions AS {ENDLESS} SELECT "
                                            "'a' AS topic_type, "
         "'b' AS encoding, 'c' AS encoded_message_definition FROM c")],
        r"expected the table 'message_definitions' of a rosbag2 file, found a view",
    ),
    "no messages": (["DROP TABLE messages"], ("the table 'messages' of a rosbag2 file, found no "
                                             "such table")),
    "a virtual table": (
        ["DROP TABLE messages", ("CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, "
                                "data)")],
        "expected the table 'messages' of a rosbag2 file, found a table in its place",
    ),
    "a computed column": (
        ["DROP TABLE messages", ("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, "
                                 "timestamp INTEGER, "
         "data BLOB AS (zeroblob(1000000000)))")],
        "expected a plain column 'data' in the table 'messages'",
    ),
    "without rowid": (
        ["DROP TABLE messages", ("CREATE TABLE messages(topic_id INTEGER PRIMARY KEY, timestamp "
                                 "INTEGER, data BLOB) "
         "WITHOUT ROWID"), "INSERT INTO messages VALUES (1, 2, x'00')"],
        r"the bag cannot be read \(no such column: rowid\)",
    ),
    "countless topics": (
        [("INSERT INTO topics(name, type, serialization_format, offered_qos_profiles, "
          "type_description_hash) "
         f"{ENDLESS} SELECT 't' || x, 'y', 'cdr', '', '' FROM c LIMIT 2000")],
        "more than 1000 topics",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_database_that_is_none_of_rosbag2_is_refused_at_once(kind: str, tmp_path: Path) -> None:
    file, _ = database(tmp_path)
    statements, words = HOSTILE[kind]
    changed(file, *statements)
    with pytest.raises(LogError, match=words):
        read_log(file)


def test_an_index_that_leaves_rows_out_is_not_used(tmp_path: Path) -> None:
    file, log = database(tmp_path)
    changed(
        file, "CREATE INDEX few ON messages(topic_id, timestamp, data) WHERE topic_id IS NOT NULL"
    )
    assert same(read_log(file), log)


def test_pages_in_a_circle_end_after_so_many_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows without end stand for them: what a database may ask for is bounded by its size."""
    file, _ = database(tmp_path)
    changed(
        file,
        f"INSERT INTO messages(topic_id, timestamp, data) {ENDLESS} SELECT 1, x, x'00' FROM c "
        "LIMIT 5000",
    )
    monkeypatch.setattr(
        "algid.readers.bags.sqlite.LIMITS", limits(free_sqlite_steps=10_000, sqlite_steps_a_byte=0)
    )
    with pytest.raises(LogError, match="it asks for more steps than any database of its size"):
        read_log(file)
    monkeypatch.setattr("algid.readers.bags.sqlite.LIMITS", limits(free_work=10, work_a_byte=0))
    with pytest.raises(LogError, match="more parts than any recorder's"):
        read_log(file)


def limits(**changes: int) -> Any:
    from dataclasses import replace

    from algid.limits import LIMITS

    return replace(LIMITS, **changes)


def test_what_is_not_in_the_database_yet_is_read_from_beside_it(tmp_path: Path) -> None:
    """A recorder that was killed leaves the last rows in a file of their own."""
    file, log = database(tmp_path)
    base = sqlite3.connect(file)
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    base.execute("UPDATE messages SET timestamp = timestamp + 1")
    base.execute("DELETE FROM messages WHERE rowid > 120")
    base.commit()
    assert file.with_name(f"{file.name}-wal").stat().st_size > 0
    assert len(read_log(file)) == 120
    base.close()
    assert len(read_log(file)) == 120
    assert len(log) == 200


def lacking(count: int, each: int) -> list[dict[str, Any]]:
    """Joint states of which all but each third, or so, have no effort."""
    return [PAIR if row % each == 0 else {**PAIR, "effort": []} for row in range(count)]


@pytest.mark.parametrize("form", ["db3", "bag"])
def test_messages_without_effort_are_lost_and_counted(form: str, tmp_path: Path) -> None:
    if form == "db3":
        (path,) = states(tmp_path / "bag", *lacking(90, 3)).glob("*.db3")
    else:
        path = tmp_path / "a.bag"
        with Writer(path) as writer:
            channel = writer.add_connection("/joint_states", TYPE, typestore=ROS1)
            for row in range(90):
                one = message(ROS1, LOG, row, first=True)
                one.effort = one.effort if row % 3 == 0 else np.empty(0)
                one.velocity = np.empty(0)
                writer.write(channel, int(LOG.stamp_ns[row]), ROS1.serialize_ros1(one, TYPE))
    found = read_log(path)
    assert len(found) == 30
    (notice,) = (notice for notice in found.notices if notice.lossy)
    assert notice.code == "LACKING_MESSAGES"
    assert notice.text.startswith("60 messages on '/joint_states' left out for want of effort[")


@pytest.mark.parametrize("known", [True, False])
def test_a_type_whose_definition_the_file_lacks(
    known: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    if known:
        found = read_log(file, Profile.model_validate(profile))
        assert np.array_equal(found.theta, log.theta)
        assert np.array_equal(found.tau, log.tau)
    else:
        monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
        with pytest.raises(
            LogError, match=r"holds no definition of std_msgs/msg/Float64MultiArray.*algid\[bags\]"
        ):
            read_log(file, Profile.model_validate(profile))


def test_a_type_of_every_file_needs_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, log = database(tmp_path)
    changed(file, "DROP TABLE message_definitions")
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    assert same(read_log(file), log)


@pytest.mark.slow
def test_a_database_that_asks_for_much_ends_by_a_signal(tmp_path: Path) -> None:
    """A table of very many small rows of another topic: what SQLite does in one call is bounded."""
    file, _ = database(tmp_path)
    changed(
        file,
        f"INSERT INTO messages(topic_id, timestamp, data) {ENDLESS} SELECT 1, x, x'00' FROM c "
        "LIMIT 3000000",
    )
    opens = "lambda event, _: event == 'sqlite3.connect' and print(event, flush=True)"
    code = (
        f"import sys; sys.addaudithook({opens}); from algid.cli import main; "
        "sys.argv = ['algid', 'inspect', sys.argv[1]]; main()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "sqlite3.connect\n"
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=20) == 128 + signal.SIGTERM


def test_channels_of_bags_are_listed(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag", imu=True)
    (opener,), _ = parts_of(path, "bag")
    with opener() as source:
        counts = source.counts or {}
        assert {one.topic: counts[number] for number, one in source.channels.items()} == {
            "/joint_states": 400,
            "/tick": 480,
        }
        assert source.span_ns == (int(LOG.stamp_ns[0]), int(LOG.stamp_ns[-1]))


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


def test_a_folder_of_two_files_is_read_as_one(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    log = noise_log(100, start_ns=EPOCH_NS)
    for part, rows in (("a", range(60)), ("b", range(60, 100))):
        with Writer2(tmp_path / part, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
            channel = writer.add_connection("/joint_states", TYPE, typestore=store)
            for row in rows:
                data = store.serialize_cdr(message(store, log, row, first=False), TYPE)
                writer.write(channel, int(log.stamp_ns[row]), data)
    folder = tmp_path / "whole"
    folder.mkdir()
    for number, part in enumerate("ab"):
        (tmp_path / part / f"{part}.db3").rename(folder / f"whole_{number}.db3")
    assert same(read_log(folder), log)
