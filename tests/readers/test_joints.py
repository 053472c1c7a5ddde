"""Which joint is the first: by the names, by the user, or by the order in the log, and that it is
said.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from algid.log import Log
from algid.profile import Profile, with_settings
from algid.readers import read_log
from tests.readers.logs import noise_log
from tests.readers.ways import EPOCH, Message, States, sent, written

IN_ORDER = """
shoulder elbow, joint1 joint2, joint_9 joint_10, J1 j2, arm_1_joint arm_2_joint,
base_joint arm_joint, shoulder_lift_joint elbow_joint, leftShoulder leftElbow, proximal distal,
hip knee, a b, joint_a joint_b, upper_arm forearm, left_shoulder left_elbow, elbow wrist_1,
first second, axis02 axis3, root x, 1 2, inner_link outer_link, thigh shank, boom stick,
waist shoulder, pan tilt, primary secondary, tilt wrist, axis_i axis_ii
"""
UNKNOWN = "left right, q x, alpha_joint omega_joint, joint1 arm2, elbow_1 elbow_x"


def pairs(text: str) -> list[list[str]]:
    return [pair.split() for pair in text.split(",")]


@pytest.mark.parametrize(("one", "other"), [*pairs(IN_ORDER), ("axis 2", "axis 3")])
def test_names_tell_the_order(one: str, other: str, tmp_path: Path) -> None:
    assert ordered(tmp_path, one, other) == ((one, other), "names")
    assert ordered(tmp_path, other, one) == ((one, other), "names")


@pytest.mark.parametrize(("one", "other"), [*pairs(UNKNOWN), ("axis ³", "axis ²")])
def test_names_that_do_not_tell_leave_the_order_as_it_is(
    one: str, other: str, tmp_path: Path
) -> None:
    """`str.isdigit` says that ² is one, and `int` does not."""
    assert ordered(tmp_path, one, other) == ((one, other), "order")
    assert ordered(tmp_path, other, one) == ((other, one), "order")


def ordered(folder: Path, *names: str) -> tuple[tuple[str, str] | None, str | None]:
    """The joints of messages with such names from the base outwards, and who says so."""
    reading = read_log(states(folder, *names)).origin.reading
    return reading.joints, reading.joints_told


def states(folder: Path, *names: str) -> Path:
    """Ten messages.

    The first joint of the list stands at 1 rad under 10 N m, the second at 2 under 20.
    """
    messages = [
        Message((1, 2 + step), (10, 20), stamp, stamp, names)
        for step, stamp in enumerate(range(EPOCH, EPOCH + 10**7, 10**6))
    ]
    return Path(written("cdr", folder, States(messages)))


def told(log: Log) -> list[str]:
    return [one.clause for one in log.notices if one.code == "JOINT_ORDER"]


def test_joints_whose_names_do_not_tell_stay_and_are_told(tmp_path: Path) -> None:
    path = states(tmp_path, "left", "right")
    (text,) = told(read_log(path))
    assert "--joints right,left" in text
    swapped = read_log(path, Profile(joints=("right", "left")))
    assert swapped.tau[:, 0].tolist() == [20, 10]
    assert (swapped.origin.reading.joints_told, told(swapped)) == ("profile", [])


def test_everything_a_reader_was_told_is_in_the_origin(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("ms,q1_deg,q2_deg,tau1,tau2\n1,10,20,30,40\n2,10,20,30,40\n")
    settings = {
        "zero": "hanging",
        "time": "ms",
        "time_unit": "ms",
        "offsets": [0.5, 0],
        "tau1": {"unit": "mN m", "sign": -1},
    }
    reading = read_log(tmp_path / "log.csv", with_settings(Profile(), settings)).origin.reading
    assert (reading.zero, reading.second_angle, reading.time_unit, reading.clock) == (
        "hanging",
        "relative",
        "ms",
        "column",
    )
    told = {name: (one.unit, one.told, one.sign) for name, one in reading.channels.items()}
    assert told["theta1"] == ("deg", "names", 1)
    assert (told["tau1"], told["tau2"]) == (("mN m", "profile", -1), ("N m", "assumed", 1))


@pytest.mark.parametrize(
    "form", ["q{}_deg tau{}", "/js/{}/position /js/{}/effort", "{}_pos {}_torque"]
)
def test_other_joints_of_a_table_that_move_are_told_by_their_names(
    form: str, tmp_path: Path
) -> None:
    """The first creeps, the last two turn through 0.6 and 1 rad; those between are to be read."""
    names = list("12345") if "deg" in form else ["base", "shoulder", "elbow", "wrist", "hand"]
    t = np.arange(400) * 0.01
    swing = np.sin(2 * t)
    columns = {"time": t, "/joint_commands/gripper/position": swing}  # no joint of this topic
    angles = (0.0099 * swing, swing, np.cos(3 * t), 0.3 * swing, 0.5 * swing)
    for name, angle in zip(names, angles, strict=True):
        for own, values in zip(form.split(), (angle, 0.1 * angle), strict=True):
            columns[own.format(name)] = np.degrees(values) if "deg" in own else values
    pl.DataFrame(columns).write_csv(tmp_path / "log.csv")
    log = read_log(tmp_path / "log.csv", Profile(joints=(names[1], names[2])))
    (text,) = (one.text for one in log.notices if one.code == "OTHER_JOINTS")
    others = f"{names[4]} by 1 rad and {names[3]} by 0.6 rad"
    assert f"2 other joints move meanwhile: {others}" in text


def test_of_two_topics_with_both_joints_it_is_said_which_was_taken(tmp_path: Path) -> None:
    log = noise_log(80)
    path = written("cdr", tmp_path, States(sent(log) + sent(log, topic="/arm/state")))
    (notice,) = read_log(path).notices
    assert (notice.code, notice.note) == ("JOINT_ORDER", True)
    assert (
        notice.text == "the joints are taken from '/joint_states'; there are two also on /arm/state"
    )
    assert [remedy.settings for remedy in notice.remedies] == [{"topic": "/arm/state"}]
    assert told(read_log(path, Profile(topic="/arm/state"))) == []
