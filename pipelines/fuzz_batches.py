"""Batches over hostile records, manifests and folders: a source of `pipelines.fuzz`.

Jobs end at once here, as failed or with an empty result: it is what a batch makes of its folders
that is tried. It ends with a row a job and a record a row, and the next run has nothing left to
do; or it is refused in one line.
"""

from __future__ import annotations

import os
import random
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl

from algid.base.errors import AlgidError
from algid.base.files import refuse_links, whole_folder
from algid.base.stores import open_store
from algid.batches.discover import jobs_of
from algid.batches.job import Task
from algid.batches.jobs import JobStatus, stat_of
from algid.batches.run import Batch, sweep
from algid.settings import Settings
from pipelines.hostile.batches import furnish_output, grow, manifest, record


class AtOnce:
    """Ends every job at once: one of two with an empty result, the others as failed."""

    def __init__(self) -> None:
        self.ran = 0

    def submit(self, _fn: Callable[..., Any], task: Task) -> Future[Any]:
        """Run a task."""
        self.ran += 1
        status = JobStatus.OK if len(task.job.name) % 2 else JobStatus.FAILED
        future: Future[Any] = Future()
        try:
            refuse_links(Path(task.out), task.job.name)  # as `run_task` does
            if status is JobStatus.OK:
                with whole_folder(Path(task.out, f"{task.job.name}.algid"), force=True) as folder:
                    (folder / "result.json").touch()
            inputs = tuple(
                replace(stat_of(path), sha256="c") for path in (*task.job.logs, *task.job.loaded)
            )
            future.set_result(task.record(status, "as asked", inputs=inputs))
        except AlgidError as error:
            future.set_result(task.record(JobStatus.FAILED, str(error)))
        return future


def batches(folder: Path, seeds: range) -> Iterator[Callable[[], tuple[str, str]]]:
    """Batches over hostile folders, records and manifests."""
    for seed in seeds:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            yield partial(outcome, Path(place), random.Random(seed))


def outcome(place: Path, draw: random.Random) -> tuple[str, str]:
    """What came of a case, and more of it."""
    logs, out, guarded = place / "logs", place / "out", place / "guarded"
    guarded.mkdir()
    (guarded / ".a.algid.algid-0123abcd").mkdir()
    grow(draw, logs)
    furnish_output(draw, out)
    source = manifest(draw, logs) if draw.random() < 0.4 else logs
    if draw.random() < 0.4:
        (out / ".jobs/r1").mkdir(parents=True, exist_ok=True)
        (out / ".jobs/r1/a.json").unlink(missing_ok=True)
        (out / ".jobs/r1/a.json").write_bytes(record(draw))
    if draw.random() < 0.1 and not (out / "r1").exists():
        out.mkdir(exist_ok=True)
        (out / "r1").symlink_to(guarded)
    try:
        jobs = jobs_of([str(source)], str(out))
        first = _run(jobs, out, AtOnce())
    except AlgidError as error:
        return ("refused", "") if "\n" not in str(error) else ("lines", str(error))
    if first[1] is not None:
        return "stopped", first[1]
    touched = [path.name for path in guarded.iterdir()]
    if touched != [".a.algid.algid-0123abcd"]:
        return "elsewhere", str(touched)
    missing = {job.name for job in jobs} - first[0]
    if missing or (
        source is logs
        and not _logs_below(logs) <= {path for job in jobs for path in job.logs + job.loaded}
    ):
        return "lost", str(missing)
    again = AtOnce()
    if _run(jobs, out, again)[0] != first[0] or again.ran:
        return "again", f"{again.ran} jobs"
    left = [
        name
        for _, _, names in os.walk(out)
        for name in names
        if ".algid-" in name and name.startswith(".")
    ]
    return ("left", str(left)) if left else ("done", "")


def _run(jobs: list[Any], out: Path, executor: AtOnce) -> tuple[set[str], str | None]:
    """The jobs of the table that a batch leaves, and why it was stopped."""
    store = open_store(str(out))
    sweep(store)
    task_of = partial(Task, settings=Settings(), out=str(out))
    ended = Batch(store, task_of, executor.submit, 1, lambda *_: None).run(jobs)
    if ended.stopped is not None:
        return set(), ended.stopped
    return set(pl.read_parquet(out / "jobs.parquet")["job"]), None


def _logs_below(folder: Path) -> set[str]:
    """Logs below a folder, as another program finds them."""
    endings = " -o ".join(
        f"-name {name}" for name in ["*.csv", "*.mcap", "*.parquet", "*.csv.gz", "*.CSV"]
    )
    found = subprocess.run(
        ["find", f"{folder}/", "-mindepth", "1"]
        + f"( -name .* -o -type d -name *.algid ) -prune -o -type f ( {endings} ) -print0".split(),
        capture_output=True,
        check=True,
    ).stdout.split(b"\0")
    paths = (os.fsdecode(path).replace("//", "/", 1) for path in found if path)
    return {path for path in paths if not _in_bag(Path(path), folder)}


def _in_bag(path: Path, folder: Path) -> bool:
    return any(
        (one / "metadata.yaml").is_file()
        for one in path.parents
        if one != folder and one.is_relative_to(folder)
    )
