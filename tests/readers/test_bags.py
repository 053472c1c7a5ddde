"""ROS 1 bags and SQLite rosbag2 folders: read, read up to a break, or refused."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.bags import open_messages
from tests.readers.large import write_db3
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import poked
from tests.readers.ways import States, bag1, sent, written

LOG = noise_log(200, start_ns=EPOCH_NS)
PLACES = ("theta1", "theta2", "tau1", "tau2")


def bag(folder: Path) -> Path:
    """The log as a rosbag2 folder in SQLite."""
    return Path(written("db3", folder, States(sent(LOG))))


def described(folder: Path, names: list[str], more: str = "") -> Path:
    """A folder of empty databases, and metadata that list them."""
    folder.mkdir()
    listed = "".join(f"    - {name}\n" for name in names)
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 5\n{more}  relative_file_paths:\n{listed}  "
        "files: []\n"
    )
    return folder


def counts(folder: Path) -> list[list[int]]:
    return [list(one().counts.values()) for one in open_messages(folder, "rosbag2").files]


def test_the_files_of_a_bag_come_as_its_metadata_list_them(tmp_path: Path) -> None:
    names = ["bag_1.db3", '"bag_0.db3"', "'bag_10.db3'", "bag_2.db3"]
    folder = described(tmp_path / "bag", names, "  compression_mode: none\n")
    for number in (0, 1, 2):
        write_db3(folder / f"bag_{number}.db3", 10 * (1 + number))
    assert counts(folder) == [[20], [10], [30]]
    (lost,) = open_messages(folder, "rosbag2").notices
    assert (lost.code, lost.lossy) == ("DAMAGED", True)
    assert lost.text == "1 of 4 files of the bag missing: bag_10.db3"


def test_files_without_metadata_come_by_their_numbers(tmp_path: Path) -> None:
    for rows, name in ((30, "run_10.db3"), (20, "run_9.db3"), (10, "run.db3")):
        write_db3(tmp_path / name, rows)
    (tmp_path / "run_0.txt").touch()
    assert counts(tmp_path) == [[10], [20], [30]]
    (tmp_path / "other_9.db3").touch()
    with pytest.raises(LogError, match="not the numbered parts of one bag"):
        read_log(tmp_path)


@pytest.mark.parametrize(
    ("names", "more", "words"),
    [
        (["a.db3", "b.db3"], "", "no file of a rosbag2 folder is there; expected a.db3, b.db3"),
        (["../a.db3"], "", "no file of a rosbag2 folder is there"),  # it is, outside the folder
        ([".."], "", "no file of a rosbag2 folder is there"),
        (
            ["a.db3"],
            "  compression_mode: FILE\n",
            r"\(compression_mode FILE\).*ros2 bag convert",
        ),
        (["a.db3"], '  compression_mode: "message"\n', "compression_mode message"),
        ([], "", "expected the metadata of a rosbag2 folder with relative_file_paths"),
        (["[" * 5], "", "expected the metadata of a rosbag2 folder"),
    ],
)
def test_folders_that_are_no_bag_are_refused(
    names: list[str], more: str, words: str, tmp_path: Path
) -> None:
    write_db3(tmp_path / "a.db3", 10)
    with pytest.raises(LogError, match=words) as refused:
        read_log(described(tmp_path / "bag", names, more))
    assert "\n" not in str(refused.value)


def test_a_field_needs_a_topic_and_a_topic_its_field(tmp_path: Path) -> None:
    path = bag(tmp_path)
    sources = ("position[0]", "position[1]", "effort[0]", "effort[1]")
    named: dict[str, Any] = {
        name: {"source": own} for name, own in zip(PLACES, sources, strict=True)
    }
    alone = r"theta1 is taken from 'position\[0\]' without a topic: --topic NAME"
    with pytest.raises(LogError, match=alone):
        read_log(path, Profile.model_validate(named))
    log = read_log(path, Profile.model_validate(named | {"topic": "/joint_states"}))
    assert np.array_equal(log.tau, LOG.tau)
    with pytest.raises(LogError, match=r"no message on '/other' has .*--set tau2.topic=NAME"):
        read_log(path, Profile.model_validate({"tau2": {"source": "effort[0]", "topic": "/other"}}))


def lossy(log: Log) -> tuple[str, str]:
    """Code and text of the only notice, which is of a loss."""
    (notice,) = log.notices
    assert notice.lossy
    return notice.code, notice.text


def test_a_bag_without_its_index_is_refused_with_its_mend(tmp_path: Path) -> None:
    path = bag1(tmp_path, States(sent(LOG)))
    content = path.read_bytes()
    mend = r"rosbag reindex log\.bag may mend it"
    for share in (0.2, 0.9, 0.999):
        path.write_bytes(content[: round(share * len(content))])
        with pytest.raises(LogError, match=rf"can be read \(.+\); {mend}"):
            read_log(path)
    # a recorder that was killed
    path.write_bytes(poked(content, content.index(b"index_pos=") + 10, "<Q", 0))
    with pytest.raises(LogError, match=rf"not indexed.*; {mend}"):
        read_log(path)
    # how many topics the last chunk is said to have
    path.write_bytes(poked(content, content.rindex(b"count=") + 6, "<I", 0))
    with pytest.raises(LogError, match=rf"a chunk without messages; {mend}"):
        read_log(path)


def test_a_bag_is_read_up_to_its_first_damaged_chunk(tmp_path: Path) -> None:
    path = bag1(tmp_path, States(sent(LOG)), Writer.CompressionFormat.LZ4)
    content = path.read_bytes()
    third = [place for place in range(len(content)) if content.startswith(b"op=\x05", place)][2]
    place = content.index(b"\x04\x22\x4d\x18", third)  # an LZ4 frame
    path.write_bytes(content[: place + 40] + bytes(60) + content[place + 100 :])
    found = read_log(path)
    assert 20 < len(found) < 100
    assert same(found, LOG.part(0, len(found)))
    code, text = lossy(found)
    assert code == "DAMAGED"
    assert f"{len(LOG) - len(found)} messages are missing" in text


def changed(folder: Path, *statements: str) -> Path:
    """The file of a rosbag2 folder behind some statements of SQL."""
    (file,) = bag(folder).glob("*.db3")
    with closing(sqlite3.connect(file)) as base:
        for statement in statements:
            base.execute(statement)
        base.commit()
    return file


@pytest.mark.parametrize(
    ("statements", "left", "told"),
    [
        (
            [
                "UPDATE messages SET timestamp = 'noon' WHERE rowid = 7",
                "UPDATE messages SET data = 5 WHERE rowid = 9",
            ],
            198,
            ("DAMAGED", "the file counts 200 messages and holds 198"),
        ),
        (
            ["UPDATE messages SET topic_id = 99 WHERE rowid > 150"],
            150,
            (
                "MESSAGES_LEFT_OUT",
                "50 messages of no topic that the table 'topics' lists; left out",
            ),
        ),
    ],
)
def test_rows_of_no_time_or_no_topic_are_counted(
    statements: list[str], left: int, told: tuple[str, str], tmp_path: Path
) -> None:
    found = read_log(changed(tmp_path, *statements))
    assert (len(found), lossy(found)) == (left, told)


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
    with pytest.raises(LogError, match=told) as refused:
        read_log(changed(tmp_path, *statements))
    assert "\n" not in str(refused.value)
