"""How commands end, as processes of their own: on hostile folders, shared outputs, and where
nothing can be written.
"""

from __future__ import annotations

import os
from pathlib import Path

import polars as pl
import pytest

import algid
from pipelines.fuzz_files import sound_files
from pipelines.hostile import corpus
from tests.batches.commands import QUICK, Started, left, start, write_logs

pytestmark = pytest.mark.slow

ALONE = (*QUICK, "--workers", "1", "-q")


def ended(running: Started) -> tuple[int, str]:
    """The exit code and what was told."""
    _, told = running.communicate(timeout=120)
    assert "Traceback" not in told
    return running.returncode, told


def test_a_folder_of_hostile_logs_of_every_format_ends_with_a_row_a_log(tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    names = {path.name for path, _ in corpus(logs, 20, seed=5)}
    for number, (_, path) in enumerate([*sound_files(tmp_path / "made")][::6]):
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 10])
        names.add(path.rename(logs / f"o{number}-{path.name}").name)  # a job is named by its stem
    write_logs(logs / "sound", 1)
    code, told = ended(start("batch", logs, "-o", out, *ALONE))
    jobs = pl.read_parquet(out / "jobs.parquet")
    assert (code, jobs.height) == (1, len(names) + 1), told
    assert jobs.filter(pl.col("status") == "ok")["job"].to_list() == ["sound/d0"]
    reasons = jobs.filter(pl.col("status") != "ok")["reason"]
    assert reasons.str.contains(r"\n|^[A-Za-z]+(Error|Exception|Panic)\b").sum() == 0
    assert left(tmp_path) == []


def test_where_nothing_can_be_written_every_command_says_so_in_a_line(tmp_path: Path) -> None:
    place = Path("/sys/kernel/algid") if os.getuid() == 0 else tmp_path / "closed"
    if os.getuid() != 0:
        place.mkdir(mode=0o555)
    elif not place.parent.is_dir():
        pytest.skip("no folder in which the superuser cannot write")
    logs = write_logs(tmp_path / "logs", 1)
    log = next(logs.glob("*.csv"))
    for arguments in (
        ("batch", logs, "-o", place / "out", *ALONE),
        ("identify", log, "-o", place / "out", "--estimator", "weak", "--model", "plain"),
        ("convert", log, "-o", place / "a.mcap"),
        ("synth", "case1", "-o", place / "out"),
    ):
        code, told = ended(start(*arguments))
        assert code == 2, told
        last = told.strip().splitlines()[-1]
        assert last.startswith("algid: "), told
        assert str(place) in last


FOLDER = Path()
WRITERS = {
    "identify": (("LOG", "--estimator", "weak", "--model", "plain"), FOLDER, {"d0-unloaded.algid"}),
    "synth": (
        ("case1", "--duration", "2"),
        FOLDER,
        {"case1-unloaded.mcap", "case1-loaded.mcap"},
    ),
    "export": (("RESULT", "--to", "urdf"), Path("a.urdf"), {"a.urdf"}),
}
"""By command its arguments, what `-o` names, and what then stands there."""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A log and its result."""
    place = tmp_path_factory.mktemp("arm")
    log = next(write_logs(place / "logs", 1).glob("*.csv"))
    algid.identify([log], estimator="weak", model="plain", out=place, report=False)
    return {"LOG": log, "RESULT": place / "d0-unloaded.algid"}


@pytest.mark.parametrize("writer", WRITERS)
def test_of_two_processes_that_write_one_output_one_is_refused(
    writer: str, tmp_path: Path, arm: dict[str, Path]
) -> None:
    """The refused one leaves nothing, and what stands there is one's alone, whole."""
    words, name, wanted = WRITERS[writer]
    arguments = [arm.get(word, word) for word in words]
    out, alone = tmp_path / "out", tmp_path / "alone"
    command = [writer, *arguments, "-o"]
    for place in (out, alone):
        place.mkdir()
    ends = [ended(one) for one in [start(*command, out / name) for _ in range(2)]]
    assert sorted(code for code, _ in ends) in ([0, 2], [2, 3]), ends
    assert all("exists already" in told for code, told in ends if code == 2)
    assert {path.name for path in out.iterdir()} == wanted
    ended(start(*command, alone / name))
    assert files(out) == files(alone)


def files(folder: Path) -> dict[str, int]:
    """By path the lines of each file; what was written at another time has as many."""
    return {
        str(path.relative_to(folder)): path.read_bytes().count(b"\n") if path.suffix in TEXT else 0
        for path in folder.rglob("*")
        if path.is_file()
    }


TEXT = (".csv", ".urdf", ".json", ".md", ".yaml")
