"""ROS 1 bags and SQLite rosbag2 folders, written by rosbags."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from algid.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS, noise_log, same

TYPE = "sensor_msgs/msg/JointState"


def message(store: Any, log: Log, row: int, *, first: bool) -> Any:
    time, header, state = (store.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", TYPE))
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


def test_bags_of_both_generations_read_the_same(tmp_path: Path) -> None:
    log = noise_log(200, start_ns=EPOCH_NS)
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(tmp_path / "one.bag") as writer:
        channel = writer.add_connection("/joint_states", TYPE, typestore=store)
        for row, stamp in enumerate(log.stamp_ns.tolist()):
            writer.write(channel, stamp, store.serialize_ros1(message(store, log, row, first=True), TYPE))
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(tmp_path / "two", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer2:
        channel2 = writer2.add_connection("/joint_states", TYPE, typestore=store)
        for row, stamp in enumerate(log.stamp_ns.tolist()):
            data = store.serialize_cdr(message(store, log, row, first=False), TYPE)
            writer2.write(channel2, stamp, data)
    for name in ("one.bag", "two"):
        found = read_log(tmp_path / name)
        assert same(found, log)
        assert found.origin.mapping["tau2"] == "/joint_states: effort[j2]"


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


def test_a_loose_file_and_a_folder_without_metadata(tmp_path: Path) -> None:
    log = two(tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.db3")
    assert same(read_log(file), log)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    assert same(read_log(tmp_path / "bag"), log)


def test_topic_and_source_of_a_profile_are_honoured(tmp_path: Path) -> None:
    log = two(tmp_path / "bag", ("/one", "/two"))
    assert read_log(tmp_path / "bag", Profile(topic="/two")).origin.reading.topics == ("/two",)
    crossed = Profile.model_validate(
        {"topic": "/one", "tau1": {"source": "effort[j2]"}, "tau2": {"topic": "/two", "source": "effort[0]"}}
    )
    found = read_log(tmp_path / "bag", crossed)
    assert found.tau.tolist() == log.tau[::-1].tolist()
    assert found.origin.mapping["tau2"] == "/two: effort[0]"
    assert found.origin.reading.topics == ("/one", "/two")
    recorded = read_log(tmp_path / "bag", Profile(topic="/one", clock="log"))
    assert recorded.origin.mapping["t"] == "log time"
    with pytest.raises(LogError, match=r"joints j1, j2.*--topic NAME --joints A,B"):
        read_log(tmp_path / "bag", Profile(joints=("foo", "bar")))
    with pytest.raises(LogError, match="no topic holds"):
        read_log(tmp_path / "bag", Profile(topic="/three"))


def test_metadata_may_list_its_files_in_brackets(tmp_path: Path) -> None:
    log = two(tmp_path / "bag")
    metadata = tmp_path / "bag" / "metadata.yaml"
    text = metadata.read_text()
    flow = re.sub(r"relative_file_paths:\s*\n\s*-\s*(\S+)", r"relative_file_paths: [\1]", text)
    assert flow != text
    metadata.write_text(flow)
    assert same(read_log(tmp_path / "bag"), log)


def test_a_damaged_bag_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "log.bag").write_bytes(b"#ROSBAG V2.0\n" + np.arange(100).tobytes())
    with pytest.raises(LogError, match="bag cannot be read"):
        read_log(tmp_path / "log.bag")


def test_other_joints_of_a_bag_that_move_are_told(tmp_path: Path) -> None:
    log = noise_log(50, start_ns=EPOCH_NS)
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        channel = writer.add_connection("/joint_states", TYPE, typestore=store)
        for row, stamp in enumerate(log.stamp_ns.tolist()):
            own = message(store, log, row, first=False)
            more = {"position": [0.1 * (row % 2), 0.0], "velocity": [0.0, 0.0], "effort": [0.0, 0.0]}
            values = {key: np.append(getattr(own, key), more[key]) for key in more}
            long = store.types[TYPE](header=own.header, name=["j1", "j2", "j3", "j4"], **values)
            writer.write(channel, stamp, store.serialize_cdr(long, TYPE))
    found = read_log(tmp_path / "bag", Profile(joints=("j1", "j2")))
    assert same(found, log)
    (text,) = (notice.text for notice in found.notices if notice.code == "OTHER_JOINTS")
    assert "1 other joint moves meanwhile: j3 by 0.1 rad" in text
