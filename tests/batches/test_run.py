"""Batches: what is run, what is kept, and what a fault leaves behind."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import algid
from algid.base.errors import LogError, OutputError, SettingError
from algid.base.stores import open_store
from algid.batches.discover import jobs_of
from algid.batches.job import Task
from algid.batches.jobs import Input, Job, JobStatus, stat_of
from algid.batches.run import Batch, Batched, locked
from algid.batches.workers import CallFailedError
from algid.identification.identify import identify
from algid.notices import Notice, Verdict
from algid.results import Result
from algid.settings import Settings
from algid.synth.cases import load_case
from algid.synth.sensors import Sensors
from pipelines.prior import urdf


class Here:
    """Runs a task where it is submitted; `before` may raise instead."""

    def __init__(self, before: Callable[[str], None] = lambda _name: None) -> None:
        self.before, self.ran = before, list[str]()

    def submit(self, fn: Callable[[Task], Any], task: Task) -> Future[Any]:
        future: Future[Any] = Future()
        self.ran.append(task.job.name)
        try:
            self.before(task.job.name)
            future.set_result(fn(task))
        except Exception as error:
            future.set_exception(error)
        return future


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    unloaded, loaded = algid.synthesise(
        "case1", duration=2.0, torque="wide", sensors=Sensors(1e-4, 1e-3)
    )
    for name in ("r1/a", "r1/b"):
        (folder / name).parent.mkdir(exist_ok=True)
        algid.write_log(folder / f"{name}-unloaded.parquet", unloaded)
        algid.write_log(folder / f"{name}-loaded.parquet", loaded)
    (folder / "bad.csv").write_text("not,a,log\n1,2,3\n")
    return folder


@pytest.fixture
def logs(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path / "logs")
    return tmp_path / "logs"


WEAK = Settings(estimator="weak", model="plain")


def batch_of(
    out: str | Path, here: Here | None = None, settings: Settings = WEAK, report: bool = False
) -> Batch:
    """A batch on `out` that runs its jobs in this process."""
    task_of = partial(Task, settings=settings, out=str(out), report=report)
    return Batch(open_store(str(out)), task_of, (here or Here()).submit, 1)


QUICK: Any = {"estimator": "weak", "model": "plain", "report": False}


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """`algid.batch` runs its jobs in this process."""
    monkeypatch.setattr("algid.batches.workers.Workers", lambda *_: nullcontext(Here()))


def _run(logs: Path, here: Here | None = None, settings: Settings = WEAK) -> Batched:
    out = logs.parent / "out"
    return batch_of(out, here, settings).run(jobs_of([str(logs)], str(out)))


def test_a_bad_log_fails_alone_and_the_table_has_a_row_a_job(logs: Path) -> None:
    ended = _run(logs)
    assert [record.status for record in ended.records] == [
        JobStatus.FAILED,
        JobStatus.OK,
        JobStatus.OK,
    ]
    table = pl.read_parquet(logs.parent / "out/jobs.parquet")
    assert table["job"].to_list() == ["bad", "r1/a", "r1/b"]
    assert table["robot"].to_list() == [None, "r1", "r1"]
    result = algid.read_result(logs.parent / "out/r1/a.algid")
    row = table.row(1, named=True)
    assert row["k1"] == result.parameters["k1"].estimate
    assert (row["estimator"], row["log_seconds"]) == ("weak", 4.0)
    assert row["m_p_std"] == result.payload["m_p"].std
    assert row["sha256"] == [log.sha256 for log in result.logs]
    assert row["size"] == [Path(log.path).stat().st_size for log in result.logs]
    assert row["changed"][0].timestamp() == pytest.approx(
        Path(result.log.path).stat().st_mtime, abs=1e-5
    )
    assert "no column for t, theta1" in str(table["reason"][0])


@pytest.mark.usefixtures("in_process")
def test_what_is_run_anew_is_told(logs: Path) -> None:
    out = logs.parent / "out"
    assert algid.batch(logs, out, **QUICK).anew == {}
    assert algid.batch(logs, out, **QUICK).ran == 0
    for path in (out / ".jobs").rglob("*.json"):  # as an older algid has left them
        record = json.loads(path.read_text()) | {"version": "0.1", "basis": "another"}
        path.write_text(json.dumps(record))
    assert algid.batch(logs, out, **QUICK).anew == {"of algid 0.1": 3}
    shutil.rmtree(out / "r1/a.algid")
    assert algid.batch(logs, out, **QUICK).anew == {"without their result": 1}
    (logs / "bad.csv").write_text("other,words\n1,2\n")
    assert algid.batch(logs, out, **QUICK).anew == {"of other logs": 1}
    assert algid.batch(logs, out, retry_failed=True, **QUICK).anew == {"failed before": 1}
    prior, arm = logs.parent / "arm.urdf", load_case("case1").arm
    for one, count in ((arm, 3), (arm, 0), (replace(arm, m2=1.1 * arm.m2), 3)):
        prior.write_text(urdf(one))
        done = algid.batch(logs, out, prior=prior, **QUICK)
        assert (sum(done.anew.values()), done.ran) == (count, count)


@pytest.mark.usefixtures("in_process")
def test_a_changed_file_of_torques_is_another_log(made: Path, tmp_path: Path) -> None:
    log = pl.read_parquet(made / "r1/a-unloaded.parquet")
    log.select("t", "theta1", "theta2").write_csv(tmp_path / "arm.csv")
    for time, ran in ((1, 1), (1, 0), (2, 1)):
        log.select("t", "tau1", "tau2").write_csv(tmp_path / "torques.txt")
        os.utime(tmp_path / "torques.txt", (time, time))
        done = algid.batch(
            tmp_path / "arm.csv", tmp_path / "out", torque_file="torques.txt", **QUICK
        )
        assert (done.counts, done.ran) == ({"ok": 1}, ran)


def test_a_full_disk_stops_the_batch_and_keeps_what_is_finished(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:

    def full(*args: Any, **more: Any) -> Any:
        if more["name"] == "a":
            raise OutputError("r1/a: cannot write (No space left on device)")
        return identify(*args, **more)

    monkeypatch.setattr("algid.batches.job.identify", full)
    ended = _run(logs)
    assert (ended.ran, ended.left) == (1, 2)
    assert "left on device); make room and run again: what is finished is kept" in ended.stopped
    monkeypatch.undo()
    assert _run(logs).ran == 2


@pytest.mark.usefixtures("in_process")
def test_parts_share_an_output_and_its_table_is_of_all(logs: Path) -> None:
    out = logs.parent / "out"
    with locked(str(out), shared=True):  # as another part holds it
        done = [algid.batch(logs, out, part=f"{part}/2", **QUICK) for part in (1, 2)]
        with pytest.raises(OutputError, match="another batch is at work"):
            algid.batch(logs, out, **QUICK)
    assert [[record.job.name for record in one.records] for one in done] == [
        ["bad", "r1/b"],
        ["r1/a"],
    ]
    assert pl.read_parquet(out / "jobs.parquet")["job"].to_list() == ["bad", "r1/a", "r1/b"]
    assert algid.batch(logs, out, **QUICK).ran == 0
    for wrong in ("0/2", "3/2"):
        with pytest.raises(SettingError, match=r"^--part: expected 1/N to N/N, and no --watch"):
            algid.batch(logs, out, part=wrong, **QUICK)


def test_a_result_that_must_not_be_used_is_a_failure_with_its_first_reason_and_is_kept(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = Verdict(
        "failed", "no sense; do not use these numbers", (Notice("X", "X: the torque is none"),)
    )
    with monkeypatch.context() as patch:
        patch.setattr(Result, "verdict", property(lambda _result: failed))
        ended = _run(logs)
    assert ended.records[1].reason == (
        "Failed: no sense; do not use these numbers. X: the torque is none"
    )
    table = pl.read_parquet(logs.parent / "out/jobs.parquet")
    assert table["status"].to_list() == ["failed"] * 3
    assert table["verdict"].to_list() == [None, "failed", "failed"]
    assert (logs.parent / "out/r1/a.algid/result.json").exists()
    assert _run(logs).ran == 0
    shutil.rmtree(logs.parent / "out/r1/a.algid")
    assert (_run(logs).ran, _run(logs).records[1].status) == (1, JobStatus.OK)


def test_a_watch_takes_logs_once_they_stay_as_they_are_and_tells_a_trouble_once(
    logs: Path, made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, told = 0, list[str]()

    def fail(_name: str) -> None:
        raise CallFailedError("as asked")

    def look() -> list[Job]:
        nonlocal looks
        looks += 1
        if looks in (5, 6):
            raise SettingError("away")
        if looks == 7:
            batch.stop.set()
        if looks < 4:
            (logs / "growing.csv").write_text("x" * looks)
        return jobs_of([str(logs)], "out")

    monkeypatch.setattr("algid.batches.run.LOOK_EVERY", 0.0)
    (logs / "empty.csv").touch()
    here, out = Here(fail), logs.parent / "out"
    batch = batch_of(out, here)
    found = ["bad", "r1/a", "r1/b"]
    batch.run(jobs_of([str(made)], str(out)))
    batch.watch(look, True, told.append)
    assert here.ran == [*found, *found, "growing"]  # what failed before is tried again once
    table = pl.read_parquet(out / "jobs.parquet")
    assert set(table["job"]) == {*found, "growing"}
    assert "as asked" in table["reason"].to_list()
    assert told == ["away"]


def test_a_watch_ends_by_a_signal_with_what_is_finished(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ending = Here(lambda _name: os.kill(os.getpid(), signal.SIGTERM))
    monkeypatch.setattr("algid.batches.workers.Workers", lambda *_: nullcontext(ending))
    monkeypatch.setattr("algid.batches.run.LOOK_EVERY", 0.0)
    done = algid.batch(logs, logs.parent / "out", workers=1, watch=True, **QUICK)
    assert (done.ran > 0, done.interrupted, done.stopped) == (True, False, None)
    assert pl.read_parquet(logs.parent / "out/jobs.parquet").height == done.ran


def test_a_job_whose_logs_cannot_be_looked_at_fails_this_time_and_keeps_its_row(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def seen(path: str) -> Input:
        if "r1/a" in path:
            raise LogError("away")
        return stat_of(path)

    _run(logs)
    monkeypatch.setattr("algid.batches.run.stat_of", seen)
    ended = _run(logs)
    one = ended.records[1]
    assert (ended.ran, one.job.name, one.status.value, one.reason) == (0, "r1/a", "failed", "away")
    table = pl.read_parquet(logs.parent / "out/jobs.parquet")
    assert table["status"].to_list() == ["failed", "ok", "ok"]
