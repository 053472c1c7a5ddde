"""`algid report` of a batch as its users call it, on what `algid batch` writes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from click.testing import CliRunner
from scipy.stats import norm, t

from algid.base.errors import ResultError
from algid.base.stores import open_store
from algid.batches.discover import jobs_of
from algid.batches.records import JobRecord, JobStatus, stat_of
from algid.batches.run import Batch, BatchConfig
from algid.fleet.figures import overview
from algid.fleet.history import history_of
from algid.fleet.page import fleet_document, verdict
from algid.fleet.tables import change_table, finding_table, robot_table
from algid.settings import Settings
from tests.cli.commands import app
from tests.report.pages import Page, named, typed
from tests.terminals import shown

START = 1_700_000_000 * 10**9
DAY = 86_400 * 10**9
StoredRecords = tuple[str, int, dict[str, tuple[float, float, str]]]
"""Robot, first stamp in ns and estimates of a job."""


class Finished(Executor):
    """Ends every job at once, with what is known of it."""

    def __init__(self, known: Mapping[str, StoredRecords]) -> None:
        self.known = known

    def submit(self, _fn: Callable[..., Any], /, *args: Any, **_more: Any) -> Future[Any]:
        future: Future[Any] = Future()
        (task,) = args
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
    recipe = BatchConfig(str(folder), Settings(), lambda _file: None)
    ended = Batch(open_store(str(folder)), recipe, Finished(known), 1, lambda _: None).run(jobs)
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
    assert "2 robots, 20 logs: 1 drift and 1 finding" in done.stdout
    assert "payload unlike its label" in done.stdout
    assert "1 log stands out: r0/0 (m_p, 400 σ)" in " ".join(done.stdout.split())
    assert "wrote" in done.stderr
    assert {path.name for path in (tmp_path / "page").iterdir()} == {
        "fleet.parquet",
        "findings.parquet",
        "fleet.html",
    }
    assert pl.read_parquet(tmp_path / "page/fleet.parquet").height == 4


def test_json_holds_what_was_found(tmp_path: Path) -> None:
    _batch(tmp_path)
    content = json.loads(
        CliRunner().invoke(app, ["report", str(tmp_path), "--format", "json"]).stdout
    )
    assert [(row["robot"], row["logs"], row["tested"]) for row in content["robots"]] == [
        ("r0", 10, True),
        ("r1", 10, True),
    ]
    assert [(row["robot"], row["parameter"]) for row in content["drifts"]] == [("r0", "k6")]
    assert [(row["job"], row["kind"], row["expected"]) for row in content["findings"]] == [
        ("r0/0", "payload", 0.5)
    ]
    assert content["untested"] == []


def test_logs_whose_stamps_have_no_date_still_show_their_robots(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["report", str(_batch(tmp_path, robots=1, logs=2, start_ns=0))])
    assert done.exit_code == 0, done.output
    assert "No drift was looked for in 2 logs without a date" in " ".join(done.stdout.split())
    assert "1 robot, 2 logs: 0 drifts and 1 finding" in done.stdout
    assert "not tested" in done.stdout


def test_the_tables_have_their_columns_and_their_notes(tmp_path: Path) -> None:
    _batch(tmp_path)
    history = history_of(tmp_path / "jobs.parquet")
    assert robot_table(history).columns.keys().isdisjoint({"Changed"})  # no robot did
    first, second = robot_table(history).rows
    assert first == ("r0", "10", "k6", "1", "2023-11-14", "2023-11-23")
    assert second[2:4] == ("none", "0")
    (drift,) = change_table(history).rows
    row = history.drifts.row(0, named=True)
    slope, std = (100 * row[name] / row["mean"] for name in ("slope", "slope_std"))
    half = t.ppf(0.975, 10 - 2) * std  # ten logs, a mean and a slope
    assert drift == (
        "r0", "k6", "drift", f"{slope:+.3g} ± {half:.1f}", "% a month", "2023-11-23",
    )  # fmt: skip
    assert "A drift is a slope over 3 months with p < 9e-4" in change_table(history).note
    (finding,) = finding_table(history).rows
    assert finding == (
        "r0/0", "m_p", "+400.0", "0.90000", "0.50000", "payload unlike its label", "r0",
    )  # fmt: skip
    assert finding_table(history).note == "1 found."


def test_a_trend_is_told_in_percent_of_a_mean_that_is_not_zero(tmp_path: Path) -> None:
    known: dict[str, StoredRecords] = {}
    for number in range(20):
        # k4 grows through zero and is the clearest; its mean is none to be a percentage of
        estimates = {
            "k1": (1.0 + 0.002 * number, 0.01, "OK"),
            "k4": (0.1 * (number - 9), 0.01, "OK"),
        }
        known[f"r/{number}"] = "r", START + number * DAY, estimates
    _written(tmp_path, known)
    history = history_of(tmp_path / "jobs.parquet")
    zeroed = replace(
        history,
        windows=history.windows.with_columns(
            mean=pl.when(pl.col("parameter") == "k4").then(0.0).otherwise(pl.col("mean"))
        ),
    )
    assert "the clearest trend is k4 of r" in verdict(history).sentence
    # 0.002 a day, 30.4 days a month
    assert "the clearest trend is k1 of r, +6" in verdict(zeroed).sentence


def test_every_log_is_a_point_with_its_interval(tmp_path: Path) -> None:
    _batch(tmp_path)
    history = history_of(tmp_path / "jobs.parquet")
    assert history.jobs is not None
    jobs = history.jobs.filter(pl.col("robot") == "r0")
    plot = overview(history)
    assert plot is not None
    assert plot.title == "What was found, log by log"
    assert [one["text"] for one in plot.figure.layout["annotations"]] == [
        "<b>r0: k6, N m s/rad</b>"
    ]
    (points,), (mean,), (drift,) = (
        named(plot.figure.data, name) for name in ("log", "mean", "drift")
    )
    assert typed(points["x"]) == pytest.approx(jobs["time"].dt.epoch("ms").to_list(), rel=1e-9)
    assert typed(points["y"]) == pytest.approx(jobs["k6"].to_list(), rel=1e-6)
    half = norm.ppf(0.975) * jobs["k6_std"]
    assert points["error_y"]["array"] == pytest.approx(half.to_list(), rel=1e-6)
    assert plot.figure.layout["xaxis"]["type"] == "date"
    windows = history.windows.filter((pl.col("robot") == "r0") & (pl.col("parameter") == "k6"))
    assert typed(mean["y"]) == pytest.approx(windows["mean"].to_list(), rel=1e-6)
    assert typed(drift["y"]) == pytest.approx(windows.filter("drift")["mean"].to_list(), rel=1e-6)
    assert drift["marker"]["symbol"] != points["marker"]["symbol"]


def test_an_outlier_has_a_ring(tmp_path: Path) -> None:
    known: dict[str, StoredRecords] = {}
    for number in range(20):
        k1 = 1.0 + 0.001 * ((7 * number) % 5 - 2) + 0.5 * (number == 12)
        known[f"r/{number}"] = "r", START + number * DAY, {"k1": (k1, 0.01, "OK")}
    _written(tmp_path, known)
    plot = overview(history_of(tmp_path / "jobs.parquet"))
    assert plot is not None
    (ring,) = named(plot.figure.data, "outlier")
    assert typed(ring["y"]) == pytest.approx([1.502])
    assert ring["marker"]["symbol"] == "circle-open"


def test_what_is_no_batch_is_refused(tmp_path: Path) -> None:
    pl.DataFrame({"a": [1]}).write_parquet(tmp_path / "jobs.parquet")
    done = CliRunner().invoke(app, ["report", str(tmp_path)])
    assert isinstance(done.exception, ResultError)
    assert "no column job, robot, status, time; expected jobs.parquet of algid batch" in str(
        done.exception
    )
    _written(tmp_path, {})
    with pytest.raises(ResultError, match="no job has given parameters"):
        CliRunner().invoke(app, ["report", str(tmp_path)], catch_exceptions=False)


def test_the_page_is_three_tables_and_a_figure_and_leads_to_reports(tmp_path: Path) -> None:
    batch = _batch(tmp_path / "batch")
    for job in ("r0/9", "r0/0", "r1/3"):
        (batch / f"{job}.algid").mkdir(parents=True)
        (batch / f"{job}.algid/report.html").write_text("a report")
    done = CliRunner().invoke(app, ["report", str(batch), "-o", str(tmp_path / "page")])
    assert done.exit_code == 0, done.output
    page = Page((tmp_path / "page/fleet.html").read_text(encoding="utf-8"))
    assert list(page.tables) == ["Drift and steps", "Logs that stand out", "Robots"]
    assert list(page.figures) == ["logs"]
    links = re.findall(r'href="(\./[^"]+)">([^<]*)<', page.text)
    assert [name for _, name in links] == ["r0/0", "r0"]  # a finding, and a robot's latest log
    assert all((tmp_path / "page" / link).is_file() for link, _ in links)


def test_a_fleet_that_stays_as_it_is_says_so_and_shows_it(tmp_path: Path) -> None:
    known: dict[str, StoredRecords] = {}
    for robot in range(2):
        for number in range(20):
            k1 = 1.0 + 0.001 * ((7 * number) % 5 - 2)
            known[f"r{robot}/{number}"] = (
                f"r{robot}",
                START + number * DAY,
                {"k1": (k1, 0.01, "OK")},
            )
    _written(tmp_path, known)
    done = CliRunner().invoke(app, ["report", str(tmp_path)])
    told = " ".join(done.stdout.split())
    assert "Good: 2 robots, 40 logs: 0 drifts and 0 findings; the clearest trend is k1 of r" in told
    assert "which does not pass p < 9e-4" in told
    history = history_of(tmp_path / "jobs.parquet")
    plot = overview(history)
    assert plot is not None
    assert plot.title == "The clearest trends, which are no drift"
    assert {one["name"] for one in plot.figure.data} == {"log", "mean"}


def test_a_name_that_attacks_leads_nowhere(tmp_path: Path) -> None:
    _written(tmp_path, {"javascript:alert(1)": ("<b>r</b>", START, {"k1": (1.0, 0.01, "OK")})})
    (tmp_path / "javascript:alert(1).algid").mkdir()
    (tmp_path / "javascript:alert(1).algid/report.html").write_text("a report")
    assert CliRunner().invoke(app, ["report", str(tmp_path)]).exit_code == 0
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert 'href="./javascript%3Aalert%281%29.algid/report.html"' in page
    assert "<b>r</b>" not in page


@pytest.mark.parametrize("robots", [1, 3])
def test_a_fleet_fits_a_terminal_of_eighty_columns(robots: int, tmp_path: Path) -> None:
    lines = shown(fleet_document(history_of(_batch(tmp_path, robots) / "jobs.parquet")))
    assert len(lines) <= 25 + robots
