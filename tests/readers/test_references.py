"""The angles that a controller was to follow are read from every format, and kept by `convert`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.log import Log, Origin
from algid.profile import Profile, with_settings
from algid.readers import read_log
from tests.readers.mcaps import messages_of, write_mcap

T = 0.01 * np.arange(300)
THETA = np.stack([np.sin(T), np.cos(2 * T)])
TAU = np.stack([np.cos(T), np.sin(T)])
REFERENCE = THETA + 0.1
Columns = dict[str, FloatArray]


def columns(names: str, *signals: FloatArray) -> Columns:
    rows = [row for signal in signals for row in np.atleast_2d(signal)]
    return dict(zip(names.split(","), rows, strict=True))


PLAIN = columns("t,theta1,theta2,tau1,tau2", T, THETA, TAU)


def read(columns: Columns, **settings: Any) -> Log:
    return read_log(columns, with_settings(Profile(), settings))


@pytest.mark.parametrize("names", ["q_des1,q_des2", "q_ref1,q_ref2", "target_q_0,target_q_1"])
def test_columns_are_found_by_their_names(names: str) -> None:
    found = read(PLAIN | columns(names, REFERENCE))
    assert np.array_equal(found.reference, REFERENCE)
    assert np.array_equal(found.theta, THETA)  # a commanded angle is none


@pytest.mark.parametrize(
    ("angle", "reference", "said", "unit", "by"),
    [
        ("theta{}", "q_des{}", {}, "rad", "assumed"),
        ("theta{} [deg]", "q_des{}", {}, "deg", "names"),
        ("theta{} [deg]", "q_des{} [rad]", {}, "rad", "names"),
        ("theta{}", "q_des{}", {"theta{}": {"unit": "deg"}}, "deg", "profile"),
        ("theta{}", "q_des{} [rad]", {"theta{}": {"unit": "deg"}}, "rad", "names"),
        ("theta{} [deg]", "q_des{}", {"q_des{}": {"unit": "rad"}}, "rad", "profile"),
    ],
)
def test_the_unit_is_the_angles_where_nothing_else_is_said(
    angle: str, reference: str, said: dict[str, dict[str, str]], unit: str, by: str
) -> None:
    names = ",".join(form.format(joint) for form in (angle, "tau{}", reference) for joint in (1, 2))
    own = {name.format(joint): one for name, one in said.items() for joint in (1, 2)}
    found = read(columns(f"t,{names}", T, THETA, TAU, REFERENCE), **own)
    channel = found.origin.reading.channels["q_des2"]
    assert (channel.unit, channel.told) == (unit, by)


@pytest.mark.parametrize("joints", [1, 7])
def test_one_joint_or_seven_are_no_reference(joints: int) -> None:
    others = {f"q_des{joint}": T for joint in range(1, joints + 1)}
    assert read(PLAIN | others).reference is None


def test_one_that_wraps_follows_its_angle() -> None:
    turning, asked = (np.stack([3 * T + part, THETA[1]]) for part in (0.0, 0.1))
    names = "t,theta1,theta2,tau1,tau2,q_des1,q_des2"
    made = columns(names, T, np.mod(turning, 2 * np.pi), TAU, np.mod(asked, 2 * np.pi))
    found = read(made, theta1={"unwrap": True}).reference
    assert found[0] == pytest.approx(turning[0] + 0.1)


@pytest.mark.parametrize("field", ["reference", "desired"])
def test_a_trajectory_controller_tells_it(field: str, tmp_path: Path) -> None:
    """At a rate of its own and for a part of the log; joints in another order; nothing is lost."""
    topic, stamps = "/arm_controller/state", 10**9 + np.arange(300) * 10_000_000
    messages = messages_of(Log(stamps, THETA, TAU, Origin("", "", {})), names=["hip", "knee"])
    for step in range(40, 201, 4):
        sec, nanosec = divmod(int(stamps[step]), 10**9)
        asked = [REFERENCE[1, step], T[step], REFERENCE[0, step]]
        state: dict[str, Any] = {"header": {"stamp": {"sec": sec, "nanosec": nanosec}}}
        state |= {"joint_names": ["knee", "wrist", "hip"], field: {"positions": asked}}
        messages.append((topic, int(stamps[step]), json.dumps(state).encode()))
    messages.sort(key=lambda one: one[1])
    kind = "control_msgs/JointTrajectoryControllerState", "jsonschema", b""
    write_mcap(tmp_path / "log.mcap", messages, {topic: kind})
    found = read_log(tmp_path / "log.mcap")
    assert len(found) == len(T)
    # linear interpolation over 40 ms of cos 2t: at most 4 × 0.04² / 8
    assert np.abs(found.reference[:, 40:201] - REFERENCE[:, 40:201]).max() < 8.1e-4
    assert np.isnan(np.delete(found.reference, np.s_[40:201], axis=1)).all()
    assert not any(notice.lossy for notice in found.notices)
    assert found.origin.mapping["q_des1"] == f"{topic}: {field}.positions[2]"
