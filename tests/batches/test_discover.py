"""Which jobs sources hold."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

import algid
from algid.base.errors import SettingError
from algid.batches.discover import jobs_of
from algid.batches.job import redacted
from algid.batches.jobs import Job, fit_name
from algid.batches.manifest import is_manifest

JOB = "[[job]]\nname = 'x'\nlogs = 'a.csv'\n"


def _touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("x")


def named(*sources: str, out: str = "out") -> list[str]:
    """The names of the jobs that sources hold."""
    return [job.name for job in jobs_of(sources, out)]


def test_unloaded_and_loaded_logs_pair_up(tmp_path: Path) -> None:
    _touch(
        tmp_path,
        "r1/a-unloaded.mcap",
        "r1/a-loaded.csv.zst",
        "b_loaded.parquet",
        "plain.csv",
        "notes.txt",
    )
    found = jobs_of([str(tmp_path)], str(tmp_path / "out"))
    assert [(job.name, len(job.logs), len(job.loaded), job.robot) for job in found] == [
        ("b", 0, 1, None),
        ("plain", 1, 0, None),
        ("r1/a", 1, 1, "r1"),
    ]


def test_results_and_hidden_files_are_passed_over(tmp_path: Path) -> None:
    _touch(tmp_path, "a.mcap", "a.algid/torque.parquet", "out/jobs.parquet", "out/b.csv", ".c.csv")
    _touch(tmp_path, "jobs.parquet")
    assert named(str(tmp_path), out=str(tmp_path / "out")) == ["a", "jobs"]
    assert named(str(tmp_path), out=str(tmp_path)) == ["a", "out/b", "out/jobs"]


def test_a_glob_and_a_file_name_jobs_by_their_stems(tmp_path: Path) -> None:
    _touch(tmp_path, "x/a.mcap", "y/b.mcap")
    assert named(str(tmp_path / "*/*.mcap")) == ["a", "b"]
    (job,) = jobs_of([str(tmp_path / "x/a.mcap")], "out")
    assert job == Job("a", logs=(str(tmp_path / "x/a.mcap"),))
    (job,) = jobs_of([str(tmp_path / "x/a.mcap")], "out", alone="loaded")
    assert job == Job("a", loaded=(str(tmp_path / "x/a.mcap"),))


def test_two_logs_of_one_name_fail_alone(tmp_path: Path) -> None:
    _touch(tmp_path, "a.mcap", "a.csv", "b.csv", "c-loaded.csv", "c_loaded.mcap")
    first, second, third = jobs_of([str(tmp_path)], "out")
    told = f"a: two jobs of one name ({tmp_path}/a.csv, {tmp_path}/a.mcap); rename a log"
    assert first.trouble == f"{told}, or name the jobs in a manifest"
    assert (second.name, second.trouble) == ("b", None)
    assert third.trouble.startswith("c: two jobs of one name")


@pytest.mark.parametrize("name", ["bad\nname", "a\\b", "caf\udce9", "a\u202eb", "x" * 201])
def test_a_log_of_an_odd_name_fails_alone_and_is_told_in_visible_letters(
    tmp_path: Path, name: str
) -> None:
    _touch(tmp_path, "good.csv", f"{name}.csv")
    odd, good = sorted(jobs_of([str(tmp_path)], "out"), key=lambda job: job.trouble is None)
    assert (good.name, good.trouble) == ("good", None)
    assert fit_name(odd.name) == odd.name
    readable = "".join(filter(str.isalnum, name[:40]))
    assert odd.name.replace("%", "").startswith(readable)
    assert (
        "a job's name becomes a folder's: expected parts of 1 to 200 printable characters"
        in odd.trouble
    )
    assert odd.logs == (f"{tmp_path}/{name}.csv",)
    assert all(path.encode() for path in redacted(odd).logs)
    assert jobs_of([str(tmp_path)], "out") == jobs_of([str(tmp_path)], "out")


def test_links_to_folders_are_named_and_not_entered(tmp_path: Path) -> None:
    _touch(tmp_path, "logs/a.csv", "logs/z/b.csv", "elsewhere/c.csv")
    (tmp_path / "logs/z/up").symlink_to("..")
    (tmp_path / "logs/far").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "logs/itself.csv").symlink_to(tmp_path / "logs/itself.csv")
    (tmp_path / "logs/file.csv").symlink_to(tmp_path / "elsewhere/c.csv")
    folder, passed = str(tmp_path / "logs"), [f"{tmp_path}/logs/far", f"{tmp_path}/logs/z/up"]
    links: list[str] = []
    found = [job.name for job in jobs_of([folder], "out", links=links)]
    assert found == ["a", "file", "itself", "z/b"]
    assert sorted(links) == passed
    done = algid.batch(folder, tmp_path / "out", workers=1)
    assert sorted(done.links) == passed


def test_a_pattern_that_holds_nothing_or_two_stars_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="no such file, folder or match"):
        jobs_of([f"{tmp_path}/absent*.csv"], "out")
    with pytest.raises(SettingError, match=r"expected no \*\*; name the folder"):
        jobs_of([f"{tmp_path}/**/*.csv"], "out")


def test_manifests_in_csv_and_toml_say_the_same(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(
        "name,logs,loaded,profile,robot,time,payload,site\n"
        "d1,a.csv;b.csv,/l/c.csv,arm.toml,7,2026-01-31T12:00:00Z,0.5,Ulm\n"
    )
    (tmp_path / "m.toml").write_text(
        '[[job]]\nname="d1"\nlogs=["a.csv", '
        '"b.csv"]\nloaded="/l/c.csv"\nprofile="arm.toml"\nrobot=7\n'
        'time=2026-01-31T12:00:00Z\npayload=0.5\nsite="Ulm"\n'
    )
    assert is_manifest(tmp_path / "m.csv")
    (tmp_path / "empty.csv").touch()
    assert not is_manifest(tmp_path / "empty.csv")
    (first,) = jobs_of([str(tmp_path / "m.csv")], "out")
    assert jobs_of([str(tmp_path / "m.toml")], "out") == [first]
    assert first == Job(
        "d1",
        logs=(str(tmp_path / "a.csv"), str(tmp_path / "b.csv")),
        loaded=("/l/c.csv",),
        profile=str(tmp_path / "arm.toml"),
        robot="7",
        time="2026-01-31T12:00:00+00:00",
        labels={"payload": 0.5, "site": "Ulm"},
    )


BAD = {
    "m.csv": [
        ("name,logs\n../x,a.csv\n", "row 1.name: a job's name becomes a folder's"),
        ("name,logs\nx,\n", "row 1: expected logs, or loaded ones"),
        ("name,logs,time\nx,a.csv,yesterday\n", "row 1.time: expected ISO 8601"),
        (
            "name,logs,logs\nx,a.csv,b.csv\n",
            r"the manifest cannot be read \(two columns are named 'logs'\); mend it",
        ),
        ("name,logs\nx,a,b,c\n", "row 1.cells beyond the header: expected text.*found .'b', 'c'."),
        ("name,logs\ny,a.csv\nx,a\0.csv\n", "row 2.logs.0: "),
    ],
    "m.toml": [
        ("", r"expected tables \[\[job\]\] alone, found none"),
        (f"more = 1\n{JOB}", r"expected tables \[\[job\]\] alone, found more"),
        ("[[job]]\nname = 'x'\nlogs = 5", "job 1.logs: expected a valid list, found 5"),
        ("[[job]]\nname = 'x'\nlogs = 'a.csv'\ntime = 07:32:00", "job 1.time: expected ISO 8601"),
        ("a = " + "[" * 5000 + "]" * 5000, r"not TOML \(maximum recursion depth"),
        (f"{JOB}payload = 0x1{'0' * 5000}", "job 1.payload: expected text, a date, .*, found "),
        (f"{JOB}payload = {{a = 1}}", "job 1.payload: .* found {'a': 1}"),
    ],
}


@pytest.mark.parametrize(
    ("file", "text", "told"), [(file, *one) for file, rows in BAD.items() for one in rows]
)
def test_a_bad_manifest_is_refused_by_its_place(
    tmp_path: Path, file: str, text: str, told: str
) -> None:
    (tmp_path / file).write_text(text)
    with pytest.raises(SettingError, match=rf"^{tmp_path / file}: {told}"):
        jobs_of([str(tmp_path / file)], "out")


def test_a_manifest_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"m\.toml: cannot read it .*No such file.*check the"):
        jobs_of([str(tmp_path / "m.toml")], "out")
    (tmp_path / "m.csv").write_bytes(b"name,logs\nx,\xff.csv\n")
    with pytest.raises(SettingError, match=r"m\.csv: the manifest cannot be read .*utf-8.*mend it"):
        jobs_of([str(tmp_path / "m.csv")], "out")


def test_what_else_a_row_holds_is_a_label(tmp_path: Path) -> None:
    labels = "runs = 3\ngood = true\nat = 2026-01-31\nlogs = 's3://lab/a.csv'"
    (tmp_path / "m.toml").write_text(f"[[job]]\nname = 'x'\n{labels}")
    said: dict[str, Any] = {"runs": 3, "good": True, "at": "2026-01-31"}
    found = Job("x", ("s3://lab/a.csv",), labels=said)
    assert jobs_of([str(tmp_path / "m.toml")], "out") == [found]


def test_a_name_that_could_leave_the_folder_of_results_is_refused() -> None:
    leaving = ("", "/a", "a/", "../a", "a/..", "a\\b", "a\nb", "ä" * 101)
    for name in (*leaving, "jobs.parquet/b", "x.json/y", "a.ALGID/b", "abcd/" * 250 + "d"):
        with pytest.raises(ValueError, match="becomes a folder's"):
            fit_name(name)
    assert fit_name("r1/day 2/a.b" + "/…/" + "ä" * 100)


def test_a_folder_where_nobody_may_look_fails_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _touch(tmp_path, "a.csv", "locked/b.csv")
    scan = os.scandir

    def refused(path: str) -> Any:
        if path.endswith("locked"):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)
        return scan(path)

    monkeypatch.setattr(os, "scandir", refused)
    locked, good = jobs_of([str(tmp_path)], "out")
    place = f"{tmp_path}/locked: cannot look there"
    assert locked.trouble == f"{place} (Permission denied); check its rights"
    assert (good.name, good.trouble) == ("a", None)
    for source in (str(tmp_path / "locked"), "x" * 5000, "a\0b"):
        with pytest.raises(
            SettingError, match=r": cannot look there \(.*\); check its name|no such file"
        ):
            jobs_of([source], "out")


def test_a_bag_is_one_log_and_its_folder_no_place_to_look_in(tmp_path: Path) -> None:
    _touch(tmp_path, "run-loaded/metadata.yaml", "run-loaded/0.mcap", "plain/0.MCAP", "y.csv.gz")
    bag = Job("run", loaded=(str(tmp_path / "run-loaded"),))
    assert jobs_of([*bag.loaded, str(tmp_path)], "out")[1] == bag
    assert named(str(tmp_path)) == ["plain/0", "run", "y"]


def test_a_source_that_is_given_twice_counts_once(tmp_path: Path) -> None:
    _touch(tmp_path, "a.csv", "b.csv")
    assert named(str(tmp_path), str(tmp_path / "a.csv")) == ["a", "b"]
    _touch(tmp_path, "other/a.csv", "other/p-loaded.csv", "p-unloaded.csv")
    pair = Job("p", (f"{tmp_path}/p-unloaded.csv",), (f"{tmp_path}/other/p-loaded.csv",))
    assert jobs_of([*pair.loaded, *pair.logs, *pair.logs], "out") == [pair]
