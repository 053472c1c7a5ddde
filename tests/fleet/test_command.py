"""`algid report` of a batch as its users call it, on what `algid batch` writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from click.testing import CliRunner
from scipy.stats import norm

from algid.api.report import report
from algid.base.stores import open_store
from algid.batches.discover import jobs_of
from algid.batches.job import Task
from algid.batches.jobs import JobRecord, JobStatus, stat_of
from algid.batches.run import Batch
from algid.fleet.history import history_of
from algid.fleet.page import overview
from algid.settings import Settings
from tests.cli.commands import app
from tests.report.pages import Page, named, typed

START = 1_700_000_000 * 10**9
DAY = 86_400 * 10**9
StoredRecords = tuple[str, int, dict[str, tuple[float, float, str]]]
"""Robot, first stamp in ns and estimates of a job."""


class Finished:
    """Ends every job at once, with what is known of it."""

    def __init__(self, known: Mapping[str, StoredRecords]) -> None:
        self.known = known

    def submit(self, _fn: Callable[..., Any], task: Task) -> Future[Any]:
        future: Future[Any] = Future()
        _, start_ns, estimates = self.known[task.job.name]
        inputs = tuple(map(stat_of, task.job.logs))
        future.set_result(
            JobRecord(
                task.job, JobStatus.OK, "", task.basis, inputs, {}, "", 1.0, start_ns, 10.0,
                "refined",
                estimates,
            )
        )  # fmt: skip
        return future


def _written(folder: Path, known: Mapping[str, StoredRecords]) -> Path:
    """A batch of such jobs, whose payload is labelled 0.5 kg."""
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_text("no log")
    lines = ["name,logs,robot,payload"]
    for name, (robot, _, _) in known.items():
        lines.append(f"{name},a.csv,{robot},0.5")
    (folder / "manifest.csv").write_text("\n".join(lines))
    jobs = jobs_of([str(folder / "manifest.csv")], str(folder))
    task_of = partial(Task, settings=Settings(), out=str(folder))
    submit = Finished(known).submit
    ended = Batch(open_store(str(folder)), task_of, submit, 1, lambda *_: None).run(jobs)
    assert [record.status for record in ended.records] == [JobStatus.OK] * len(known)
    return folder


def _batch(folder: Path, robots: int = 2, logs: int = 10, start_ns: int = START) -> Path:
    """A batch whose first robot's k6 doubles within its logs, one a day."""
    known: dict[str, StoredRecords] = {}
    for robot in range(robots):
        for day in range(logs):
            estimates = {
                "k1": (1.0, 0.01, "OK"),
                "k6": (1.0 + (day / logs if robot == 0 else 0.0), 0.01, "OK"),
                "m_p": (0.5 if robot or day else 0.9, 0.001, "OK"),
            }
            known[f"r{robot}/{day}"] = f"r{robot}", start_ns + day * DAY, estimates
    return _written(folder, known)


def test_drift_and_findings_are_printed_and_written(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["report", str(_batch(tmp_path)), "-o", str(tmp_path / "page")])
    assert done.exit_code == 0, done.output
    assert "2 robots, 20 logs: 1 drift and 1 payload" in done.stdout
    assert "1 payload unlike the label: m_p of r0/0" in " ".join(done.stdout.split())
    written = sorted((tmp_path / "page").iterdir())
    assert [one.name for one in written] == ["findings.parquet", "fleet.html", "fleet.parquet"]
    assert sorted(done.stderr.splitlines()) == [f"wrote {one}" for one in written]
    assert pl.read_parquet(tmp_path / "page/fleet.parquet").height == 4


def test_every_log_is_a_point_with_its_interval(tmp_path: Path) -> None:
    _batch(tmp_path)
    history = history_of(tmp_path / "jobs.parquet")
    jobs = history.jobs.filter(robot="r0")
    plot = overview(history)
    assert plot is not None
    titles = [one["text"] for one in plot.layout["annotations"]]
    assert titles == ["<b>r0: k6, N m s/rad</b>", "<b>r0: m_p, kg</b>"]
    points, mean, found = (named(plot.data, name)[0] for name in ("log", "mean", "finding"))
    assert typed(points["x"]) == pytest.approx(jobs["time"].dt.epoch("ms").to_list(), rel=1e-9)
    assert typed(points["y"]) == pytest.approx(jobs["k6"].to_list(), rel=1e-6)
    half = norm.ppf(0.975) * jobs["k6_std"]
    assert points["error_y"]["array"] == pytest.approx(half.to_list(), rel=1e-6)
    assert plot.layout["xaxis"]["type"] == "date"
    windows = history.windows.filter(robot="r0", parameter="k6")
    assert typed(mean["y"]) == pytest.approx(windows["mean"].to_list(), rel=1e-6)
    assert typed(found["y"]) == pytest.approx([jobs["k6"][0]], rel=1e-6)  # a drift ends there
    assert found["marker"]["symbol"] != points["marker"]["symbol"]


def test_the_page_is_two_tables_and_a_figure(tmp_path: Path) -> None:
    batch = _batch(tmp_path / "batch[1]")
    heard = list[tuple[str, int, int]]()
    report([batch], out=tmp_path / "page", progress=lambda *step: heard.append(step))
    assert heard == [("following", 0, 2), ("following", 1, 2)]
    page = Page((tmp_path / "page/fleet.html").read_text(encoding="utf-8"))
    assert list(page.tables) == ["Findings", "Robots"]
    assert list(page.figures) == ["logs"]
    assert {"numbers", "logs", "robots"} <= {own.get("id") for _, own in page.tags}
    assert "<h1>Fleet</h1>" in page.text


def test_a_name_that_attacks_is_text(tmp_path: Path) -> None:
    _written(tmp_path, {"javascript:alert(1)": ("<b>r</b>", START, {"k1": (1.0, 0.01, "OK")})})
    assert CliRunner().invoke(app, ["report", str(tmp_path)]).exit_code == 0
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert 'href="javascript' not in page
    assert "<b>r</b>" not in page
