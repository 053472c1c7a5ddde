"""How commands end as processes: on hostile folders, and where nothing can be written."""

from __future__ import annotations

import os
from pathlib import Path

import polars as pl
import pytest

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
