"""`algid report` of a batch as its users call it, on a table as `algid batch` writes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest
from scipy.stats import norm

from algid.batches.jobs import Job, JobRecord, JobStatus, jobs_frame
from algid.fleet.history import history_of
from algid.fleet.page import overview
from tests.cli.commands import call
from tests.report.pages import Page, named, typed

START = 1_700_000_000 * 10**9
DAY = 86_400 * 10**9
Known = tuple[str, int, dict[str, tuple[float, float, str]]]
"""Robot, first stamp in ns and estimates of a job."""


def written(folder: Path, known: Mapping[str, Known]) -> Path:
    """The table of a batch of such jobs, whose payload is labelled 0.5 kg."""
    records = []
    for name, (robot, start_ns, estimates) in known.items():
        job = Job(name, robot=robot, labels={"payload": 0.5})
        record = JobRecord(job, JobStatus.OK, "", "", (), {}, "")
        records.append(replace(record, start_ns=start_ns, estimates=estimates))
    folder.mkdir(exist_ok=True)
    jobs_frame(records).write_parquet(folder / "jobs.parquet")
    return folder


def batch(folder: Path) -> Path:
    """A batch whose first robot's k6 doubles within its ten logs, one a day."""
    known: dict[str, Known] = {}
    for day in range(10):
        for robot, k6, m_p in (("r0", 1 + day / 10, 0.5 if day else 0.9), ("r1", 1.0, 0.5)):
            numbers = {"k1": (1.0, 0.01, "OK"), "k6": (k6, 0.01, "OK"), "m_p": (m_p, 0.001, "OK")}
            known[f"{robot}/{day}"] = robot, START + day * DAY, numbers
    return written(folder, known)


def test_drift_and_findings_are_printed_and_written(tmp_path: Path) -> None:
    done = call("report", batch(tmp_path), "-o", tmp_path / "page")
    assert done.code == 0, done
    assert "2 robots, 20 logs: 1 drift and 1 payload" in done.out
    assert "1 payload unlike the label: m_p of r0/0" in " ".join(done.out.split())
    written = sorted((tmp_path / "page").iterdir())
    assert [one.name for one in written] == ["findings.parquet", "fleet.html", "fleet.parquet"]
    assert sorted(done.err.splitlines()) == [f"wrote {one}" for one in written]
    assert pl.read_parquet(tmp_path / "page/fleet.parquet").height == 4
    page = Page((tmp_path / "page/fleet.html").read_text(encoding="utf-8"))
    assert (list(page.tables), list(page.figures)) == (["Findings", "Robots"], ["logs"])


def test_every_log_is_a_point_with_its_interval(tmp_path: Path) -> None:
    batch(tmp_path)
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
    windows = history.windows.filter(robot="r0", parameter="k6")
    assert typed(mean["y"]) == pytest.approx(windows["mean"].to_list(), rel=1e-6)
    assert typed(found["y"]) == pytest.approx([jobs["k6"][0]], rel=1e-6)  # a drift ends there


def test_a_name_that_attacks_is_text(tmp_path: Path) -> None:
    written(tmp_path, {"javascript:alert(1)": ("<b>r</b>", START, {"k1": (1.0, 0.01, "OK")})})
    assert call("report", tmp_path).code == 0
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert 'href="javascript' not in page
    assert "<b>r</b>" not in page
