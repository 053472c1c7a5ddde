"""How commands end, as processes of their own: on hostile folders, shared outputs, and where
nothing can be written.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest

import algid
from algid.readers import read_log
from algid.synth.sensors import Sensors
from pipelines.hostile import corpus
from pipelines.hostile.others import other_files
from pipelines.mutations import clean_log

pytestmark = pytest.mark.slow

QUICK = ("--no-report", "--estimator", "weak", "--model", "plain", "--workers", "1", "-q")


def started(*arguments: str | Path) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen(
        [sys.executable, "-m", "algid", *map(str, arguments)],
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def ended(running: subprocess.Popen[str]) -> tuple[int, str]:
    """The exit code and what was told."""
    _, told = running.communicate(timeout=120)
    assert "Traceback" not in told
    return running.returncode, told


def left(folder: Path) -> list[str]:
    """What stands in a folder under a temporary name."""
    return [path.name for path in folder.rglob(".*") if path.name != ".jobs"]


def write_logs(folder: Path, count: int) -> Path:
    folder.mkdir()
    log, _ = algid.synthesise("case1", duration=2.0, excitation="wide", sensors=Sensors(1e-4, 1e-3))
    for number in range(count):
        algid.write_log(folder / f"d{number}-unloaded.csv", log)
    return folder


def test_a_folder_of_hostile_logs_of_every_format_ends_with_a_row_a_log(tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    names = {path.name for path, _ in corpus(logs, 20, seed=5)}
    for number, path in enumerate(other_files(logs, clean_log(60))):
        path.write_bytes(path.read_bytes()[: -(path.stat().st_size // 3)])
        names.add(path.rename(logs / f"o{number}-{path.name}").name)  # a job is named by its stem
    shutil.rmtree(logs / "clean")
    write_logs(logs / "sound", 1)
    code, told = ended(started("batch", logs, "-o", out, *QUICK))
    jobs = pl.read_parquet(out / "jobs.parquet")
    assert (code, jobs.height) == (1, len(names) + 1), told
    assert jobs.filter(pl.col("status") == "ok")["job"].to_list() == ["sound/d0"]
    assert jobs.filter(pl.col("status") != "ok")["reason"].str.contains("\n").sum() == 0
    assert left(tmp_path) == []


def test_two_batches_at_once_on_one_output_do_each_job_once(tmp_path: Path) -> None:
    logs, out = write_logs(tmp_path / "logs", 3), tmp_path / "out"
    first, second = (started("batch", logs, "-o", out, *QUICK) for _ in range(2))
    ends = sorted([ended(first), ended(second)])
    assert [code for code, _ in ends] == [0, 2], ends
    assert "another batch is at work" in ends[1][1]
    assert pl.read_parquet(out / "jobs.parquet")["status"].to_list() == ["ok"] * 3
    assert left(out) == []
    assert ended(started("batch", logs, "-o", out, *QUICK))[0] == 0


def test_an_interrupt_ends_a_batch_clean_and_the_next_one_finishes_it(tmp_path: Path) -> None:
    logs, out = write_logs(tmp_path / "logs", 4), tmp_path / "out"
    running = started("batch", logs, "-o", out, *QUICK)
    end = time.monotonic() + 60
    while not list(out.glob(".jobs/*.json")) and time.monotonic() < end:
        time.sleep(0.01)
    running.send_signal(signal.SIGINT)
    code, _ = ended(running)
    assert code == 130
    assert left(out) == []
    assert ended(started("batch", logs, "-o", out, *QUICK))[0] == 0
    assert pl.read_parquet(out / "jobs.parquet")["status"].to_list() == ["ok"] * 4


def test_where_nothing_can_be_written_every_command_says_so_in_a_line(tmp_path: Path) -> None:
    place = Path("/sys/kernel/algid") if os.getuid() == 0 else tmp_path / "closed"
    if os.getuid() != 0:
        place.mkdir(mode=0o555)
    elif not place.parent.is_dir():
        pytest.skip("no folder in which the superuser cannot write")
    logs = write_logs(tmp_path / "logs", 1)
    log = next(logs.iterdir())
    for arguments in (
        ("batch", logs, "-o", place / "out", *QUICK),
        ("identify", log, "-o", place / "out", "--estimator", "weak", "--model", "plain"),
        ("convert", log, "-o", place / "a.mcap"),
        ("synth", "case1", "-o", place / "out"),
    ):
        code, told = ended(started(*arguments))
        assert code == 2, told
        last = told.strip().splitlines()[-1]
        assert last.startswith("algid: "), told
        assert str(place) in last


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_of_two_writers_of_one_log_one_is_refused(tmp_path: Path, kind: str) -> None:
    log = next(write_logs(tmp_path / "logs", 1).iterdir())
    target = tmp_path / f"a.{kind}"
    ends = [ended(one) for one in [started("convert", log, "-o", target) for _ in range(2)]]
    assert sorted(code for code, _ in ends) == [0, 2], ends
    assert all("exists already" in told for code, told in ends if code == 2)
    assert len(read_log(target)) == len(read_log(log))
    assert left(tmp_path) == []


def test_of_two_synths_one_is_refused(tmp_path: Path) -> None:
    flags = ("synth", "case1", "--duration", "2", "-o", tmp_path)
    ends = [ended(one) for one in [started(*flags) for _ in range(2)]]
    assert sorted(code for code, _ in ends) == [0, 2], ends
    assert len(list(tmp_path.iterdir())) == 2
    assert all(len(read_log(path)) == 2001 for path in tmp_path.iterdir())
