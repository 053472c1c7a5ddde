"""Which column is which: choices, refusals to the letter, and what is said of commands, currents,
motors and units.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.log import Companion
from algid.notices import Notice
from algid.profile import Profile
from algid.readers.arrays import of_arrays
from algid.readers.column_names import Name, take_apart
from algid.readers.flat import offer_table
from tests.readers.headers import TableReader, opened

PLAIN = "t q1 q2 tau1 tau2"
CONSTANTS = {"tau1": {"torque_constant": 1.0}, "tau2": {"torque_constant": 1.0}}


def chosen(columns: str | list[str], **settings: Any) -> dict[str, str]:
    return dict(opened(columns, settings).origin.mapping)


def refused(columns: str | list[str], *more: Any) -> str:
    with pytest.raises(LogError) as error:
        opened(columns, *more)
    return str(error.value).removeprefix("log: ")


QUANTITIES = ("theta", "tau", "omega", "q_des")


@pytest.mark.parametrize("first", [0, 1], ids=["from zero", "from one"])
@pytest.mark.parametrize(
    "forms",
    [
        "dof_pos_{} dof_torque_{}",
        "dof_pos_{} tau_{}",
        "actuator_{}_pos actuator_{}_torque",
        "arm_pos_{} arm_tau_{}",
        "pos_dof{} torque_dof{}",
        "state.q[{}] state.tau_J[{}] state.dq[{}] state.q_d[{}] state.tau_J_d[{}]",
        "franka_state.q[{}] franka_state.tau_J[{}] franka_state.dq[{}]",
        "motor_state[{}].q motor_state[{}].tau_est motor_state[{}].dq",
        "low_state.motor_state[{}].q low_state.motor_state[{}].tau_est",
        "/low_state/motor_state[{}]/q /low_state/motor_state[{}]/tau_est",
    ],
)
def test_two_of_numbered_joints_are_called_by_number_word_or_column(forms: str, first: int) -> None:
    columns = ["t"]
    for number in range(first, first + 6):
        columns += [form.format(number) for form in forms.split()]
    angle = forms.split()[0]
    wanted = {
        f"{quantity}{place}": form.format(number)
        for quantity, form in zip(QUANTITIES, forms.split(), strict=False)
        for place, number in ((1, first + 2), (2, first + 1))
    }
    for called in ("{}", angle):
        joints = [called.format(first + 2), called.format(first + 1)]
        assert chosen(columns, joints=joints) == {"t": "t", **wanted}
    assert "there are: " in refused(columns, {"joints": ["8", "9"]})


def test_columns_that_were_written_must_be_there() -> None:
    table = of_arrays("arrays", {name: np.arange(3.0) for name in PLAIN.split()[:-1]})
    sums = dict.fromkeys(("tau2", "tau1", "omega1"), 0)
    with pytest.raises(
        LogError, match="the columns tau2, omega1 that were written are not there: the file was"
    ):
        offer_table(replace(table, companion=Companion(None, sums)), Profile())


@pytest.mark.parametrize("passive", [1, 2])
def test_a_joint_without_motor_needs_no_torque(passive: int) -> None:
    driven = 3 - passive
    for torque in (f"tau{driven}", "torque"):
        found = opened(f"t q1 q2 {torque}", {"passive": passive})
        assert found.origin.mapping[f"tau{driven}"] == torque
        assert found.origin.mapping[f"tau{passive}"] == torque
    assert "no column for tau1, tau2" in refused(f"t q1 q2 tau{driven}")
    assert "no column for tau" in refused(
        "t q1 q2 tau7 tau8 tau9".replace("tau8 tau9", ""), {"passive": passive}
    )


def said(found: TableReader) -> list[tuple[str, str]]:
    return [(notice.code, notice.text) for notice in found.notices]


def test_commanded_torques_are_told_and_taken_last() -> None:
    commanded = opened("t q1 q2 tau_cmd1 tau_cmd2 i_q1 i_q2")
    columns = {"columns": "tau_cmd1, tau_cmd2"}
    assert commanded.notices == (Notice("COMMANDED_TORQUE", numbers=columns),)


def test_currents_are_in_amperes_unless_their_unit_is_told() -> None:
    header = "t q1 q2 current_1 current_2"

    def units(**stated: str) -> list[str]:
        channels = opened(header, CONSTANTS, stated).origin.reading.channels
        return [channels[name].unit for name in ("tau1", "tau2")]

    assert units() == ["A", "A"]
    assert units(current_2="mA") == ["A", "mA"]
    assert units(current_2="Nm") == ["A", "A"]


@pytest.mark.parametrize(
    ("header", "settings", "stated", "words"),
    [
        (
            "t q1_deg q2_deg tau1 tau2",
            {"theta1": {"unit": "rad"}, "theta2": {"unit": "deg"}},
            {},
            "deg for theta1 ('q1_deg'), which is taken for rad, as configured",
        ),
        (
            "t q1_deg q2 tau1 tau2",
            {},
            {"q1_deg": "rad", "q2": "deg"},
            "rad for theta1 ('q1_deg'), which is taken for deg, as its name says",
        ),
        (
            "time_ms q1 q2 tau1 tau2",
            {"time_unit": "s"},
            {},
            "ms for t ('time_ms'), which is taken for s, as configured",
        ),
        (
            "t q1_inch q2 tau1 tau2",
            {"theta1": {"unit": "rev"}},
            {},
            "inch for theta1 ('q1_inch'), which is taken for rev, as configured",
        ),
        (
            "t q1 q2 current_1 current_2",
            {"tau1": {"unit": "N m"}, "tau2": CONSTANTS["tau2"]},
            {},
            "A for tau1 ('current_1'), which is taken for N m, as configured",
        ),
    ],
)
def test_the_file_and_the_user_differ_about_a_unit(
    header: str, settings: dict[str, Any], stated: dict[str, str], words: str
) -> None:
    text = f"the file states the unit {words}"
    assert said(opened(header, settings, stated)) == [("OTHER_UNIT", text)]


def test_the_unit_in_the_name_of_a_column_that_a_user_names_is_used() -> None:
    found = opened("t q1 q2 a_deg tau1 tau2", {"theta1": {"source": "a_deg"}})
    assert found.origin.reading.channels["theta1"].unit == "deg"
    assert "is in 'v'; expected one of N m," in refused(
        "t q1 q2 x[V] tau1 tau2", {"tau1": {"source": "x[V]"}}
    )


def test_a_unit_of_no_joint_is_refused_where_it_counts() -> None:
    assert refused("t q1_inch q2 tau1 tau2") == (
        "the column 'q1_inch' for theta1 is in 'inch'; expected one of rad, mrad, deg, rev, rpm, "
        "counts; say its unit if that is wrong: --set theta1.unit=rad"
    )
    assert "--set 'tau2.unit=\"N m\"'" in refused(PLAIN, None, {"tau2": "%"})
    assert said(opened("t q1_inch q2 q_b tau1 tau2", {"theta1": {"source": "q_b"}})) == []
    assert said(opened(PLAIN, None, {"t": "%"})) == []


def test_motors_beside_joints_need_a_gear() -> None:
    told = refused("t q1 q2 motor1_torque motor2_torque", {"tau2": {"gear_ratio": 1}})
    assert told == (
        "tau1 (motor1_torque): signals of motors beside those of joints; tell the gear, turns of "
        "the motor in one of "
        "the joint, 1 for a direct drive: --set tau1.gear_ratio=N"
    )
    motors = opened("t motor1_pos motor2_pos motor1_torque motor2_torque")
    assert [code for code, _ in said(motors)] == ["OTHER_UNIT"]
    # a current's constant tells of its gear
    assert said(opened("t q1 q2 motor1_current motor2_current", CONSTANTS)) == []


@pytest.mark.parametrize(
    ("column", "stem", "joint", "unit"),
    [
        (' "Q_02 [DEG]" ', "q", "2", "deg"),
        ("J3 Torque (N.m)", "torque", "3", "N m"),
        ("q1_deg", "q", "1", "deg"),
        ("q[0]", "q", "0", None),
        ("/arm/elbow/velocity", "velocity", "/arm/elbow", None),
        ("/arm/position[05]", "position", "05", None),
        ("/arm/effort.1", "effort", "1", None),
        ("joint007_pos", "pos", "7", None),
        ("joint000_pos", "pos", "0", None),
        ("load [V]", "load", None, "v"),
        ("motor2_speed_rpm", "speed", "2", "rpm"),
        ("millis", "millis", None, "ms"),
        ("[Nm]", "[nm]", None, None),
    ],
)
def test_a_name_taken_apart(column: str, stem: str, joint: str | None, unit: str | None) -> None:
    assert take_apart(column) == Name(stem, joint, unit)


@pytest.mark.parametrize(
    ("columns", "joints", "chosen"),
    [
        ("/a/x/position /a/y/position /a/x/effort /a/y/effort", None, "/a/x/position"),
        ("/a/x/position /b/x/position /a/x/effort /b/x/effort", None, "/a/x/position"),
        ("/a/x/position /a/y/position /a/x/effort /a/y/effort", ("Y", "/a/x"), "/a/y/position"),
        ("q0 q1 tau1 tau2", None, "q0"),
        ("elbow_pos base_pos elbow_torque base_torque", None, "base_pos"),
        ("q10 q9 tau9 tau10", None, "q9"),
    ],
)
def test_the_pair_chosen(columns: str, joints: tuple[str, str] | None, chosen: str) -> None:
    settings = {"joints": list(joints)} if joints else {}
    found = opened(["t", *columns.split()], settings).origin.mapping
    assert found["theta1"] == chosen
    assert {"theta2", "tau1", "tau2"} < found.keys()


def test_a_time_is_known_by_its_whole_name_first() -> None:
    others = PLAIN.split()[1:]
    assert chosen(["time [ms]", "T", *others])["t"] == "T"
    assert chosen(["clock", "time [ms]", *others])["t"] == "time [ms]"
    assert chosen(["stamp", "time", "stamp_ns", *others])["t"] == "stamp_ns"
    assert refused(others).startswith("no column for t; found")


def test_joint_and_axis_are_no_joints_names() -> None:
    columns = [
        f"{joint}_{signal}" for joint in ("base_axis", "elbow_axis") for signal in ("pos", "torque")
    ]
    assert opened(["t", *columns]).origin.reading.joints == ("base", "elbow")
    assert chosen(["t", *columns], joints=["elbow", "base"])["theta1"] == "elbow_axis_pos"
    told = refused(["t", "axis_pos", "joint_pos", "axis_torque", "joint_torque"])
    assert told.startswith("no column for theta1, theta2, tau1, tau2; found")


FIELD = {
    "t,q1,q2,tau1,tau2": "t q1 q2 tau1 tau2",
    "time,pos1,pos2,vel1,vel2,tau1,tau2": "time pos1 pos2 tau1 tau2",
    "time,pos_meas1,pos_meas2,pos_filt1,pos_filt2,tau_con1,tau_con2,tau_meas1,tau_meas2": (
        "time pos_meas1 pos_meas2 tau_meas1 tau_meas2"
    ),
    "timestamp,actual_q_0,actual_q_1,actual_current_0,actual_current_1": (
        "timestamp actual_q_0 actual_q_1 actual_current_0 actual_current_1"
    ),
    "__time,/js/a/position,/js/a/effort,/js/b/position,/js/b/effort": (
        "__time /js/a/position /js/b/position /js/a/effort /js/b/effort"
    ),
    "time,q[0],q[1],tau_J[0],tau_J[1]": "time q[0] q[1] tau_J[0] tau_J[1]",
    "T,THETA1,Theta2,Tau1,TAU2": "T THETA1 Theta2 Tau1 TAU2",
    "t,state.q[0],state.q[1],q1,q2,state.tau_J[0],state.tau_J[1],tau1,tau2": "t q1 q2 tau1 tau2",
    "Time [ms],Joint 1 Position [deg],Joint 2 Position [deg],Joint 1 Torque [Nm],Joint 2 Torque "
    "[Nm]": (
        "Time [ms],Joint 1 Position [deg],Joint 2 Position [deg],Joint 1 Torque [Nm],Joint 2 "
        "Torque [Nm]"
    ),
}


@pytest.mark.parametrize("header", FIELD)
def test_names_of_the_field_are_recognised(header: str) -> None:
    currents = {"torque_constant": 1.0} if "current" in header else {}
    settings = {"tau1": currents, "tau2": currents}
    chosen = opened(header.split(","), settings).origin.mapping
    wanted = FIELD[header].split("," if "," in FIELD[header] else " ")
    assert [chosen[name] for name in ("t", "theta1", "theta2", "tau1", "tau2")] == wanted


def test_torques_of_other_joints_are_not_taken() -> None:
    with pytest.raises(LogError, match="no column for tau2; found"):
        opened("t q1 q2 tau2 tau9")
