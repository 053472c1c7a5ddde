"""MCAP as the field writes it: encodings, layouts, packings, splits, and many small chunks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType

from algid.base.errors import LogError
from algid.base.ros2 import HEADER
from algid.profile import Profile
from algid.readers import read_log
from algid.writers import write_log
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import (
    NO_INDEX,
    TOPIC,
    Cdr,
    joint_state,
    messages_of,
    protobuf_schema,
    write_mcap,
)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("options", [{}, NO_INDEX, {"use_chunking": False}, {"enable_crcs": False}])
def test_every_way_of_writing_reads_the_same(
    compression: CompressionType, options: dict[str, Any], tmp_path: Path
) -> None:
    log = noise_log(300, start_ns=EPOCH_NS)
    write_mcap(tmp_path / "log.mcap", messages_of(log), compression=compression, **options)
    assert same(read_log(tmp_path / "log.mcap"), log)


@pytest.mark.parametrize("order", "<>")
def test_either_byte_order_and_any_frame_name(order: str, tmp_path: Path) -> None:
    log = noise_log(100, start_ns=EPOCH_NS)
    messages = [
        message
        for frame in ("", "base_link", "x")
        for message in messages_of(log, order=order, frame=frame)[len(frame) :: 12]
    ]
    messages.sort(key=lambda message: message[1])
    write_mcap(tmp_path / "log.mcap", messages)
    found = read_log(tmp_path / "log.mcap")
    assert np.isin(found.theta, log.theta).all()
    assert len(found) == len({stamp for _, stamp, _ in messages})


def test_names_that_change_place_are_followed(tmp_path: Path) -> None:
    log = noise_log(60, start_ns=EPOCH_NS, velocity=False)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        names, order = (["a1", "x", "a2"], [0, 2, 1]) if row % 3 else (["a2", "a1", "x"], [1, 0, 2])
        values = [*log.theta[:, row], 7.0]
        efforts = [*log.tau[:, row], 9.0]
        data = joint_state(
            stamp,
            names,
            [values[place] for place in order],
            (),
            [efforts[place] for place in order],
        )
        messages.append((TOPIC, stamp, data.done()))
        messages.append(
            (TOPIC, stamp + 5, joint_state(stamp + 5, ["gripper"], [1.0], (), [2.0]).done())
        )
    write_mcap(tmp_path / "log.mcap", messages)
    found = read_log(tmp_path / "log.mcap", Profile(joints=("a1", "a2")))
    assert same(found, log)
    assert [notice.code for notice in found.notices] == ["MESSAGES_LEFT_OUT"]


@pytest.mark.parametrize("encoding", ["cdr", "json"])
@pytest.mark.parametrize("lacking", ["effort", "position"])
def test_messages_that_lack_a_quantity_are_lost_and_those_of_other_joints_are_not(
    lacking: str, encoding: str, tmp_path: Path
) -> None:
    log = noise_log(90, start_ns=EPOCH_NS, velocity=False)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        values = {"position": log.theta[:, row].tolist(), "effort": log.tau[:, row].tolist()}
        if row % 3 == 1:
            values[lacking] = []
        names = ["other"] if row % 3 == 2 else ["j1", "j2"]
        cut = {key: one[: len(names)] for key, one in values.items()}
        data = joint_state(stamp, names, **cut).done()
        if encoding == "json":
            stamps = {"sec": stamp // 10**9, "nanosec": stamp % 10**9}
            data = json.dumps({"header": {"stamp": stamps}, "name": names, **cut}).encode()
        messages.append((TOPIC, stamp, data))
    write_mcap(tmp_path / "log.mcap", messages, encoding=encoding)
    found = read_log(tmp_path / "log.mcap")
    assert found.stamp_ns.tolist() == log.stamp_ns[::3].tolist()
    told = {notice.case: (notice.lossy, notice.text) for notice in found.notices}
    fields = f"{lacking}[j1], {lacking}[j2]"
    assert told == {
        "fields": (
            True,
            f"30 messages on '/joint_states' left out for want of {fields}",
        ),
        "joints": (False, "30 messages on '/joint_states' left out: of other joints"),
    }


def test_joints_named_by_numbers_are_not_places(tmp_path: Path) -> None:
    log = noise_log(20, start_ns=EPOCH_NS, velocity=False)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        position, effort = log.theta[::-1, row].tolist(), log.tau[::-1, row].tolist()
        messages.append((TOPIC, stamp, joint_state(stamp, ["1", "0"], position, (), effort).done()))
    write_mcap(tmp_path / "log.mcap", messages)
    assert same(read_log(tmp_path / "log.mcap"), log)


def test_more_layouts_than_are_remembered(tmp_path: Path) -> None:
    log = noise_log(400, start_ns=EPOCH_NS, velocity=False)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        names = ["joint1", "joint2", f"other{row:03d}"]
        position, effort = [*log.theta[:, row], 0.0], [*log.tau[:, row], 0.0]
        messages.append((TOPIC, stamp, joint_state(stamp, names, position, (), effort).done()))
    write_mcap(tmp_path / "log.mcap", messages, chunk_size=1 << 20)
    assert same(read_log(tmp_path / "log.mcap", Profile(joints=("joint1", "joint2"))), log)


def test_dynamic_joint_states(tmp_path: Path) -> None:
    definition = (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] "
        "interface_values\n"
        + "=" * 80
        + "\nMSG: control_msgs/InterfaceValue\nstring[] interface_names\nfloat64[] values\n"
        + HEADER
    )
    log = noise_log(50, start_ns=EPOCH_NS)
    assert log.omega is not None
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        data = Cdr().put("i", stamp // 10**9).put("I", stamp % 10**9).text("").put("I", 2)
        data.text("elbow").text("shoulder").put("I", 2)
        for joint in (1, 0):
            data.put("I", 3).text("effort").text("velocity").text("position")
            data.list("d", [log.tau[joint, row], log.omega[joint, row], log.theta[joint, row]])
        messages.append(("/dynamic", stamp, data.done()))
    schema = {"/dynamic": ("control_msgs/msg/DynamicJointState", "ros2msg", definition.encode())}
    write_mcap(tmp_path / "log.mcap", messages, schema)
    assert same(read_log(tmp_path / "log.mcap", Profile(joints=("shoulder", "elbow"))), log)


def test_an_array_without_names_or_stamps_through_a_profile(tmp_path: Path) -> None:
    definition = (
        "std_msgs/MultiArrayLayout layout\nfloat64[] data\n"
        + "=" * 80
        + "\nMSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset\n"
        + "=" * 80
        + "\nMSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n"
    )
    log = noise_log(50, start_ns=EPOCH_NS, velocity=False)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        data = Cdr().put("I", 0, 0).list("d", [*log.theta[:, row], *log.tau[:, row]])
        messages.append(("/state", stamp, data.done()))
    schema = {"/state": ("std_msgs/msg/Float64MultiArray", "ros2msg", definition.encode())}
    write_mcap(tmp_path / "log.mcap", messages, schema)
    paths = {
        name: {"source": f"data[{place}]"}
        for place, name in enumerate(("theta1", "theta2", "tau1", "tau2"))
    }
    profile = Profile.model_validate({"topic": "/state", **paths})
    assert same(read_log(tmp_path / "log.mcap", profile), log)


def test_json_joint_states(tmp_path: Path) -> None:
    log = noise_log(40, start_ns=EPOCH_NS, velocity=False)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        text = {
            "header": {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}},
            "name": ["b", "a"],
            "position": log.theta[::-1, row].tolist(),
            "effort": log.tau[::-1, row].tolist(),
        }
        messages.append(("/arm", stamp, json.dumps(text).encode()))
    write_mcap(
        tmp_path / "log.mcap", messages, {"/arm": ("arm", "jsonschema", b"{}")}, encoding="json"
    )
    assert same(read_log(tmp_path / "log.mcap", Profile(joints=("a", "b"))), log)


def test_protobuf_joint_states(tmp_path: Path) -> None:
    data, state = protobuf_schema()
    log = noise_log(300, start_ns=EPOCH_NS - EPOCH_NS % 10**9 - 10**8)
    assert log.omega is not None
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        one = state(name=["j1", "j2"], mode=row % 300 - 150)
        one.timestamp.seconds, one.timestamp.nanos = divmod(stamp, 10**9)
        one.position.extend(log.theta[:, row])
        one.velocity.extend(log.omega[:, row])
        one.effort.extend(log.tau[:, row])
        messages.append(("/arm", stamp + 3, one.SerializeToString()))
    schema = {"/arm": ("arm.State", "protobuf", data)}
    write_mcap(tmp_path / "log.mcap", messages, schema, encoding="protobuf")
    assert same(read_log(tmp_path / "log.mcap"), log)


def test_xcdr2_is_refused(tmp_path: Path) -> None:
    log = noise_log(5, start_ns=EPOCH_NS)
    messages = [(topic, stamp, b"\0\7" + data[2:]) for topic, stamp, data in messages_of(log)]
    write_mcap(tmp_path / "log.mcap", messages)
    with pytest.raises(LogError, match="XCDR2"):
        read_log(tmp_path / "log.mcap")


def test_stamps_that_stand_still_give_way_to_log_times(tmp_path: Path) -> None:
    log = noise_log(50, start_ns=EPOCH_NS)
    messages = [
        (topic, stamp, data[:4] + bytes(8) + data[12:]) for topic, stamp, data in messages_of(log)
    ]
    write_mcap(tmp_path / "log.mcap", messages)
    found = read_log(tmp_path / "log.mcap")
    assert same(found, log)
    assert [notice.code for notice in found.notices] == ["UNEVEN_STAMPS"]


def test_a_file_compressed_as_a_whole_is_refused(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", noise_log(10))
    packed = zstandard.compress((tmp_path / "log.mcap").read_bytes())
    (tmp_path / "log.mcap.zstd").write_bytes(packed)
    with pytest.raises(LogError, match=r"compressed as a whole.*zstd -d"):
        read_log(tmp_path / "log.mcap.zstd")


@pytest.mark.parametrize("moved", [0.0, 0.3])
def test_other_joints_that_move_are_told_with_how_far(moved: float, tmp_path: Path) -> None:
    log = noise_log(400, start_ns=EPOCH_NS)
    names = ("base", "a", "wrist", "b", "hand")
    swing = moved * np.sin(np.linspace(0, 12, 400))
    messages = [
        (
            TOPIC,
            stamp,
            joint_state(
                stamp,
                names if row % 7 else names[:4],  # a message may lack a joint
                position=[0.5, log.theta[0, row], swing[row], log.theta[1, row], float("nan")][
                    : 5 if row % 7 else 4
                ],
                effort=[0, log.tau[0, row], 0, log.tau[1, row], 0][: 5 if row % 7 else 4],
            ).done(),
        )
        for row, stamp in enumerate(log.stamp_ns.tolist())
    ]
    write_mcap(tmp_path / "log.mcap", messages)
    found = read_log(tmp_path / "log.mcap", Profile(joints=("a", "b")))
    assert np.array_equal(found.theta, log.theta)
    told = [notice.text for notice in found.notices if notice.code == "OTHER_JOINTS"]
    if moved:
        (text,) = told
        assert "wrist by 0.6 rad" in text
        assert "base" not in text
        assert "hand" not in text
    else:
        assert told == []
