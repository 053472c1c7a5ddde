"""MCAP as the field writes it: encodings, layouts, packings, splits, and many small chunks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import messages_of, write_mcap
from tests.readers.ways import Message, States, sent, written

LOG = noise_log(400, start_ns=EPOCH_NS, velocity=False)


def mcap(folder: Path, messages: list[Message], encoding: str = "cdr") -> Path:
    return Path(written(encoding, folder, States(messages)))


@pytest.mark.parametrize("encoding", ["cdr", "json"])
@pytest.mark.parametrize("lacking", ["effort", "position"])
def test_messages_that_lack_a_quantity_are_lost_and_those_of_other_joints_are_not(
    lacking: str, encoding: str, tmp_path: Path
) -> None:
    messages = sent(LOG.part(0, 90))
    for row in range(0, 90, 3):
        without: dict[str, Any] = {lacking: ()}
        messages[row + 1] = replace(messages[row + 1], **without)
        one = messages[row + 2]
        messages[row + 2] = replace(
            one, name=["other"], position=one.position[:1], effort=one.effort[:1]
        )
    found = read_log(mcap(tmp_path, messages, encoding))
    assert found.stamp_ns.tolist() == LOG.stamp_ns[:90:3].tolist()
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
    turned = replace(LOG, theta=LOG.theta[::-1], tau=LOG.tau[::-1])
    assert same(read_log(mcap(tmp_path, sent(turned, name=["1", "0"]))), LOG)


def test_more_layouts_than_are_remembered(tmp_path: Path) -> None:
    messages = [
        replace(
            one,
            name=["j1", "j2", f"other{row:03d}"],
            position=[*one.position, 0.0],
            effort=[*one.effort, 0.0],
        )
        for row, one in enumerate(sent(LOG))
    ]
    assert same(read_log(mcap(tmp_path, messages), Profile(joints=("j1", "j2"))), LOG)


def test_xcdr2_is_refused(tmp_path: Path) -> None:
    messages = [(topic, stamp, b"\0\7" + data[2:]) for topic, stamp, data in messages_of(LOG)]
    write_mcap(tmp_path / "log.mcap", messages)
    with pytest.raises(LogError, match="XCDR2"):
        read_log(tmp_path / "log.mcap")


def test_other_joints_that_move_are_told_with_how_far(tmp_path: Path) -> None:
    names = ("base", "a", "wrist", "b", "hand")
    swing = 0.3 * np.sin(np.linspace(0, 12, 400))
    messages = []
    for row, one in enumerate(sent(LOG)):
        joints = slice(5 if row % 7 else 4)  # a message may lack a joint
        (theta1, theta2), (tau1, tau2) = one.position, one.effort
        position = [0.5, theta1, swing[row], theta2, float("nan")][joints]
        effort = [0, tau1, 0, tau2, 0][joints]
        messages.append(replace(one, name=names[joints], position=position, effort=effort))
    found = read_log(mcap(tmp_path, messages), Profile(joints=("a", "b")))
    assert np.array_equal(found.theta, LOG.theta)
    (text,) = (notice.text for notice in found.notices if notice.code == "OTHER_JOINTS")
    assert "wrist by 0.6 rad" in text
    assert "base" not in text
    assert "hand" not in text
