"""Units that a file states beside its columns' names: lines above a table, metadata of a schema."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest

from algid.errors import LogError
from algid.profile import Profile, Torque
from algid.readers import open_log, read_log
from algid.readers.stated import in_text

COLUMNS = ("time", "q1", "q2", "tau1", "tau2")
ROWS = 50


def table(above: str, header: str = ",".join(COLUMNS)) -> str:
    """A table whose angles are whole numbers and whose torques are ten times these."""
    rows = [f"{row / 100},{row},{2 * row},{10 * row + 5},{-10 * row - 5}" for row in range(ROWS)]
    return "\n".join([above, header, *rows]) + "\n"


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("tau in mNm", {"tau1": "mNm", "tau2": "mNm"}),
        (
            "on Monday; tau1, tau2 in mN m, q1 and q2 in deg",
            {"q1": "deg", "q2": "deg", "tau1": "mN m", "tau2": "mN m"},
        ),
        ("torques are in mNm.", {"tau1": "mNm", "tau2": "mNm"}),
        ("angles: degrees", {"q1": "degrees", "q2": "degrees"}),
        ("q [deg], tau [mNm]", dict(zip(COLUMNS[1:], ("deg", "deg", "mNm", "mNm"), strict=True))),
        ("tau2 = mNm", {"tau2": "mNm"}),
        (
            "units: s, deg, deg, mNm, Nm",
            dict(zip(COLUMNS, ("s", "deg", "deg", "mNm", "Nm"), strict=True)),
        ),
        (
            "units: ms, deg, mNm",
            dict(zip(COLUMNS, ("ms", "deg", "deg", "mNm", "mNm"), strict=True)),
        ),
        ("torque (Nm)", {"tau1": "Nm", "tau2": "Nm"}),
        ("time in ms", {"time": "ms"}),
        ("position in inch", {"q1": "inch", "q2": "inch"}),
        ("a robot in a lab, payload: 2 kg, q1 was greased in June, temperature in degrees", {}),
        ("currents in mA", {}),
    ],
)  # fmt: skip
def test_statements(line: str, units: dict[str, str]) -> None:
    assert in_text([line], COLUMNS) == units


@pytest.mark.parametrize(
    "above", ["# tau in mNm\n# q in deg", "A title, of the log\nunits: s, deg, deg, mNm, mNm"]
)
def test_units_above_a_table_are_used(above: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table(above))
    log = read_log(tmp_path / "log.csv")
    assert np.allclose(np.rad2deg(log.theta[1]), 2 * np.arange(ROWS), rtol=1e-12)
    assert np.allclose(1000 * log.tau[0], 10 * np.arange(ROWS) + 5, rtol=1e-12)
    assert log.origin.reading.channels["tau1"].told == "names"


def test_a_flag_beats_a_statement_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table("# tau in mNm"))
    log = read_log(tmp_path / "log.csv", Profile(tau1=Torque(unit="N m"), tau2=Torque(unit="mN m")))
    assert log.tau[:, 0].tolist() == [5, -0.005]
    said = [notice.text for notice in log.notices if notice.code == "OTHER_UNIT"]
    assert said == [
        "the file states the unit mN m for tau1 ('tau1'), which is taken for N m, as told"
    ]


def test_a_name_beats_a_line_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table("# tau in mNm", "time,q1,q2,tau1 [Nm],tau2 [Nm]"))
    log = read_log(tmp_path / "log.csv")
    assert log.tau[0, 0] == 5
    assert sum(notice.code == "OTHER_UNIT" for notice in log.notices) == 2


def test_a_foreign_unit_above_a_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table("# position in inch"))
    with pytest.raises(LogError, match="'q1' for theta1 is in 'inch', which is no unit of a joint"):
        read_log(tmp_path / "log.csv")


def test_a_current_in_mA_is_not_one_in_A(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(table("#", "time,q1,q2,current1 [mA],current2 [mA]"))
    drive = Torque(torque_constant=0.5)
    assert read_log(tmp_path / "log.csv", Profile(tau1=drive, tau2=drive)).tau[
        0, 0
    ] == pytest.approx(0.0025, rel=1e-12)


def arrow(field_units: dict[str, str], metadata: dict[str, str]) -> pa.Table:
    """A table with units beside its columns."""
    values = {name: np.arange(ROWS) + 1.0 for name in COLUMNS} | {"time": np.arange(ROWS) / 100}
    fields = [
        pa.field(
            name,
            pa.float64(),
            metadata={"unit": field_units[name]} if name in field_units else None,
        )
        for name in COLUMNS
    ]
    return pa.table(values, schema=pa.schema(fields, metadata=metadata or None))


@pytest.mark.parametrize("kind", ["parquet", "feather"])
@pytest.mark.parametrize(
    ("field_units", "metadata"),
    [
        ({"q1": "deg", "q2": "deg", "tau1": "mNm", "tau2": "mNm"}, {}),
        ({}, {"units": json.dumps({"q": "deg", "tau1": "mNm", "tau2": "mNm"})}),
        (
            {"q1": "deg", "q2": "deg"},
            {"unit:tau1": "mNm", "tau2.unit": "mNm", "author": "A. N. Other"},
        ),
        ({}, {"units": "time in s, q in deg, tau in mNm"}),
    ],
)
def test_units_of_a_schema_are_used(
    field_units: dict[str, str], metadata: dict[str, str], kind: str, tmp_path: Path
) -> None:
    path = tmp_path / f"log.{kind}"
    write = pq.write_table if kind == "parquet" else feather.write_feather
    write(arrow(field_units, metadata), path)
    log = read_log(path)
    assert np.allclose(np.rad2deg(log.theta), np.arange(ROWS) + 1, rtol=1e-12)
    assert np.allclose(1000 * log.tau, np.arange(ROWS) + 1, rtol=1e-12)


def test_units_of_a_list_column(tmp_path: Path) -> None:
    pairs = pa.array([[row, row] for row in np.arange(ROWS) + 1.0])
    schema = pa.schema(
        [
            ("t", pa.float64()),
            pa.field("q", pairs.type, metadata={"units": "deg"}),
            ("tau", pairs.type),
        ]
    )
    pq.write_table(
        pa.table([np.arange(ROWS) / 100, pairs, pairs], schema=schema), tmp_path / "log.parquet"
    )
    log = read_log(tmp_path / "log.parquet")
    assert np.rad2deg(log.theta[1, 0]) == pytest.approx(1)
    assert log.tau[1, 0] == 1


def test_metadata_that_are_no_units_are_left_alone() -> None:
    metadata = {
        "units": "{" * 9000,
        "pandas": "{}",
        "q1.unit": "blue",
        "unit": "x" * 100_000 + ", y" * 50_000,
    }
    columns = dict.fromkeys(COLUMNS, pa.array([0.0, 1.0]))
    reading = open_log(pa.table(columns).replace_schema_metadata(metadata)).origin.reading
    assert reading.time_unit is None
    assert [one.told for one in reading.channels.values()] == ["assumed"] * 4
