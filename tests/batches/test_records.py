"""Records are anybody's: whatever stands below ``.jobs``, a batch ends, and its table is right."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from algid.base.errors import OutputError
from algid.base.stores import open_store
from algid.batches.discover import jobs_of
from algid.batches.jobs import (
    Input,
    Job,
    JobRecord,
    JobStatus,
    read_records,
    write_record,
)
from algid.batches.run import Batched, locked, sweep
from algid.batches.workers import CallFailedError
from tests.batches.test_run import Here, batch_of


def _fail(_name: str) -> None:
    raise CallFailedError("as asked")


def _run(logs: Path, out: Path, here: Here | None = None) -> Batched:
    return batch_of(out, here or Here(_fail)).run(jobs_of([str(logs)], str(out)))


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    (tmp_path / "logs").mkdir()
    for name in ("a", "b"):
        (tmp_path / f"logs/{name}.csv").write_text("no log")
    return tmp_path / "logs"


def _sound() -> dict[str, Any]:
    job = Job(
        "other",
        ("x.csv",),
        robot="r",
        time="2026-01-31T12:00:00+01:00",
        labels={"payload": 0.5, "site": "Ulm"},
    )
    estimates = {"k1": (1.0, 0.1, "OK"), "k5+k3+z1": (None, None, "WEAK_EXCITATION")}
    record = JobRecord(
        job, JobStatus.OK, "", "b", (Input("x.csv", 1, 2),), {"a": [1]}, "0.1", estimates=estimates
    )
    return asdict(record)


WRONG: dict[str, Any] = {
    "a name of another type": lambda r: r["job"].update(name=5),
    "another job's": lambda r: r["job"].update(name="a"),
    "a time in year 1": lambda r: r["job"].update(time="0001-01-01T00:00:00+23:59"),
    "an estimate that is infinite": lambda r: r.update(estimates={"k1": [float("inf"), 2.0, "OK"]}),
    "half a letter": lambda r: r.update(reason="\ud800"),
}


@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_a_record_that_is_none_counts_as_none_and_is_told(
    logs: Path, change: Callable[[Any], Any]
) -> None:
    out = logs.parent / "out"
    record = _sound()
    (out / ".jobs").mkdir(parents=True)
    (out / ".jobs/other.json").write_text(
        json.dumps(record if (changed := change(record)) is None else changed),
        encoding="utf-8",
        errors="surrogatepass",
    )
    batch = batch_of(out, Here(_fail))
    assert list(batch.unreadable) == [".jobs/other.json"]
    assert "\n" not in batch.unreadable[".jobs/other.json"]
    assert len(batch.run(jobs_of([str(logs)], str(out))).records) == 2
    assert pl.read_parquet(out / "jobs.parquet")["job"].to_list() == ["a", "b"]


def test_records_of_other_versions_keep_their_rows(logs: Path) -> None:
    out = logs.parent / "out"
    older, newer = _sound(), _sound()
    del older["job"]["trouble"], older["start_ns"]
    older["inputs"][0]["ctime_ns"] = 5
    newer["job"] |= {"name": "newer", "time": None}
    newer["start_ns"] = 1_769_857_200 * 10**9
    newer |= {"colour": "red", "version": "99"}
    newer["job"]["mood"] = 1
    (out / ".jobs").mkdir(parents=True)
    for name, record in (("other", older), ("newer", newer)):
        (out / f".jobs/{name}.json").write_text(json.dumps(record))
    _run(logs, out)
    table = pl.read_parquet(out / "jobs.parquet")
    assert table["job"].to_list() == ["a", "b", "newer", "other"]
    assert table["label_site"].to_list() == [None, None, "Ulm", "Ulm"]
    assert table["label_payload"].to_list() == [None, None, 0.5, 0.5]
    assert [str(time) for time in table["time"]][2:] == ["2026-01-31 11:00:00+00:00"] * 2


@pytest.mark.parametrize("kind", ["link", "pipe", "deep", "loop", "unreadable"])
def test_what_else_lies_among_the_records_does_no_harm(logs: Path, kind: str) -> None:
    out = logs.parent / "out"
    (out / ".jobs").mkdir(parents=True)
    place = out / ".jobs/c.json"
    if kind == "link":
        place.symlink_to("/dev/zero")
    elif kind == "pipe":
        os.mkfifo(place)
    elif kind == "deep":
        (out / ".jobs" / "/".join(["d"] * 900)).mkdir(parents=True)
    elif kind == "loop":
        (out / ".jobs/x").symlink_to(out / ".jobs")
    else:
        place.mkdir()
    _run(logs, out)
    sweep(open_store(str(out)))
    assert pl.read_parquet(out / "jobs.parquet")["job"].to_list() == ["a", "b"]


def test_no_job_takes_another_ones_place(tmp_path: Path) -> None:
    store, written = open_store(str(tmp_path)), dict[str, JobRecord]()
    for name in ("x", "x.json", "é/x", "x.jobs/y"):
        written[name] = JobRecord(Job(name, ("x.csv",)), JobStatus.OK, name, "b", (), {}, "0.1")
        write_record(store, written[name])
    assert read_records(store) == (written, {})


def test_a_link_in_the_output_is_not_followed(logs: Path) -> None:
    out, elsewhere = logs.parent / "out", logs.parent / "elsewhere"
    for place in (out, elsewhere, logs / "r1"):
        place.mkdir()
    (elsewhere / ".c.algid.algid-0123abcd").mkdir()
    shutil.copy(logs / "a.csv", logs / "r1/c.csv")
    (out / "r1").symlink_to(elsewhere)

    sweep(open_store(str(out)))
    reasons = {record.job.name: record.reason for record in _run(logs, out, Here()).records}
    assert (
        reasons["r1/c"]
        == f"{out}/r1: a link, which is not followed; make it a folder, or choose another one "
        "with -o"
    )
    assert "no rows below it" in reasons["a"]
    assert [path.name for path in elsewhere.iterdir()] == [".c.algid.algid-0123abcd"]


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("link", r"/out/\.jobs: a link, which is not followed"),
        ("file", r"/out: cannot write there \("),
    ],
)
def test_an_output_where_no_record_can_be_kept_is_refused_before_any_work(
    logs: Path, kind: str, told: str
) -> None:
    out = logs.parent / "out"
    out.mkdir()
    if kind == "link":
        (out / ".jobs").symlink_to(logs)
    else:
        (out / ".jobs").touch()
    with pytest.raises(OutputError, match=told), locked(str(out)):
        pass


def test_the_table_is_written_for_changes_alone_and_touched_logs_run_again(logs: Path) -> None:
    out = logs.parent / "out"
    batch, jobs = batch_of(out, Here(_fail)), jobs_of([str(logs)], str(out))
    batch.run(jobs)
    written = (out / "jobs.parquet").stat().st_ino
    assert batch.run(jobs).ran == 2
    assert (out / "jobs.parquet").stat().st_ino == written
    os.utime(logs / "a.csv", ns=(0, 10**18))
    assert batch.run(jobs).anew == {"of other logs": 1}
    (out / "jobs.parquet").unlink()
    assert batch.run([replace(job, labels={"site": "Ulm"}) for job in jobs]).ran == 3
    table = pl.read_parquet(out / "jobs.parquet")
    assert table["changed"].to_list()[0][0].year == 2001
    assert table["label_site"].to_list() == ["Ulm"] * 2
