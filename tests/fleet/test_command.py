"""`algid fleet` as its users call it, on what `algid batch` writes."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.stats import norm
from typer.testing import CliRunner

from algid.batches.discover import jobs_of
from algid.batches.records import End, JobRecord, stat_of
from algid.batches.run import Batch, Recipe
from algid.errors import ResultError
from algid.fleet.figures import overview, robot_figure
from algid.fleet.history import history_of
from algid.fleet.page import fleet_document, verdict
from algid.fleet.tables import drift_table, finding_table, robot_table
from algid.settings import Settings
from algid.stores import open_store
from tests.cli.commands import app
from tests.terminals import shown

TABLES = (robot_table, drift_table, finding_table)


START = 1_700_000_000 * 10**9
DAY = 86_400 * 10**9
Known = tuple[str, int, dict[str, tuple[float, float, str]]]
"""Robot, first stamp in ns and estimates of a job."""


class Finished(Executor):
    """Ends every job at once, with what is known of it."""

    def __init__(self, known: Mapping[str, Known]) -> None:
        self.known = known

    def submit(self, _fn: Callable[..., Any], /, *args: Any, **_more: Any) -> Future[Any]:
        future: Future[Any] = Future()
        (task,) = args
        _, start_ns, estimates = self.known[task.job.name]
        inputs = tuple(map(stat_of, task.job.logs))
        future.set_result(
            JobRecord(
                task.job, End.OK, "", task.basis, inputs, {}, "", 1.0, start_ns, 10.0, "refined",
                estimates,
            )
        )  # fmt: skip
        return future


def _written(folder: Path, known: Mapping[str, Known]) -> Path:
    """A batch of such jobs, whose payload is labelled 0.5 kg."""
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_text("no log")
    lines = ["name,logs,robot,payload"]
    for name, (robot, _, _) in known.items():
        lines.append(f"{name},a.csv,{robot},0.5")
    (folder / "manifest.csv").write_text("\n".join(lines))
    jobs = jobs_of([str(folder / "manifest.csv")], str(folder))
    recipe = Recipe(str(folder), Settings(), lambda _file: None)
    ended = Batch(open_store(str(folder)), recipe, Finished(known), 1, lambda _: None).run(jobs)
    assert [record.status for record in ended.records] == [End.OK] * len(known)
    return folder


def _batch(folder: Path, robots: int = 2, logs: int = 10, start_ns: int = START) -> Path:
    """A batch whose first robot's k6 doubles within its logs, one a day."""
    known: dict[str, Known] = {}
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
    done = CliRunner().invoke(app, ["fleet", str(_batch(tmp_path)), "-o", str(tmp_path / "page")])
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


def test_json_and_markdown_say_the_same(tmp_path: Path) -> None:
    _batch(tmp_path)
    content = json.loads(
        CliRunner().invoke(app, ["fleet", str(tmp_path), "--format", "json"]).stdout
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
    text = CliRunner().invoke(app, ["fleet", str(tmp_path), "--format", "markdown"]).stdout
    assert "| r0 | k6 |" in text
    assert "2 robots, 20 logs: 1 drift and 1 finding" in text


def test_logs_whose_stamps_have_no_date_still_show_their_robots(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["fleet", str(_batch(tmp_path, robots=1, logs=2, start_ns=0))])
    assert done.exit_code == 0, done.output
    assert "No drift was looked for in 2 logs without a date" in " ".join(done.stdout.split())
    assert "1 robot, 2 logs: 0 drifts and 1 finding" in done.stdout
    assert "not tested" in done.stdout


def test_the_tables_have_their_columns_and_their_notes(tmp_path: Path) -> None:
    _batch(tmp_path)
    history = history_of(tmp_path / "jobs.parquet")
    heads = [" | ".join(column.heading for column in table(history).columns) for table in TABLES]
    assert heads == [
        "Robot | Logs | From | To | Drift | Stand out",
        "Robot | Parameter | Until | Logs | Mean | Slope, % a month | 95 % interval | p",
        "Job | Robot | What | Parameter | Value | Expected | σ away",
    ]
    first, _ = robot_table(history).rows
    assert first == ("r0", "10", "2023-11-14", "2023-11-23", "k6", "1")
    (drift,) = drift_table(history).rows
    assert drift[:4] == ("r0", "k6", "2023-11-23", "10")
    assert drift_table(history).note == "1 found. A slope over 3 months is significant at p < 9e-4."
    (finding,) = finding_table(history).rows
    assert finding == (
        "r0/0",
        "r0",
        "payload unlike its label",
        "m_p",
        "0.90000",
        "0.50000",
        "+400.0",
    )
    assert finding_table(history).note == "1 found."
    # what a narrow terminal leaves out first
    ranks = [
        {column.heading: column.rank for column in table(history).columns if column.rank}
        for table in TABLES
    ]
    assert ranks == [{"From": 2, "To": 1}, {"Until": 1, "Logs": 2, "Mean": 3, "p": 4}, {"Robot": 1}]


def test_a_trend_is_told_in_percent_of_a_mean_that_is_not_zero(tmp_path: Path) -> None:
    known: dict[str, Known] = {}
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


def _typed(packed: dict[str, str]) -> Any:
    return np.frombuffer(base64.b64decode(packed["bdata"]), f"<{packed['dtype']}").astype(float)


def test_every_log_is_a_point_with_its_interval_and_leads_to_its_report(tmp_path: Path) -> None:
    _batch(tmp_path)
    history = history_of(tmp_path / "jobs.parquet")
    assert history.jobs is not None
    jobs = history.jobs.filter(pl.col("robot") == "r0")
    figure = robot_figure(history, "r0", jobs, {"r0/3": "./there.html"}, "robot-1-logs")
    panel = next(one for one in figure.panels if one.title.startswith("k6"))
    mean, drift, points = panel.traces
    assert _typed(points["x"]) == pytest.approx(jobs["time"].dt.epoch("ms").to_list(), rel=1e-12)
    assert _typed(points["y"]) == pytest.approx(jobs["k6"].to_list(), rel=1e-6)
    half = norm.ppf(0.975) * jobs["k6_std"]
    assert _typed(points["error_y"]["array"]) == pytest.approx(half.to_list(), rel=1e-4)
    assert points["text"] == jobs["job"].to_list()
    assert [place for place in points["customdata"] if place] == ["./there.html"]
    assert panel.layout["xaxis"]["type"] == "date"
    windows = history.windows.filter((pl.col("robot") == "r0") & (pl.col("parameter") == "k6"))
    assert _typed(mean["y"]) == pytest.approx(windows["mean"].to_list(), rel=1e-6)
    first, last, _ = _typed(drift["y"])
    start, end, _ = _typed(drift["x"])
    (slope,) = windows["slope"].to_list()
    assert (last - first) / ((end - start) / (86_400_000 * 30.4375)) == pytest.approx(slope)
    whole = overview(history, {})
    assert whole is not None
    assert whole.title == "Every log of every robot"  # two robots fit into one panel
    assert [entry.words for entry in whole.legend] == ["r0", "r1"]
    groups = [[trace["legendgroup"] for trace in panel.traces] for panel in whole.panels]
    assert groups == [["robot0", "robot1"], ["robot0", "robot1", "robot0"]]  # k6 of r0 drifts


def test_what_is_no_batch_is_refused(tmp_path: Path) -> None:
    pl.DataFrame({"a": [1]}).write_parquet(tmp_path / "jobs.parquet")
    done = CliRunner().invoke(app, ["fleet", str(tmp_path)])
    assert isinstance(done.exception, ResultError)
    assert "no column job, robot, status, time; expected jobs.parquet of algid batch" in str(
        done.exception
    )
    _written(tmp_path, {})
    with pytest.raises(ResultError, match="no job has given parameters"):
        CliRunner().invoke(app, ["fleet", str(tmp_path)], catch_exceptions=False)


def test_the_page_shows_every_robot_and_leads_to_its_reports(tmp_path: Path) -> None:
    batch = _batch(tmp_path / "batch")
    for job in ("r0/9", "r1/3"):
        (batch / f"{job}.algid").mkdir(parents=True)
        (batch / f"{job}.algid/report.html").write_text("a report")
    done = CliRunner().invoke(app, ["fleet", str(batch), "-o", str(tmp_path / "page")])
    assert done.exit_code == 0, done.output
    page = (tmp_path / "page/fleet.html").read_text(encoding="utf-8")
    robots = re.search(r"<caption>Robots</caption>.*?</table>", page, re.DOTALL)
    assert robots is not None
    assert '<a href="#robot-1">r0</a>' in robots[0]
    assert '<a href="./../batch/r0/9.algid/report.html">r0/9</a>' in page
    links = re.findall(r'href="(\./[^"]+)"', page)
    assert links
    assert all((tmp_path / "page" / link).is_file() for link in links)


def test_a_fleet_that_stays_as_it_is_says_so_and_shows_it(tmp_path: Path) -> None:
    known: dict[str, Known] = {}
    for robot in range(2):
        for number in range(20):
            k1 = 1.0 + 0.001 * ((7 * number) % 5 - 2)
            known[f"r{robot}/{number}"] = (
                f"r{robot}",
                START + number * DAY,
                {"k1": (k1, 0.01, "OK")},
            )
    _written(tmp_path, known)
    done = CliRunner().invoke(app, ["fleet", str(tmp_path)])
    told = " ".join(done.stdout.split())
    assert "Good: 2 robots, 40 logs: 0 drifts and 0 findings; the clearest trend is k1 of r" in told
    assert "which does not pass p < 9e-4" in told
    history = history_of(tmp_path / "jobs.parquet")
    figure = overview(history, {})
    assert figure is not None
    assert [len(panel.traces) for panel in figure.panels] == [2]  # two robots, nothing marked
    assert figure.reading == "Read: a dot is a log with its 95 % interval."


def test_a_name_that_attacks_leads_nowhere(tmp_path: Path) -> None:
    _written(tmp_path, {"javascript:alert(1)": ("<b>r</b>", START, {"k1": (1.0, 0.01, "OK")})})
    (tmp_path / "javascript:alert(1).algid").mkdir()
    (tmp_path / "javascript:alert(1).algid/report.html").write_text("a report")
    assert CliRunner().invoke(app, ["fleet", str(tmp_path)]).exit_code == 0
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert 'href="./javascript%3Aalert%281%29.algid/report.html"' in page
    assert "<b>r</b>" not in page


@pytest.mark.parametrize("robots", [1, 3])
def test_a_fleet_fits_a_terminal_of_eighty_columns(robots: int, tmp_path: Path) -> None:
    lines = shown(fleet_document(history_of(_batch(tmp_path, robots) / "jobs.parquet")))
    assert len(lines) <= 25 + robots
