"""Joints that a flat log has beside the two that are read: those that move are named
with how far.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from algid.profile import Profile
from algid.readers import read_log

T = np.arange(400) * 0.01
SWING = np.sin(2 * T)
STILL = np.full(T.size, 0.7)


def _arm(position: str, effort: str, joints: tuple[str, ...], unit: float = 1.0) -> pl.DataFrame:
    """Four joints: the first is held, the last turns through 0.6 rad.

    The two between are those to read.
    """
    angles = [STILL, SWING, np.cos(3 * T), 0.3 * SWING]
    columns = {"time": T}
    for joint, angle in zip(joints, angles, strict=True):
        columns[position.format(joint)] = angle / unit
    for joint, angle in zip(joints, angles, strict=True):
        columns[effort.format(joint)] = 0.1 * angle
    return pl.DataFrame(columns)


def _told(path: Path, profile: Profile) -> list[str]:
    return [
        notice.text for notice in read_log(path, profile).notices if notice.code == "OTHER_JOINTS"
    ]


def test_angles_in_degrees_are_told_in_rad(tmp_path: Path) -> None:
    _arm("q{}_deg", "tau{}", ("1", "2", "3", "4"), np.pi / 180).write_csv(tmp_path / "log.csv")
    (text,) = _told(tmp_path / "log.csv", Profile(joints=("2", "3")))
    assert "4 by 0.6 rad" in text


@pytest.mark.parametrize("position", ["/joint_states/{}/position", "{}_pos"])
def test_joints_with_names_are_told_by_them(position: str, tmp_path: Path) -> None:
    effort = (
        position.replace("position", "effort").replace("pos", "torque")
        if "_pos" in position
        else "/joint_states/{}/effort"
    )
    frame = _arm(position, effort, ("base", "shoulder", "elbow", "wrist"))
    # no joint of this topic
    frame = frame.with_columns(pl.Series("/joint_commands/gripper/position", SWING))
    frame.write_csv(tmp_path / "log.csv")
    (text,) = _told(tmp_path / "log.csv", Profile(joints=("shoulder", "elbow")))
    assert "1 other joint moves meanwhile: wrist by 0.6 rad" in text
