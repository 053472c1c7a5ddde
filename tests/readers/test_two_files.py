"""Angles in one file and torques in another: against the log that they were taken from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import algid
from algid.base.errors import LogError
from algid.log import Log
from algid.notices import Notice
from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS

ROWS = 4000
STAMPS = EPOCH_NS + np.arange(ROWS) * 1_000_000
T = np.arange(ROWS) * 1e-3
THETA = np.stack([np.sin(2 * T), np.cos(3 * T)])
TAU = np.stack([np.cos(T), np.sin(2 * T)])


def saved(path: Path, **columns: Any) -> Path:
    frame = pl.DataFrame(columns)
    (frame.write_csv if path.suffix == ".csv" else frame.write_parquet)(path)
    return path


def angles(folder: Path, *, late_ns: int = 0) -> Path:
    return saved(folder / "a.csv", stamp_ns=STAMPS + late_ns, q1=THETA[0], q2=THETA[1])


def torques(
    folder: Path, own: Any = slice(None), names: tuple[str, str] = ("tau1", "tau2")
) -> None:
    both = dict(zip(names, TAU[:, own], strict=True))
    saved(folder / "t.csv", stamp_ns=STAMPS[own], **both)


def read(path: Path, **settings: Any) -> Log:
    """A log with the torques of `t.csv`."""
    return read_log(path, Profile.model_validate({"torque_file": "t.csv", **settings}))


def codes(log: Log) -> list[str]:
    return [one.code for one in log.notices]


def test_torques_of_the_same_stamps_are_taken_as_they_are(tmp_path: Path) -> None:
    torques(tmp_path)
    log = read(angles(tmp_path))
    assert np.array_equal(log.stamp_ns, STAMPS)
    assert np.array_equal(log.theta, THETA)
    assert np.array_equal(log.tau, TAU)
    assert log.notices == ()
    assert log.origin.mapping["tau1"] == "t.csv: tau1"
    assert log.origin.reading.torque_file == str(tmp_path / "t.csv")
    assert log.origin.reading.channels["tau2"].source == "t.csv: tau2"


def test_torques_of_other_stamps_are_interpolated_where_both_were_recorded(tmp_path: Path) -> None:
    own = slice(503, 3504, 3)
    torques(tmp_path, own)
    log = read(angles(tmp_path))
    assert np.array_equal(log.theta, THETA[:, 503:3504])
    # a line between samples 3 ms apart misses by (3 ms)² / 8 times the second derivative
    assert np.abs(log.tau - TAU[:, 503:3504]).max() < 4 * (3e-3) ** 2 / 8 + 1e-12
    assert codes(log) == ["ALIGNED", "ALIGNED"]
    assert [one.lossy for one in log.notices] == [False, False]
    assert log.notices[0].text == (
        "999 samples lie before or behind what t.csv holds, and are left out"
    )


def test_a_hole_in_the_torques_is_a_loss(tmp_path: Path) -> None:
    torques(tmp_path, np.r_[:1000, 1100:ROWS])
    log = read(angles(tmp_path))
    assert len(log) == ROWS - 100
    (lost,) = [one for one in log.notices if one.lossy]
    assert lost == Notice("ALIGNED", numbers={"case": "not covered", "count": 100}, lossy=True)


def test_files_that_do_not_overlap_are_refused(tmp_path: Path) -> None:
    torques(tmp_path)
    late = angles(tmp_path, late_ns=10**10)
    with pytest.raises(LogError, match=r"a\.csv: 0 samples; .* lie before or behind what t\.csv"):
        read(late)


def test_joints_by_name_stand_in_the_order_of_the_angles(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.csv", t=T, elbow_pos=THETA[1], shoulder_pos=THETA[0])
    saved(tmp_path / "t.parquet", t=T, elbow_torque=TAU[1], shoulder_torque=TAU[0])
    log = read(path, torque_file="t.parquet")
    assert np.array_equal(log.theta, THETA)
    assert np.array_equal(log.tau, TAU)
    swapped = read(path, torque_file="t.parquet", joints=("elbow", "shoulder"))
    assert np.array_equal(swapped.tau, TAU[::-1])


def test_columns_of_either_file_are_named_and_turned(tmp_path: Path) -> None:
    torques(tmp_path, names=("a", "b"))
    log = read(
        angles(tmp_path),
        theta2={"sign": -1},
        tau1={"source": "a", "unit": "mN m"},
        tau2={"source": "b", "unit": "mN m", "sign": -1},
        start=1.0,
    )
    assert np.array_equal(log.theta[1], -THETA[1, 1000:])
    assert log.tau[0] == pytest.approx(1e-3 * TAU[0, 1000:])
    assert log.tau[1] == pytest.approx(-1e-3 * TAU[1, 1000:])


def test_what_is_wrong_is_said_in_one_line(tmp_path: Path) -> None:
    path = angles(tmp_path)
    with pytest.raises(LogError, match=r"no column for tau1, tau2; .*--torque-file FILE"):
        read_log(path)
    with pytest.raises(LogError, match=r"x\.csv: there is no such file of torques, neither beside"):
        read(path, torque_file="x.csv")
    with pytest.raises(LogError, match=r"a\.csv: no column for tau1, tau2; found 'stamp_ns'"):
        read(path, torque_file="a.csv")


def test_a_clock_of_two_files_may_not_start_again(tmp_path: Path) -> None:
    torques(tmp_path)
    stamps = np.r_[STAMPS[:2000], STAMPS[:2000]]
    saved(tmp_path / "a.csv", stamp_ns=stamps, q1=THETA[0], q2=THETA[1])
    with pytest.raises(LogError, match=r"a\.csv: time goes backwards .*split the file"):
        read(tmp_path / "a.csv")


def test_one_file_of_torques_serves_one_log(tmp_path: Path) -> None:
    torques(tmp_path)
    first = angles(tmp_path)
    second = saved(tmp_path / "b.csv", stamp_ns=STAMPS + 1000, q1=THETA[0], q2=THETA[1])
    with pytest.raises(
        LogError, match=r"b\.csv: its torques would come from .*t\.csv, as those of"
    ):
        algid.identify([first, second], torque_file="t.csv")


def test_an_earlier_result_lends_no_other_log_its_torques(tmp_path: Path) -> None:
    unloaded, loaded = algid.synthesise("case1", duration=2.0, torque="wide")
    stamps, q, tau = unloaded.stamp_ns, unloaded.theta, unloaded.tau
    path = saved(tmp_path / "a.csv", stamp_ns=stamps, q1=q[0], q2=q[1])
    saved(tmp_path / "t.csv", stamp_ns=stamps, tau1=tau[0], tau2=tau[1])
    arm = algid.identify(path, torque_file="t.csv", model="plain")
    assert arm.profile["torque_file"] == "t.csv"
    assert arm.parameters["k1"].estimate == pytest.approx(
        algid.identify(unloaded, model="plain").parameters["k1"].estimate
    )
    weighed = algid.identify([], loaded, parameters=arm)
    assert weighed.logs[0].reading.torque_file is None
