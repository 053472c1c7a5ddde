"""Batches from and to an object store: a local server that speaks S3."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

import algid
from algid.base.errors import LogError, OutputError
from algid.base.stores import list_urls, object_stat, open_store, reading
from algid.batches.discover import jobs_of
from algid.batches.records import JobStatus
from algid.batches.run import Batch, BatchConfig
from algid.settings import Settings
from algid.synth.sensors import Sensors
from tests.batches.test_run import Here
from tests.objects import Served, s3


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    with s3(monkeypatch) as running:
        yield running


def test_a_batch_reads_and_writes_objects(served: Served, tmp_path: Path) -> None:
    unloaded, _ = algid.synthesise(
        "case1", duration=1.5, torque="wide", sensors=Sensors(1e-4, 1e-3)
    )
    algid.write_log(tmp_path / "a.mcap", unloaded)
    store = open_store(served.url("logs"))
    store.write("r1/a.mcap", (tmp_path / "a.mcap").read_bytes())
    store.write("bad.csv", b"junk")
    out = served.url("out")
    recipe = BatchConfig(out, Settings(estimator="weak"), lambda _file: None, report=False)
    jobs = jobs_of([served.url("logs")], out)
    ended = Batch(open_store(out), recipe, Here(), 1, lambda *_: None).run(jobs)
    assert [(record.job.name, record.status) for record in ended.records] == [
        ("bad", JobStatus.FAILED),
        ("r1/a", JobStatus.OK),
    ]
    assert Batch(open_store(out), recipe, Here(), 1, lambda *_: None).run(jobs).ran == 0
    (tmp_path / "result.json").write_bytes(open_store(out).read("r1/a.algid/result.json") or b"")
    assert algid.read_result(tmp_path / "result.json").log.path.startswith(
        f"s3://{served.bucket}/logs/r1/a.mcap"
    )
    (tmp_path / "jobs.parquet").write_bytes(open_store(out).read("jobs.parquet") or b"")
    assert pl.read_parquet(tmp_path / "jobs.parquet")["status"].to_list() == ["failed", "ok"]


@pytest.fixture(params=["folder", "objects"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty place of each kind."""
    if request.param == "folder":
        return str(tmp_path / "out")
    served: Served = request.getfixturevalue("served")
    return served.url("out")


def test_every_store_reads_what_it_wrote(place: str) -> None:
    store = open_store(place)
    assert (store.read("a/b"), store.exists("a/b"), store.names("a"), store.names("")) == (
        None,
        False,
        [],
        [],
    )
    for name in ("a/b", "a/c/d", "a/.hidden", "e"):
        store.write(name, name.encode())
    store.write("e", b"again")
    assert store.read("e") == b"again"
    assert store.read("a/.hidden") == b"a/.hidden"
    assert (store.exists("a/b"), store.exists("a"), store.exists("a/absent")) == (
        True,
        False,
        False,
    )
    assert store.names("a") == ["a/b", "a/c/d"]
    assert store.names("") == ["a/b", "a/c/d", "e"]


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path, served: Served) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write there"):
        open_store(str(tmp_path / "file")).write("below", b"")
    with pytest.raises(OutputError, match="check the URL"):
        open_store("s3://lab/?bogus=1")
    elsewhere = (
        f"s3://{served.bucket}-absent/out{served.query.replace('&allow_bucket_creation=true', '')}"
    )
    with pytest.raises(OutputError, match="cannot write there"):
        open_store(elsewhere).write("a", b"")


def test_objects_below_a_url_and_one_that_is_not_there(served: Served) -> None:
    open_store(served.url("logs")).write("r1/a.csv", b"123")
    assert list_urls(served.url("logs")) == [(served.url("logs/r1/a.csv"), "r1/a.csv")]
    assert list_urls(served.url("logs/r1/a.csv")) == [(served.url("logs/r1/a.csv"), "a.csv")]
    assert object_stat(served.url("logs/r1/a.csv"))[0] == 3
    assert object_stat(served.url("logs/absent")) == (0, 0)
    with (
        pytest.raises(LogError, match="check name and rights"),
        reading(served.url("absent")) as (filesystem, path),
    ):
        filesystem.open_input_file(path)


def test_a_listing_is_bounded(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b", "c"):
        open_store(served.url("logs")).write(f"{name}.csv", b"1")
    monkeypatch.setattr("algid.base.stores.MOST_LISTED", 3)
    assert len(list_urls(served.url("logs"))) == 3
    monkeypatch.setattr("algid.base.stores.MOST_LISTED", 2)
    with pytest.raises(OutputError, match="expected at most 2 objects, found 3; name a prefix"):
        list_urls(served.url("logs"))


def test_a_changed_object_is_done_again(served: Served, tmp_path: Path) -> None:
    store, out = open_store(served.url("logs")), str(tmp_path / "out")
    store.write("bad.csv", b"junk")
    jobs = jobs_of([served.url("logs")], out)
    recipe = BatchConfig(out, Settings(estimator="weak"), lambda _file: None, report=False)

    def ran() -> int:
        return Batch(open_store(out), recipe, Here(), 1, lambda *_: None).run(jobs).ran

    assert (ran(), ran()) == (1, 0)
    store.write("bad.csv", b"more junk")
    assert (ran(), ran()) == (1, 0)
