"""MCAP as the field writes it: encodings, layouts, packings, splits, and many small chunks."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

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
    without: dict[str, Any] = {lacking: ()}
    for row in range(0, 90, 3):
        messages[row + 1] = replace(messages[row + 1], **without)
        messages[row + 2] = replace(messages[row + 2], name=["x"], position=[1], effort=[2])
    found = read_log(mcap(tmp_path, messages, encoding))
    assert found.stamp_ns.tolist() == LOG.stamp_ns[:90:3].tolist()
    left = "30 messages on '/joint_states' left out"
    assert {(one.case, one.lossy, one.text) for one in found.notices} == {
        ("fields", True, f"{left} for want of {lacking}[j1], {lacking}[j2]"),
        ("joints", False, f"{left}: of other joints"),
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


def test_units_that_differ_between_the_files_of_a_recording_are_refused(tmp_path: Path) -> None:
    for number, unit in enumerate(("N m", "mN m")):
        part = messages_of(LOG.part(200 * number, 200 * (number + 1)))
        said = {"units": json.dumps({"effort": unit})}
        write_mcap(tmp_path / f"log_{number}.mcap", part, metadata=said)
    with pytest.raises(LogError, match=r"log_1\.mcap states other units \(tau1 in mN m, .*N m\); "):
        read_log(tmp_path)
