"""Which jobs sources hold."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.batch.jobs import Job, is_manifest, jobs_of, read_manifest
from algid.errors import SettingError


def _touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("x")


def test_unloaded_and_loaded_logs_pair_up(tmp_path: Path) -> None:
    _touch(tmp_path, "r1/a-unloaded.mcap", "r1/a-loaded.csv.zst", "b_loaded.parquet", "plain.csv", "notes.txt")
    found = jobs_of([str(tmp_path)], str(tmp_path / "out"))
    assert [(job.name, len(job.logs), len(job.loaded), job.robot) for job in found] == [
        ("b", 0, 1, None),
        ("plain", 1, 0, None),
        ("r1/a", 1, 1, "r1"),
    ]


def test_results_and_hidden_files_are_passed_over(tmp_path: Path) -> None:
    _touch(tmp_path, "a.mcap", "a.algid/torque.parquet", "out/jobs.parquet", "out/b.csv", ".c.csv")
    assert [job.name for job in jobs_of([str(tmp_path)], str(tmp_path / "out"))] == ["a"]


def test_a_glob_and_a_file_name_jobs_by_their_stems(tmp_path: Path) -> None:
    _touch(tmp_path, "x/a.mcap", "y/b.mcap")
    assert [job.name for job in jobs_of([str(tmp_path / "*/*.mcap")], "out")] == ["a", "b"]
    (job,) = jobs_of([str(tmp_path / "x/a.mcap")], "out")
    assert job == Job("a", logs=(str(tmp_path / "x/a.mcap"),))
    (job,) = jobs_of([str(tmp_path / "x/a.mcap")], "out", alone="loaded")
    assert job == Job("a", loaded=(str(tmp_path / "x/a.mcap"),))


def test_two_logs_of_one_name_are_refused(tmp_path: Path) -> None:
    _touch(tmp_path, "a.mcap", "a.csv")
    with pytest.raises(SettingError, match=r"a: two jobs of one name .*a\.csv.*a\.mcap"):
        jobs_of([str(tmp_path)], "out")


def test_a_source_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="no such file, folder or match"):
        jobs_of([str(tmp_path / "absent*.csv")], "out")


def test_manifests_in_csv_and_toml_say_the_same(tmp_path: Path) -> None:
    rows = (
        "name,logs,loaded,profile,robot,time,payload,site\n"
        "d1,a.csv;b.csv,/l/c.csv,arm.toml,r1,2026-01-31T12:00:00Z,0.5,Ulm\n"
    )
    (tmp_path / "m.csv").write_text(rows)
    (tmp_path / "m.toml").write_text(
        '[[job]]\nname="d1"\nlogs=["a.csv", "b.csv"]\nloaded="/l/c.csv"\nprofile="arm.toml"\nrobot="r1"\n'
        'time=2026-01-31T12:00:00Z\npayload=0.5\nsite="Ulm"\n'
    )
    assert is_manifest(tmp_path / "m.csv")
    (first,) = read_manifest(tmp_path / "m.csv")
    (second,) = read_manifest(tmp_path / "m.toml")
    assert first == second
    assert first.logs == (str(tmp_path / "a.csv"), str(tmp_path / "b.csv"))
    assert first.profile == str(tmp_path / "arm.toml")
    assert first.labels == {"payload": 0.5, "site": "Ulm"}
    assert first.time == "2026-01-31T12:00:00+00:00"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name,logs\n../x,a.csv\n", "row 1: a job's name becomes a folder's"),
        ("name,logs\nx,\n", "row 1: expected a name and logs"),
        ("name,logs,time\nx,a.csv,yesterday\n", "row 1: time: expected ISO 8601"),
        ("name,logs\nx,a,b,c\n", "a row has more cells"),
    ],
)
def test_a_bad_manifest_is_refused_by_its_place(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(SettingError, match=told):
        read_manifest(tmp_path / "m.csv")
