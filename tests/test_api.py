"""What a notebook sees of algid."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import algid
from algid.identification.identify import identify
from algid.log import ChannelReading, Reading
from algid.results import ChannelRecord, LogReading, Result, Status
from tests.report.folders import build


def test_dir_shows_the_public_names_and_each_is_there() -> None:
    assert dir(algid) == sorted(algid.__all__)
    assert all(getattr(algid, name) is not None for name in algid.__all__)
    assert algid.identify is identify


def test_a_result_is_read_by_a_string_and_shows_itself_as_a_short_table(tmp_path: Path) -> None:
    made = build(tmp_path / "a.algid", duration=1.0)
    found = algid.read_result(str(tmp_path / "a.algid"))
    assert found == made
    lines = str(found).splitlines()
    assert lines == repr(found).splitlines()
    assert len(lines) == 2 + len(made.estimates)
    assert lines[1].split() == ["parameter", "estimate", "std", "unit", "status"]
    k1 = made.parameters["k1"]
    assert lines[2].split()[:2] == ["k1", f"{k1.estimate:.6g}"]
    assert lines[2].endswith("OK")
    hostile = found.model_copy(update={"log": found.log.model_copy(update={"path": "<b>\x1b[31m\n.csv"})})
    assert "<b>" not in hostile._repr_html_()
    assert hostile._repr_html_().count("<tr>") == 1 + len(made.estimates)
    assert "\x1b" not in str(hostile)
    assert len(str(hostile).splitlines()) == len(lines)


def test_a_result_of_the_first_schema_is_still_read(tmp_path: Path) -> None:
    """The file as version 1 wrote it: without what version 2 added."""
    build(tmp_path / "a.algid", duration=1.0)
    file = tmp_path / "a.algid" / "result.json"
    content = json.loads(file.read_text(encoding="utf-8"))
    content["schema_version"] = 1
    for name in ("profile", "causes"):
        del content[name]
    del content["log"]["reading"]
    del content["fit"]["endogeneity"]
    file.write_text(json.dumps(content), encoding="utf-8")
    old: Result = algid.read_result(file)
    assert old.schema_version == 2
    assert old.log.reading is None
    assert old.parameters["k1"].status is Status.OK


def test_a_result_keeps_all_that_a_reader_decided() -> None:
    assert {field.name for field in fields(Reading)} == set(LogReading.model_fields)
    assert {field.name for field in fields(ChannelReading)} == set(ChannelRecord.model_fields)
