"""Names, clocks, dialects and order: the small parts, on what is seen in the field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import LogError
from algid.notices import Notice
from algid.readers import read_log
from algid.readers.clock import in_order
from algid.readers.flat import time_unit, to_nanoseconds
from algid.readers.table import SampleTable
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


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *(
            ("t_ms", "ms"),
            ("time_us", "us"),
            ("timestamp_nanoseconds", "ns"),
            ("Time (msec)", "ms"),
        ),
        *(("seconds", "s"), ("millis", "ms"), ("elapsed_s", "s"), ("t", None), ("time", None)),
    ],
)
def test_units_of_time_in_names(name: str, unit: str | None) -> None:
    origin = opened([name, "q1", "q2", "tau1", "tau2"]).origin
    assert origin.mapping["t"] == name
    assert origin.reading.time_unit == unit


def test_torques_of_other_joints_are_not_taken() -> None:
    with pytest.raises(LogError, match="no column for tau2; found"):
        opened(["t", "q1", "q2", "tau2", "tau9"])


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("start", [0, 1_700_000_000])
def test_units_of_time_are_told_by_size_and_step(unit: str, start: int) -> None:
    factor = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    times = start * factor + np.arange(100) * (factor * 2e-3)
    assert time_unit(times) == unit
    # float64 seconds since 1970 resolve 0.24 µs; half of that is the rounding
    assert (
        np.abs(to_nanoseconds(times, unit) - (start * 10**9 + np.arange(100) * 2_000_000)).max()
        <= 240
    )


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


def sorted_stamps(*tables: list[int]) -> tuple[list[int], list[str]]:
    made = [SampleTable(np.array(stamps), {"theta1": np.array(stamps, float)}) for stamps in tables]
    found = list(in_order("log", iter(made)))
    for table in found:
        samples = table.columns["theta1"].tolist() if table.columns else []  # the last has remarks
        assert samples == table.stamp_ns.tolist()
    stamps = [stamp for table in found for stamp in table.stamp_ns.tolist()]
    return stamps, [notice.code for table in found for notice in table.notices]


def test_two_recordings_in_one_file_are_not_mixed() -> None:
    with pytest.raises(LogError, match="time goes backwards"):
        sorted_stamps([*range(0, 6000, 2), *range(1, 6000, 2)])
    with pytest.raises(LogError, match="time goes backwards"):
        sorted_stamps(list(range(0, 6000, 2)), list(range(1, 6000, 2)))
