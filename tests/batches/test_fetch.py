"""Logs in an object store: fetching them changes no number."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import algid
from algid.base.errors import LogError
from algid.base.stores import open_store
from algid.batches.job import fetched
from algid.identification.identify import identify
from algid.settings import Settings
from tests.objects import Served, s3

WEAK = Settings(estimator="weak", model="plain")


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as monkeypatch, s3(monkeypatch) as running:
        yield running


@pytest.mark.parametrize("name", ["joints.mcap", "a.csv", "a.parquet"])
def test_a_log_is_fetched_whole_and_hashed(name: str, served: Served, tmp_path: Path) -> None:
    path = tmp_path / name
    algid.write_log(path, algid.synthesise("case1", duration=2.0, torque="wide")[0])
    open_store(served.url("logs")).write(name, path.read_bytes())
    copy = fetched(served.url(f"logs/{name}"), tmp_path / "copy")
    assert copy.whole
    assert copy.path.read_bytes() == path.read_bytes()
    one, other = (identify(log, settings=WEAK).log.sha256 for log in (copy, path))
    assert one == other


def test_an_error_names_the_object(served: Served, tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"^s3://lab-\w+/absent\.mcap.* it cannot be read"):
        fetched(served.url("absent.mcap"), tmp_path / "copy")
