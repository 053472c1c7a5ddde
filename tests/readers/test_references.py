"""The angles that a controller was to follow are read from every format, and kept by `convert`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.ros2 import HEADER
from algid.log import Log, Origin
from algid.profile import Profile, with_settings
from algid.readers import read_log
from tests.readers.mcaps import Cdr, messages_of, write_mcap

T = 0.01 * np.arange(300)
THETA = np.stack([np.sin(T), np.cos(2 * T)])
TAU = np.stack([np.cos(T), np.sin(T)])
REFERENCE = THETA + 0.1
POINT = """\
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
"""
LINE = 80 * "="


def state_definition(field: str) -> bytes:
    """The controller's state, with what it follows in `field`."""
    return f"""\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint {field}
{LINE}
MSG: trajectory_msgs/JointTrajectoryPoint
{POINT}{LINE}
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
{HEADER}""".encode()


def controller_state(stamp_ns: int, names: list[str], positions: list[float]) -> bytes:
    message = Cdr().put("i", stamp_ns // 10**9).put("I", stamp_ns % 10**9).text("")
    message.put("I", len(names))
    for name in names:
        message.text(name)
    message.list("d", positions)
    for _ in ("velocities", "accelerations", "effort"):
        message.put("I", 0)
    return message.put("i", 0).put("I", 0).done()


Columns = dict[str, FloatArray]


def columns(names: str, *signals: FloatArray) -> Columns:
    rows = [row for signal in signals for row in np.atleast_2d(signal)]
    return dict(zip(names.split(","), rows, strict=True))


PLAIN = columns("t,theta1,theta2,tau1,tau2", T, THETA, TAU)


def read(columns: Columns, **settings: Any) -> Log:
    return read_log(columns, with_settings(Profile(), settings))


def reference(log: Log) -> FloatArray:
    return log.reference


@pytest.mark.parametrize("names", ["q_des1,q_des2", "q_ref1,q_ref2", "target_q_0,target_q_1"])
def test_columns_are_found_by_their_names(names: str) -> None:
    found = read(PLAIN | columns(names, REFERENCE))
    assert np.array_equal(reference(found), REFERENCE)
    assert np.array_equal(found.theta, THETA)  # a commanded angle is none


def test_a_profile_names_them_and_they_are_recorded_as_the_angles_are() -> None:
    angles, asked = (np.degrees([signal[0], signal.sum(axis=0)]) for signal in (THETA, REFERENCE))
    made = columns("t,q1,q2,tau1,tau2,one,two", T, angles, TAU, asked)
    unit = {"unit": "deg"}
    settings: dict[str, Any] = {
        "theta1": unit,
        "theta2": unit,
        "q_des1": {"source": "one"},
        "q_des2": {"source": "two"},
        "second_angle": "absolute",
        "zero": "hanging",
    }
    found = reference(read(made, **settings))
    assert found == pytest.approx(REFERENCE - np.array([[math.pi / 2], [0.0]]))
    settings["q_des1"] = {"source": "one", "unit": "rad"}
    assert reference(read(made, **settings))[0] == pytest.approx(asked[0] - math.pi / 2)


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
    found = reference(read(made, theta1={"unwrap": True}))
    assert found[0] == pytest.approx(turning[0] + 0.1)


@pytest.mark.parametrize("field", ["reference", "desired"])
def test_a_trajectory_controller_tells_it(field: str, tmp_path: Path) -> None:
    """At a rate of its own and for a part of the log; joints in another order; nothing is lost."""
    log = Log(10**9 + np.arange(300) * 10_000_000, THETA, TAU, Origin("", "", {}))
    messages = messages_of(log, names=["hip", "knee"])
    for step, (t, stamp) in enumerate(zip(T, log.stamp_ns.tolist(), strict=True)):
        if step % 4 == 0 and 40 <= step <= 200:
            asked = [float(REFERENCE[1, step]), t, float(REFERENCE[0, step])]
            data = controller_state(stamp, ["knee", "wrist", "hip"], asked)
            messages.append(("/arm_controller/state", stamp, data))
    kind = "control_msgs/msg/JointTrajectoryControllerState"
    schemas = {"/arm_controller/state": (kind, "ros2msg", state_definition(field))}
    messages.sort(key=lambda one: one[1])
    write_mcap(tmp_path / "log.mcap", messages, schemas)
    found = read_log(tmp_path / "log.mcap")
    assert len(found) == len(T)
    asked_for = reference(found)
    inside = slice(40, 201)
    # linear interpolation over 40 ms of cos 2t: at most 4 × 0.04² / 8
    assert np.abs(asked_for[:, inside] - REFERENCE[:, inside]).max() < 8.1e-4
    assert np.all(np.isnan(asked_for[:, :40]))
    assert np.all(np.isnan(asked_for[:, 201:]))
    assert not any(notice.lossy for notice in found.notices)
    assert found.origin.mapping["q_des1"] == f"/arm_controller/state: {field}.positions[2]"
