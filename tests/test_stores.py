"""Batches from and to an object store: a local server that speaks S3."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import polars as pl
import pytest

import algid
from algid.batch.discover import jobs_of
from algid.batch.plan import Recipe
from algid.batch.records import End
from algid.batch.run import Batch
from algid.pipeline.settings import Settings
from algid.stores import connect, open_store
from algid.synth.sensors import Sensors
from tests.batch.test_run import Here


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    server = pytest.importorskip("moto.server", reason="moto is absent")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    running.start()
    query = f"?scheme=http&endpoint_override={quote(f'127.0.0.1:{port}')}&region=us-east-1&allow_bucket_creation=true"
    connect(f"s3://lab/{query}")[0].create_dir("lab")
    yield query
    running.stop()


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
