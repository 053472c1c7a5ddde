"""MCAP as the field writes it: encodings, layouts, packings, splits, and many small chunks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import zstandard

from algid.base.errors import LogError
from algid.profile import Profile
from algid.readers import read_log
from algid.writers import write_log
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import (
    TOPIC,
    joint_state,
    messages_of,
    write_mcap,
)


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


def test_xcdr2_is_refused(tmp_path: Path) -> None:
    log = noise_log(5, start_ns=EPOCH_NS)
    messages = [(topic, stamp, b"\0\7" + data[2:]) for topic, stamp, data in messages_of(log)]
    write_mcap(tmp_path / "log.mcap", messages)
    with pytest.raises(LogError, match="XCDR2"):
        read_log(tmp_path / "log.mcap")


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
