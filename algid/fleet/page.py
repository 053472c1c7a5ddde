"""The fleet's page: what drifts and what stands out, in tables and figures that open offline."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from algid import __version__
from algid.fleet.drift import ALPHA, SPAN
from algid.fleet.history import History
from algid.model import UNITS
from algid.notices import Notice
from algid.report.document import (
    Column,
    Depth,
    Document,
    Drawn,
    ReadingAid,
    References,
    Section,
    Table,
    filled,
)
from algid.report.drawings import Course, sparklines
from algid.report.figures.base import Figure, Panel, axis, label
from algid.report.frame import page
from algid.text import ABSENT, joined, significant, unit_text, visible
from algid.verdict import Verdict, graded
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

READING = (
    "Read: each parameter has one scale of change for all robots; the band is the 95 % interval of the mean over "
    f"{SPAN} months. Level within its band is steady, orange drifts. A robot's name leads to its latest report."
)
MOST_ROBOTS = 40  # whose table is printed
MOST_ROWS = 200
MOST_PANELS = 12


def fleet_html(history: History, reports: Mapping[str, str] | None = None) -> str:
    """The page's text; `reports` says where the report of each job is."""
    return page(fleet_document(history, reports or {}))


def fleet_document(history: History, reports: Mapping[str, str] | None = None) -> Document:
    """The report of a fleet; `reports`, which only a page has, say where the report of each job is.

    A long list of robots is left to the page.
    """
    robots = robot_table(history).at(
        Depth.TERMINAL if history.robots <= MOST_ROBOTS else Depth.PAGE
    )
    drifts, findings = drift_table(history), finding_table(history)
    figures: list[Figure] = []
    groups: dict[str, list[tuple[str, str]]] = {}
    if reports is not None:
        ends = history.roster.select("robot", "latest").iter_rows()
        latest = {visible(robot): reports[job] for robot, job in ends if job in reports}
        robots = replace(robots, drawn=tuple(_courses(history)), links=latest)
        drifts = replace(drifts, links=latest)
        findings = replace(findings, links={visible(job): place for job, place in reports.items()})
        figures = _figures(history)
        if reports and history.jobs is not None:
            for (robot,), part in history.jobs.group_by("robot", maintain_order=True):
                groups[str(robot)] = [
                    (job, reports[job]) for job in part["job"].to_list() if job in reports
                ]
    return Document(
        title="Fleet",
        verdict=verdict(history),
        sections=(
            Section((robots, ReadingAid(READING), *filled(drifts, findings), *figures)),
            Section(
                (References(groups, MOST_ROWS),) if groups else (),
                "reports",
                "Reports",
                fold="closed",
            ),
        ),
        kicker="a fleet's history",
        name="Fleet",
        facts=f"{counted(history.robots, 'robot')} · {counted(history.logs, 'log')}",
        made=f"Made by algid {__version__}.",
    )


def reports_of(history: History, batch: Path, out: Path) -> dict[str, str]:
    """Where each job's report is, as seen from `out`; jobs without one are left out."""
    if history.jobs is None:
        return {}
    found = {}
    for job in history.jobs["job"].to_list():
        page = batch / f"{job}.algid" / "report.html"
        if page.is_file():
            there = os.path.relpath(page.resolve(), out.resolve()).replace(os.sep, "/")
            found[job] = "./" + quote(there)  # a name such as javascript: leads nowhere else
    return found


def _courses(history: History) -> list[Drawn]:
    """A column of sparklines a parameter: each robot's mean over time with its 95 % band."""
    import polars as pl

    drifting = set(history.drifts.select("robot", "parameter").iter_rows())
    shown = history.roster.head(MOST_ROWS)["robot"].implode()
    columns = []
    for (parameter,), rows in history.windows.filter(pl.col("robot").is_in(shown)).group_by(
        "parameter", maintain_order=True
    ):
        own = {
            visible(robot): _course(str(parameter), part, (robot, parameter) in drifting)
            for (robot,), part in rows.group_by("robot", maintain_order=True)
        }
        columns.append(Drawn(str(parameter), sparklines(own), small=True))
    return columns


def _course(parameter: str, rows: pl.DataFrame, drifts: bool) -> Course:
    rows = rows.sort("month").drop_nulls(["mean", "mean_std"])
    t = rows["end"].dt.epoch("ms").to_numpy().astype(np.float64)
    mean, half = rows["mean"].to_numpy(), 1.96 * rows["mean_std"].to_numpy()
    ends = (
        f"{significant(mean[0])} to {significant(mean[-1])}"
        if mean.size > 1
        else "".join(map(significant, mean))
    )
    return Course(t, mean, half, f"{parameter} {ends}{', drifts' if drifts else ''}", drifts)


def verdict(history: History) -> Verdict:
    """Whether anything drifts or stands out; what could not be tested is the reason to doubt it."""
    import polars as pl

    drifts, findings = history.drifts.height, history.findings.height
    statement = f"{counted(history.robots, 'robot')}, {counted(history.logs, 'log')}: "
    statement += f"{counted(drifts, 'drift')} and {counted(findings, 'finding')}"
    tested = history.windows.filter(pl.col("p").is_not_nan() & (pl.col("mean") != 0.0))
    if tested.height:  # the clearest trend of all that were tested, whether it drifts or not
        row = tested.sort("p", "robot", "parameter").row(0, named=True)
        slope, p = 100 * row["slope"] / abs(row["mean"]), significant(row["p"], 2)
        statement += f"; the clearest trend is {row['parameter']} of {visible(row['robot'])}, {slope:+.2g} % a month"
        statement += f" (p = {p})" + (
            "" if row["drift"] else f", which does not pass p < {ALPHA:g}"
        )
    found = [Notice("DRIFTS", counted(drifts, "drift"))] * bool(drifts)
    found += [Notice("STAND_OUT", counted(findings, "log stands out", "logs stand out"))] * bool(
        findings
    )
    return graded(statement, [*found, *(Notice("NOT_TESTED", why) for why in history.untested)])


def robot_table(history: History) -> Table:
    """Every robot: its logs, their dates, and what was found of it."""
    import polars as pl

    drifting = dict(history.drifts.group_by("robot").agg(pl.col("parameter").sort()).iter_rows())
    standing_out = dict(
        history.findings.group_by("robot").agg(pl.col("job").n_unique()).iter_rows()
    )
    columns = (
        Column("Robot", "name"),
        Column("Logs", "number"),
        Column("From", "text", rank=2),
        Column("To", "text", rank=1),
        Column("Drift", "text"),
        Column("Stand out", "number"),
    )
    shown = history.roster.head(MOST_ROWS)
    rows = tuple(
        (
            visible(row["robot"]),
            str(row["logs"]),
            *(
                ABSENT if row[end] is None else row[end].date().isoformat()
                for end in ("first", "last")
            ),
            joined(drifting.get(row["robot"], [])) or ("none" if row["tested"] else "not tested"),
            str(standing_out.get(row["robot"], 0)),
        )
        for row in shown.iter_rows(named=True)
    )
    note = (
        ""
        if shown.height == history.robots
        else f"{counted(history.robots, 'robot')}; the first {shown.height} are shown."
    )
    return Table("Robots", columns, rows, note)


def drift_table(history: History) -> Table:
    """Parameters that drift, the clearest first."""
    columns = (
        Column("Robot", "name"),
        Column("Parameter", "text"),
        Column("Until", "text", rank=1),
        Column("Logs", "number", rank=2),
        Column("Mean", "number", rank=3),
        Column("Slope, % a month", "number"),
        Column("95 % interval", "number"),
        Column("p", "number", rank=4),
    )
    rows = []
    for row in history.drifts.head(MOST_ROWS).iter_rows(named=True):
        percent = 100 / abs(row["mean"]) if row["mean"] else np.nan
        slope, half = percent * row["slope"], 1.96 * percent * row["slope_std"]
        rows.append(
            (
                visible(row["robot"]),
                row["parameter"],
                row["end"].date().isoformat(),
                str(row["logs"]),
                significant(row["mean"]),
                f"{slope:+.3g}",
                f"[{slope - half:.3g}, {slope + half:.3g}]",
                f"{row['p']:.1e}",
            )
        )
    note = f"{history.drifts.height} found. A slope over {SPAN} months is told from none at p < {ALPHA:g}."
    return Table("Drift", columns, tuple(rows), note)


def finding_table(history: History) -> Table:
    """Payloads unlike their labels, and outliers, the farthest first."""
    import polars as pl

    columns = (
        Column("Job", "name"),
        Column("Robot", "text", rank=1),
        Column("What", "text"),
        Column("Parameter", "text"),
        Column("Value", "number"),
        Column("Expected", "number"),
        Column("σ away", "number"),
    )
    worst = history.findings.sort(pl.col("sigmas").abs(), descending=True).head(MOST_ROWS)
    rows = tuple(
        (
            visible(row["job"]),
            visible(row["robot"]),
            {"payload": "payload unlike its label", "outlier": "outlier"}[row["kind"]],
            row["parameter"],
            significant(row["value"]),
            significant(row["expected"]),
            f"{row['sigmas']:+.1f}",
        )
        for row in worst.iter_rows(named=True)
    )
    note = f"{history.findings.height} found; the farthest {len(rows)} are shown."
    return Table("Logs that stand out", columns, rows, note)


def _figures(history: History) -> list[Figure]:
    pairs = history.drifts.head(MOST_PANELS).select("robot", "parameter").rows()
    panels = tuple(_panel(history, robot, parameter) for robot, parameter in pairs)
    reading = f"Read: each dot is the mean of {SPAN} months that end there, with its 95 % interval."
    return [Figure("drift", "Parameters that drift", panels, reading, columns=2)] if panels else []


def _panel(history: History, robot: str, parameter: str) -> Panel:
    import polars as pl

    own = history.windows.filter(
        (pl.col("robot") == robot) & (pl.col("parameter") == parameter)
    ).sort("month")
    trace = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": [end.isoformat() for end in own["end"]],
        "y": own["mean"].to_list(),
        "error_y": {"type": "data", "array": (1.96 * own["mean_std"]).to_list(), "color": "@blue"},
        "line": {"color": "@blue", "width": 1.4},
        "hovertemplate": "%{y:.6g}<extra></extra>",
    }
    layout = {
        "xaxis": axis(type="date"),
        "yaxis": axis(f"{parameter}, {unit_text(UNITS[parameter])}"),
    }
    says = f"{visible(robot)}, {parameter}, {counted(own.height, 'month')}"
    return Panel([trace], layout, says, f"{label(robot)}: {parameter}")
