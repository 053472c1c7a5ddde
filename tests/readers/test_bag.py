"""ROS 1 bags and SQLite rosbag2 folders, written by rosbags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.bags import open_bag
from tests.readers.large import write_db3
from tests.readers.logs import EPOCH_NS, noise_log

TYPE = "sensor_msgs/msg/JointState"


def message(store: Any, log: Log, row: int, *, first: bool) -> Any:
    time, header, state = (
        store.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", TYPE)
    )
    sec, nanosec = divmod(int(log.stamp_ns[row]), 10**9)
    stamp = time(sec=sec, nanosec=nanosec)
    head = header(seq=row, stamp=stamp, frame_id="") if first else header(stamp=stamp, frame_id="")
    assert log.omega is not None
    return state(
        header=head,
        name=["j1", "j2"],
        position=log.theta[:, row].copy(),
        velocity=log.omega[:, row].copy(),
        effort=log.tau[:, row].copy(),
    )


def two(folder: Path, topics: tuple[str, ...] = ("/joint_states",)) -> Log:
    """A rosbag2 folder in SQLite, the same states on each topic."""
    log = noise_log(200, start_ns=EPOCH_NS)
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        channels = [writer.add_connection(topic, TYPE, typestore=store) for topic in topics]
        for row, stamp in enumerate(log.stamp_ns.tolist()):
            data = store.serialize_cdr(message(store, log, row, first=False), TYPE)
            for channel in channels:
                writer.write(channel, stamp, data)
    return log


def test_topic_and_source_of_a_profile_are_honoured(tmp_path: Path) -> None:
    log = two(tmp_path / "bag", ("/one", "/two"))
    assert read_log(tmp_path / "bag", Profile(topic="/two")).origin.reading.topics == ("/two",)
    crossed = Profile.model_validate(
        {
            "topic": "/one",
            "tau1": {"source": "effort[j2]"},
            "tau2": {"topic": "/two", "source": "effort[0]"},
        }
    )
    found = read_log(tmp_path / "bag", crossed)
    assert found.tau.tolist() == log.tau[::-1].tolist()
    assert found.origin.mapping["tau2"] == "/two: effort[0]"
    assert found.origin.reading.topics == ("/one", "/two")
    recorded = read_log(tmp_path / "bag", Profile(topic="/one", clock="log"))
    assert recorded.origin.mapping["t"] == "log time"
    with pytest.raises(
        LogError, match=r"joints foo, bar; joints there are: j1, j2; choose two: --joints A,B"
    ):
        read_log(tmp_path / "bag", Profile(joints=("foo", "bar")))
    with pytest.raises(LogError, match="no topic holds"):
        read_log(tmp_path / "bag", Profile(topic="/three"))
    with pytest.raises(LogError, match=r"joint states on /one, /two; choose: --topic NAME"):
        read_log(tmp_path / "bag")


def described(folder: Path, names: list[str], more: str = "") -> Path:
    """A folder of empty databases, and metadata that list them."""
    folder.mkdir()
    listed = "".join(f"    - {name}\n" for name in names)
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 5\n{more}  relative_file_paths:\n{listed}  "
        "files: []\n"
    )
    return folder


def test_the_files_of_a_bag_come_as_its_metadata_list_them(tmp_path: Path) -> None:
    names = ["bag_1.db3", '"bag_0.db3"', "'bag_10.db3'", "bag_2.db3"]
    folder = described(tmp_path / "bag", names, "  compression_mode: none\n")
    for number in (0, 1, 2):
        write_db3(folder / f"bag_{number}.db3", 10 * (1 + number))
    bag = open_bag(folder, "rosbag2")
    assert [list(one().counts.values()) for one in bag.files] == [[20], [10], [30]]
    (lost,) = bag.notices
    assert (lost.code, lost.lossy) == ("DAMAGED", True)
    assert lost.text == "1 of 4 files of the bag missing: bag_10.db3"


def test_files_without_metadata_come_by_their_numbers(tmp_path: Path) -> None:
    for rows, name in ((30, "run_10.db3"), (20, "run_9.db3"), (10, "run.db3")):
        write_db3(tmp_path / name, rows)
    (tmp_path / "run_0.txt").touch()
    bag = open_bag(tmp_path, "rosbag2")
    assert [list(one().counts.values()) for one in bag.files] == [[10], [20], [30]]
    (tmp_path / "other_9.db3").touch()
    with pytest.raises(LogError, match="not the numbered parts of one bag"):
        read_log(tmp_path)


@pytest.mark.parametrize(
    ("names", "more", "words"),
    [
        (["a.db3", "b.db3"], "", r"none of the bag's files is there; expected \['a.db3', 'b"),
        (["../a.db3"], "", "none of the bag's files is there"),  # it is, outside the folder
        ([".."], "", "none of the bag's files is there"),
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


def states(folder: Path, *messages: dict[str, Any], topic: str = "/joint_states") -> Path:
    """A rosbag2 folder in SQLite whose joint states have these fields, one a millisecond."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    time, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    with Writer2(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        channel = writer.add_connection(topic, TYPE, typestore=store)
        for row, fields in enumerate(messages):
            values = {
                name: np.array(fields.get(name, ()), float)
                for name in ("position", "velocity", "effort")
            }
            stamp = time(sec=5, nanosec=row * 1_000_000)
            state = store.types[TYPE](
                header=header(stamp=stamp, frame_id=""), name=fields["name"], **values
            )
            writer.write(channel, 10**9 + row, store.serialize_cdr(state, TYPE))
    return folder


PAIR = {"name": ["b", "a"], "position": [1, 2], "effort": [10, 20]}


def test_joints_come_along_the_arm_and_messages_without_them_are_counted(tmp_path: Path) -> None:
    path = states(
        tmp_path / "bag",
        PAIR,
        {"name": ["c"], "position": [9], "effort": [9]},
        PAIR,
        {"name": []},
        PAIR,
    )
    log = read_log(path)
    assert log.theta.tolist() == [[2] * 3, [1] * 3]
    assert log.tau.tolist() == [[20] * 3, [10] * 3]
    assert log.omega is None
    assert log.stamp_ns.tolist() == [5 * 10**9 + row * 1_000_000 for row in (0, 2, 4)]
    assert (log.origin.reading.joints, log.origin.reading.joints_told) == (("a", "b"), "names")
    assert [notice.text for notice in log.notices if notice.code == "MESSAGES_LEFT_OUT"] == [
        "2 messages on '/joint_states' left out: of other joints"
    ]
    # the recorder's own times, where a user asks for them
    assert read_log(path, Profile(clock="log")).stamp_ns.tolist() == [
        10**9 + row for row in (0, 2, 4)
    ]


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (
            {**PAIR, "effort": []},
            r"found '/joint_states' with .*position\[b\], position\[a\], .*effort \(empty\); name",
        ),
        (
            {**PAIR, "name": ["a", "a"]},
            "'/joint_states': its messages name the joint 'a' twice; .*name each field",
        ),
        (
            {**PAIR, "position": [1]},
            "no topic holds theta1, theta2, tau1, tau2 of two joints; found '/joint_states' with",
        ),
        (
            {"name": ["x", "y", "z"], "position": [1, 2, 3], "effort": [1, 2, 3]},
            r"'/joint_states': 'position' stands there for 3 joints: .*/z; choose two: --joints A",
        ),
    ],
)
def test_joint_states_that_do_not_fit_are_told(
    message: dict[str, Any], words: str, tmp_path: Path
) -> None:
    path = states(tmp_path / "bag", *[message] * 3)
    with pytest.raises(LogError, match=words):
        read_log(path)


def test_a_field_needs_a_topic_and_a_topic_its_field(tmp_path: Path) -> None:
    path = states(tmp_path / "bag", *[PAIR] * 3)
    fields = {
        "theta1": "position[0]",
        "theta2": "position[1]",
        "tau1": "effort[0]",
        "tau2": "effort[1]",
    }
    named: dict[str, Any] = {name: {"source": field} for name, field in fields.items()}
    with pytest.raises(
        LogError, match=r"theta1 is taken from 'position\[0\]' without a topic: --topic NAME"
    ):
        read_log(path, Profile.model_validate(named))
    log = read_log(path, Profile.model_validate({**named, "topic": "/joint_states"}))
    assert log.tau.tolist() == [[10] * 3, [20] * 3]
    with pytest.raises(LogError, match=r"no message on topic '/other'; .*--set tau1.topic=NAME"):
        read_log(path, Profile.model_validate({"tau2": {"source": "effort[0]", "topic": "/other"}}))
    for wrong in ("effort[²]", "effort[2]", "header.frame_id"):
        with pytest.raises(
            LogError, match=r"messages on '/joint_states' have no .* for tau2; found header"
        ):
            read_log(path, Profile.model_validate({"tau2": {"source": wrong}}))
