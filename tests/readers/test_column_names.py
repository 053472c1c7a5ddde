"""Names, clocks, dialects and order: the small parts, on what is seen in the field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.notices import Notice
from algid.readers import read_log
from algid.readers.flat import to_nanoseconds
from tests.readers.headers import opened

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
        opened(["t", "q1", "q2", "tau2", "tau9"])


def test_whole_nanoseconds_stay_exact() -> None:
    stamps = np.array([1_700_000_000_123_456_789, 1_700_000_000_123_456_790])
    assert to_nanoseconds(stamps, "ns").tolist() == stamps.tolist()
    with pytest.raises(ValueError, match="292 years"):
        to_nanoseconds(np.array([2**62]), "s")


@pytest.mark.parametrize(
    "text",
    [
        (
            "# made by hand\n\n t ; q1 ; q2 ; tau1 ; tau2 \n0,0 ; 1,5 ;2,0;3,0;4,0\n0,5;1,5 "
            ";2,0;3,0;4,0\n"
        ),
        "t\tq1\tq2\ttau1\ttau2\n0.0\t1.5\t2.0\t3.0\t4.0\n0.5\t1.5\t2.0\t3.0\t4.0\n",
        "# t q1 q2 tau1 tau2\n 0.0  1.5  2.0  3.0 4.0\n 0.5  1.5  2.0  3.0 4.0\n\n",
        (
            'note,"t","q1","q2","tau1","tau2"\r\n"x, '
            'y",0.0,1.5,2.0,3.0,4.0\r\nz,0.5,1.5,2.0,3.0,4.0\r\n'
        ),
        (
            "\ufefft, q1, q2, tau1, tau2\n0.0, 1.5, 2.0, 3.0, 4.0\n0.5, 1.5, 2.0, 3.0, 4.0\n"
            "0.6, 1.5, 2"
        ),
    ],
)
def test_dialects(text: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(text, newline="")
    found = read_log(tmp_path / "log.csv")
    assert found.theta.tolist() == [[1.5, 1.5], [2, 2]]
    assert found.tau.tolist() == [[3, 3], [4, 4]]
    cut = [Notice("CUT_OFF", numbers={"case": "cell"}, lossy=True)]
    assert [one for one in found.notices if one.lossy] == (cut if text.endswith("2") else [])
