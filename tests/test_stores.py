"""Batches from and to an object store: a local server that speaks S3."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from algid.base.errors import LogError, OutputError
from algid.base.stores import list_urls, open_store, reading
from algid.batches.jobs import stat_of
from tests.objects import Served, s3


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    with s3(monkeypatch) as running:
        yield running


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
    assert stat_of(served.url("logs/r1/a.csv")).size == 3
    assert stat_of(served.url("logs/absent")).size == 0
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
