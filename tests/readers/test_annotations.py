"""Units that a file states beside its columns' names: lines above a table, metadata of a schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import algid
from algid.base.errors import LogError
from algid.profile import Profile
from algid.readers import open_log, read_log
from tests.readers.ways import json_mcap

COLUMNS = ("time", "q1", "q2", "tau1", "tau2")
ROWS = 50


def table(above: str, header: str = ",".join(COLUMNS)) -> str:
    """A table whose angles are whole numbers and whose torques are ten times these."""
    rows = [f"{row / 100},{row},{2 * row},{10 * row + 5},{-10 * row - 5}" for row in range(ROWS)]
    return "\n".join([above, header, *rows]) + "\n"


@pytest.mark.parametrize(
    ("line", "settings"),
    [
        ("tau in mNm", {"tau1.unit": "mN m", "tau2.unit": "mN m"}),
        ("note: tau1, tau2 in mNm", {"tau1.unit": "mN m", "tau2.unit": "mN m"}),
        ("effort is logged in mN m.", {"tau1.unit": "mN m", "tau2.unit": "mN m"}),
        ("torque in lbf in", {"tau1.unit": "lbf in", "tau2.unit": "lbf in"}),
        ("motor current [A]", {"tau1.unit": "A", "tau2.unit": "A"}),
        ("Torque unit: mNm", {"tau1.unit": "mN m", "tau2.unit": "mN m"}),
        ("angles: degrees", {"theta1.unit": "deg", "theta2.unit": "deg"}),
        ('units: {"q1": "deg"}', {"theta1.unit": "deg", "theta2.unit": "deg"}),
        ("time in ms", {"time_unit": "ms"}),
        ("position in inch", {"theta1.unit": None, "theta2.unit": None}),
        ("effort: gravity-compensated", {"effort": "gravity-compensated"}),
        ("zero = hanging", {"zero": "hanging"}),
        ("a robot in a lab, payload: 2 kg, q1 was greased in June", {}),
        ("tau in Nm, q in rad, time in s", {}),
        ("arm A swings by 30 deg every 5 ms, a turn to the left", {}),
    ],
)
def test_what_a_comment_states_is_told_and_not_used(
    line: str, settings: dict[str, str | None], tmp_path: Path
) -> None:
    (tmp_path / "log.csv").write_text(table(f"# {line}"))
    log = read_log(tmp_path / "log.csv")
    assert log.tau[0, 0] == 5
    said = [notice for notice in log.notices if notice.code == "STATED_UNUSED"]
    found: dict[str, object] = {}
    for notice in said:
        for remedy in notice.remedies:
            found |= remedy.settings
    assert found == settings
    assert len(said) == bool(settings)


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


def test_topics_that_share_no_row_are_refused(tmp_path: Path) -> None:
    rows = [f"{place * 1e-3:g},{'1,2,,' if place % 2 else ',,3,4'}" for place in range(10)]
    (tmp_path / "log.csv").write_text("\n".join([",".join(COLUMNS), *rows]) + "\n")
    with pytest.raises(LogError, match="no row has a value in every column"):
        read_log(tmp_path / "log.csv")


def test_a_unit_of_a_json_schema_may_stand_at_a_lists_items(tmp_path: Path) -> None:
    effort = {"type": "array", "items": {"unit": "mNm"}, "description": "measured"}
    schema = {"properties": {"state": {"type": "object", "properties": {"effort": effort}}}}
    rows = []
    for place in range(20):
        state = {"name": ["a", "b"], "position": [place, -place], "effort": [place + 1, 2 - place]}
        rows.append((place * 10**7, json.dumps({"state": state})))
    path = json_mcap(tmp_path, rows, ("arm", "jsonschema", json.dumps(schema).encode()))
    log = read_log(path)
    assert log.tau[0] == pytest.approx(1e-3 * np.arange(1, 21))
    assert log.origin.reading.channels["tau2"].unit == "mN m"


def test_units_among_the_key_values_of_parquet_hold_whoever_wrote_them(tmp_path: Path) -> None:
    columns = {name: np.arange(20.0) for name in COLUMNS}
    units = {"units": json.dumps({"tau1": "mNm", "tau2": "mNm"})}
    pl.DataFrame(columns).write_parquet(tmp_path / "log.parquet", metadata=units)
    assert read_log(tmp_path / "log.parquet").tau[0, 1] == pytest.approx(1e-3)


@pytest.mark.parametrize("form", ["mcap", "parquet"])
def test_a_unit_that_was_converted_is_not_applied_again_without_a_word(
    form: str, tmp_path: Path
) -> None:
    (tmp_path / "log.csv").write_text(table("above"))
    converted = tmp_path / f"log.{form}"
    algid.convert(tmp_path / "log.csv", converted, torque_unit="mNm", angle_unit="deg")
    assert read_log(converted).tau[0, 1] == pytest.approx(15e-3)
    assert not open_log(converted).notices
    again = open_log(converted, Profile(torque_unit="mNm")).notices
    assert {one.key for one in again} == {"OTHER_UNIT:stated"}


@pytest.mark.parametrize("form", ["parquet", "feather"])
@pytest.mark.parametrize(
    "stated", [{"torque_unit": "mNm"}, {"tau1": {"unit": "mNm"}, "tau2": {"unit": "mNm"}}]
)
def test_attributes_that_pandas_saved_hold(
    form: str, stated: dict[str, Any], tmp_path: Path
) -> None:
    frame = pd.DataFrame({name: np.arange(20.0) for name in COLUMNS})
    frame.attrs = stated
    getattr(frame, f"to_{form}")(tmp_path / "log")
    assert read_log(tmp_path / "log").tau[:, 1] == pytest.approx([1e-3, 1e-3])


@pytest.mark.parametrize("place", ["group", "quantity", "group above"])
def test_units_of_an_hdf5_group_are_those_of_its_datasets(place: str, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        group = file.create_group("log")
        torques = group if place == "group" else file.create_group("torque")
        torques.attrs["torque_unit" if place == "group" else "units"] = "mNm"
        if place == "group above":
            torques = torques.create_group("measured")
        for name in COLUMNS:
            (torques if name.startswith("tau") else group)[name] = np.arange(20.0)
    assert read_log(tmp_path / "log.h5").tau[:, 1] == pytest.approx([1e-3, 1e-3])
    with h5py.File(tmp_path / "log.h5", "a") as file:
        file.create_group("other").attrs["torque_unit"] = "kNm"
        file["log"].attrs["torque_unit"] = "mNm"
    with pytest.raises(LogError, match="groups state torque_unit as 'mNm' and as 'kNm'"):
        read_log(tmp_path / "log.h5")
