"""Batches from and to an object store: a local server that speaks S3."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

import algid
from algid.batch import lock
from algid.batch.jobs import jobs_of
from algid.batch.plan import Recipe
from algid.batch.records import End
from algid.batch.run import Batch
from algid.errors import OutputError
from algid.settings import Settings
from algid.stores import open_store
from algid.synth.sensors import Sensors
from tests.batch.test_run import Here
from tests.objects import s3


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    with s3(monkeypatch) as served:
        yield served.query


def test_a_batch_reads_and_writes_objects(bucket: str, tmp_path: Path) -> None:
    unloaded, _ = algid.synthesise("case1", duration=1.5, excitation="wide", sensors=Sensors(1e-4, 1e-3))
    algid.write_log(tmp_path / "a.mcap", unloaded)
    store = open_store(f"s3://lab/logs{bucket}")
    store.write("r1/a.mcap", (tmp_path / "a.mcap").read_bytes())
    store.write("bad.csv", b"junk")
    out = f"s3://lab/out{bucket}"
    recipe = Recipe(out, Settings(estimator="weak"), lambda _file: None, report=False)
    jobs = jobs_of([f"s3://lab/logs{bucket}"], out)
    ended = Batch(open_store(out), recipe, Here(), 1, lambda _progress: None).run(jobs)
    assert [(record.job.name, record.status) for record in ended.records] == [("bad", End.FAILED), ("r1/a", End.OK)]
    assert Batch(open_store(out), recipe, Here(), 1, lambda _progress: None).run(jobs).ran == 0
    (tmp_path / "result.json").write_bytes(open_store(out).read("r1/a.algid/result.json") or b"")
    assert algid.read_result(tmp_path / "result.json").log.path.startswith("s3://lab/logs/r1/a.mcap")
    (tmp_path / "jobs.parquet").write_bytes(open_store(out).read("jobs.parquet") or b"")
    assert pl.read_parquet(tmp_path / "jobs.parquet")["status"].to_list() == ["failed", "ok"]


def test_a_batch_of_another_machine_holds_an_output_until_it_is_stale(
    bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = f"s3://lab/held{bucket}"
    monkeypatch.setattr(lock, "SETTLE", 0.0)
    with lock.locked(out):
        content = json.loads(open_store(out).read(lock.LOCK) or b"")
        with pytest.raises(OutputError, match="another batch is at work"), lock.locked(out):
            pass
    assert open_store(out).read(lock.LOCK) is None
    elsewhere = content | {"host": "elsewhere", "owner": "other"}
    open_store(out).write(lock.LOCK, json.dumps(elsewhere).encode())
    with pytest.raises(OutputError, match=r"a batch on elsewhere .* was at work there"), lock.locked(out):
        pass
    open_store(out).write(lock.LOCK, json.dumps(elsewhere | {"time": content["time"] - lock.STALE}).encode())
    with lock.locked(out):
        assert b"elsewhere" not in (open_store(out).read(lock.LOCK) or b"")


def test_a_batch_that_overwrites_the_lock_at_the_same_time_wins(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    out = f"s3://lab/raced{bucket}"
    rival = {"owner": "other", "host": "elsewhere", "process": 1, "time": time.time()}
    monkeypatch.setattr(time, "sleep", lambda _seconds: open_store(out).write(lock.LOCK, json.dumps(rival).encode()))
    with pytest.raises(OutputError, match="a batch on elsewhere"), lock.locked(out):
        pass
    assert json.loads(open_store(out).read(lock.LOCK) or b"") == rival
