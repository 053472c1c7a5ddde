"""Objects with any name, rights and fate: what is read is what was named, and one that is amiss
fails alone.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import algid
from algid.base.errors import AlgidError, LogError, OutputError, without_credentials
from algid.base.stores import connect, list_urls, open_store, put_folder
from algid.batches.discover import jobs_of
from algid.batches.job import fetched
from algid.batches.jobs import JobStatus
from algid.batches.run import Batched
from algid.synth.sensors import Sensors
from tests.batches.test_run import batch_of
from tests.objects import Served, s3
from tests.processes import Outcome

ODD = (
    "run%41.csv",
    "runA.csv",
    "a b.csv",
    'q".csv',
    "<x>.csv",
    "[y].csv",
    "ü µ.csv",
    "q?.csv",
    "h#.csv",
    "100%.csv",
)
KEY, SECRET = "AKIAEXAMPLE", "sEcReT%2FwIth%2BsLash"
USER = f"{KEY}:{SECRET}@"


@pytest.fixture(scope="module")
def server() -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as monkeypatch, s3(monkeypatch) as running:
        yield running


@pytest.fixture
def served(server: Served) -> Iterator[Served]:
    """The server with an empty bucket, every request allowed."""
    connect(server.url(""))[0].delete_dir_contents(server.bucket)
    server.asked.clear()
    yield server
    server.denied, server.after = lambda _method, _path: False, lambda _path: None


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A second at 200 Hz as CSV."""
    path = tmp_path_factory.mktemp("made") / "log.csv"
    sensors = Sensors(1e-4, 1e-3)
    unloaded, _ = algid.synthesise("case1", rate=200, duration=1, torque="wide", sensors=sensors)
    algid.write_log(path, unloaded)
    return path.read_bytes()


def _run(served: Served, place: str | None = None, user: str = "", report: bool = False) -> Batched:
    out = served.url("out", user) if place is None else place
    return batch_of(out, report=report).run(jobs_of([served.url("logs", user)], out))


def _ends(ended: Batched) -> dict[str, JobStatus]:
    return {record.job.name: record.status for record in ended.records}


def test_keys_of_any_spelling_are_read_as_themselves(served: Served, tmp_path: Path) -> None:
    store = open_store(served.url("logs"))
    for key in ODD:
        store.write(f"r 1/{key}", key.encode())
    found = list_urls(served.url("logs"))
    assert sorted(name for _, name in found) == sorted(f"r 1/{key}" for key in ODD)
    for number, (url, name) in enumerate(found):
        assert f"r 1/{fetched(url, tmp_path / str(number)).path.read_text()}" == name
    by_hand = served.url("logs/r 1/ü µ.csv")  # what no URL may hold needs no encoding by hand
    assert fetched(by_hand, tmp_path / "by hand").path.read_text() == "ü µ.csv"


def test_a_hash_sign_in_a_url_is_refused_and_no_host_is_asked(served: Served) -> None:
    """It would cut off the query, and with it the endpoint that the credentials are for."""
    for text in (served.url("logs/a#b.csv", USER), served.url("logs#", USER)):
        with pytest.raises(OutputError, match="write %23") as refused:
            connect(text)
        assert KEY not in str(refused.value)
    assert served.asked == []


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        (f"s3://{USER}lab/a@b.csv?region=x", "s3://lab/a@b.csv?region=x"),
        ("'s3://KEY:half/slash@lab/a' is no URL", "'s3://lab/a' is no URL"),
        ("s3://KEY@lab/a and gs://anonymous@lab/b", "s3://lab/a and gs://lab/b"),
        (
            "az://box:PASSWORD@account.dfs.core.windows.net/a",
            "az://box@account.dfs.core.windows.net/a",
        ),
        (
            "az://account/box/a?client_secret=SECRET&tenant_id=4",
            "az://account/box/a?client_secret=&tenant_id=4",
        ),
        ("s3://lab/a@b.csv, folder/a@b.csv", "s3://lab/a@b.csv, folder/a@b.csv"),
    ],
)
def test_credentials_are_left_out_of_every_message(text: str, kept: str) -> None:
    assert without_credentials(text) == kept
    assert str(AlgidError(text)) == kept


def test_credentials_in_a_url_open_everything_below_it_and_are_kept_nowhere(
    served: Served, log: bytes
) -> None:
    store = open_store(served.url("logs"))
    store.write("r1/a.csv", log)
    store.write("bad.csv", b"junk")
    served.asked.clear()
    assert _ends(_run(served, user=USER, report=True)) == {
        "bad": JobStatus.FAILED,
        "r1/a": JobStatus.OK,
    }
    assert {f"Credential={KEY}/" in authorization for _, _, authorization in served.asked} == {True}
    out = open_store(served.url("out"))
    names = [*out.names(""), ".jobs/bad.json", ".jobs/r1/a.json"]
    assert "r1/a.algid/report.html" in names
    text = json.dumps(
        pl.read_parquet(io.BytesIO(out.read("jobs.parquet") or b"")).to_dicts(), default=str
    )
    for content in (text, *((out.read(name) or b"").decode("latin-1") for name in names)):
        assert KEY not in content
        assert SECRET not in content
    # who may read it is no part of what it is
    assert _run(served, user="OTHER:KEYS@", report=True).ran == 0


@pytest.mark.parametrize(("source", "code"), [("logs", 1), ("empty", 2)])
def test_credentials_are_not_printed(served: Served, source: str, code: int) -> None:
    open_store(served.url("logs")).write("bad.csv", b"junk")
    urls = served.url(source, USER), "-o", served.url("out", USER)
    done = Outcome("batch", *urls, "--workers", "1")
    assert done.code == code, done.err
    for word in ("Traceback", KEY, SECRET):
        assert word not in done.out + done.err


def test_a_bucket_that_is_not_there_is_told(served: Served) -> None:
    absent = f"s3://no-such-lab/logs{served.query}"
    for ask in (lambda: jobs_of([absent], "out"), lambda: _run(served, absent)):
        with pytest.raises(OutputError, match="no-such-lab/logs: there is no such bucket"):
            ask()


@pytest.mark.parametrize("method", ["HEAD", "GET"])
def test_an_object_that_may_not_be_read_fails_alone(
    served: Served, log: bytes, method: str
) -> None:
    for name in ("a", "b", "c"):
        open_store(served.url("logs")).write(f"{name}.csv", log)
    served.denied = lambda asked, path: path.endswith("/b.csv") and asked in ("GET", method)
    ended = _run(served)
    assert _ends(ended) == {"a": JobStatus.OK, "b": JobStatus.FAILED, "c": JobStatus.OK}
    assert "it cannot be read" in ended.records[1].reason
    assert "ACCESS_DENIED" in ended.records[1].reason
    served.denied = lambda _method, _path: False
    assert (_run(served).ran, _ends(_run(served))["b"]) == (
        (1, JobStatus.OK) if method == "HEAD" else (0, JobStatus.FAILED)
    )


def test_a_result_that_may_not_be_written_says_so(served: Served, log: bytes) -> None:
    for name in ("a", "b"):
        open_store(served.url("logs")).write(f"{name}.csv", log)
    served.denied = lambda method, path: method in ("PUT", "POST") and "a.algid" in path
    ended = _run(served)
    assert _ends(ended) == {"a": JobStatus.FAILED, "b": JobStatus.OK}
    assert "cannot write there" in ended.records[0].reason
    assert "ACCESS_DENIED" in ended.records[0].reason
    served.denied = lambda method, path: method in ("PUT", "POST") and ".jobs" in path
    open_store(served.url("logs")).write("c.csv", log)
    ended = _run(served)
    assert ended.left == 1
    assert "ACCESS_DENIED" in str(ended.stopped)
    assert "room" not in str(ended.stopped)


@pytest.mark.parametrize("place", ["", "logs/r 1/out"])
def test_what_a_batch_wrote_below_its_source_is_no_log(
    served: Served, log: bytes, place: str
) -> None:
    open_store(served.url("logs")).write("r 1/a.csv", log)
    open_store(served.url("logs")).write("jobs.parquet", b"a log of that name")
    out = served.url(place)
    for _ in range(2):
        jobs = jobs_of([served.url("")], out)
        assert [job.name for job in jobs] == ["logs/jobs", "logs/r 1/a"]
        batch_of(out, report=True).run(jobs)


def _folder(place: Path, *names: str) -> Path:
    for name in names:
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(f"{place.name} {name}")
    return place


def test_a_new_result_leaves_nothing_of_the_old_one(served: Served, tmp_path: Path) -> None:
    store = open_store(served.url("out"))
    put_folder(
        store,
        "a.algid",
        _folder(tmp_path / "old", "result.json", "report.html", "figures/one.parquet"),
    )
    new = _folder(tmp_path / "new", "result.json", "report.md")
    served.denied = lambda method, path: method != "DELETE" and path.endswith("report.md")
    with pytest.raises(OutputError, match=r"/out/a\.algid: cannot write there"):
        put_folder(store, "a.algid", new)
    served.denied = lambda _method, _path: False
    assert not store.exists("a.algid/result.json")  # it would vouch for what is no longer its own
    put_folder(store, "a.algid", _folder(new, "result.json"))
    assert store.names("a.algid") == ["a.algid/report.md", "a.algid/result.json"]
    assert store.read("a.algid/result.json") == b"new result.json"
    put_folder(store, "a.algid", _folder(tmp_path / "alone", "result.json"))
    assert store.names("a.algid") == ["a.algid/result.json"]


@pytest.mark.parametrize("kind", ["folder", "objects"])
def test_a_log_that_fails_once_changed_or_for_its_settings_keeps_no_result(
    served: Served, log: bytes, tmp_path: Path, kind: str
) -> None:
    place = served.url("out") if kind == "objects" else str(tmp_path / "out")
    logs = open_store(served.url("logs"))
    for name in ("a", "b", "c"):
        logs.write(f"{name}.csv", log)
    _run(served, place)
    logs.write("a.csv", b"junk")
    first, *rest = jobs_of([served.url("logs")], place)
    jobs = [first, replace(rest[0], trouble="no such profile"), rest[1]]
    assert [one.status.value for one in batch_of(place).run(jobs).records] == [
        "failed",
        "failed",
        "ok",
    ]
    kept = [name for name in open_store(place).names("") if ".algid/" in name]
    assert kept == ["c.algid/result.json"]


def _replacing(served: Served, key: str, content: bytes, at: int) -> Callable[[str], None]:
    """Replaces an object once its `at`-th GET is answered."""
    answered = 0

    def after(path: str) -> None:
        nonlocal answered
        answered += path.endswith(key)
        if answered == at:
            served.after = lambda _path: None
            served.replace(f"logs/{key}", content)

    return after


@pytest.mark.parametrize("at", [1, 2, 3])
@pytest.mark.parametrize("kind", ["as long", "shorter"])
def test_an_object_replaced_while_it_is_read_fails(
    served: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, at: int
) -> None:
    """Whatever was fetched by then: its ends, the summary, a part of the whole."""
    monkeypatch.setattr("algid.batches.job._PIECE", 1 << 17)
    arrays = np.random.default_rng(0).normal(size=(2, 40000, 2)).astype("<f8")
    first, second = (one.tobytes() for one in arrays)
    open_store(served.url("logs")).write("a.csv", first)
    served.after = _replacing(served, "a.csv", second if kind == "as long" else second[:100], at)
    with pytest.raises(
        LogError, match=r"logs/a\.csv.*: it was replaced while it was read; run again"
    ):
        fetched(served.url("logs/a.csv"), tmp_path)
