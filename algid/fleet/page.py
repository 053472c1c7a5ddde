"""The fleet's page: what drifts and what stands out, in tables and figures that open offline."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from algid import __version__
from algid.fleet.history import ALPHA, SPAN, History
from algid.model import UNITS
from algid.report.document import Document
from algid.report.figures.base import Figure, Panel, axis, label
from algid.report.frame import figures_html, framed, links_of
from algid.report.html import Drawn, escaped, table_html
from algid.report.sparkline import Course, sparklines
from algid.report.table import Column, Table
from algid.report.text import ABSENT, joined, significant, unit_text, visible
from algid.report.verdict import LEVEL_WORDS, Level, Verdict
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

MADE = f"Made by algid {__version__}."
READING = (
    '<p class="reading">Read: each parameter has one scale of change for all robots; the band is the 95 % interval of '
    f"the mean over {SPAN} months. Level within its band is steady, orange drifts. A robot's name leads to its latest "
    "report.</p>"
)
MOST_ROBOTS = 40  # whose table is printed
MOST_ROWS = 200
MOST_PANELS = 12


def fleet_html(history: History, reports: Mapping[str, str] | None = None) -> str:
    """The page's text; `reports` says where the report of each job is."""
    reports = reports or {}
    figures = _figures(history)
    facts = f"{counted(history.robots, 'robot')} · {counted(history.logs, 'log')}"
    latest = {visible(robot): reports[job] for robot, job in _latest(history) if job in reports}
    jobs = {visible(job): place for job, place in reports.items()}
    body = [
        table_html(robot_table(history), _courses(history), latest),
        READING,
        *(table_html(table, (), latest) for table in [drift_table(history)] if table.rows),
        *(table_html(table, (), jobs) for table in [finding_table(history)] if table.rows),
        *figures_html(figures),
        *_reports(history, reports),
    ]
    links = [*links_of(figures), *([("reports", "Reports")] if reports else [])]
    return framed("a fleet's history", "Fleet", facts, verdict(history), links, body, figures, MADE)


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


def _latest(history: History) -> list[tuple[str, str]]:
    return list(history.roster.select("robot", "latest").iter_rows())


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
    ends = f"{significant(mean[0])} to {significant(mean[-1])}" if mean.size > 1 else "".join(map(significant, mean))
    return Course(t, mean, half, f"{parameter} {ends}{', drifts' if drifts else ''}", drifts)


def _reports(history: History, reports: Mapping[str, str]) -> list[str]:
    """Links to every log's report, by robot, the latest first."""
    if not reports or history.jobs is None:
        return []
    lists = [
        f"<dt>{escaped(robot)}</dt><dd>{_listed(part['job'].to_list(), reports)}</dd>"
        for (robot,), part in history.jobs.group_by("robot", maintain_order=True)
    ]
    return [
        '<details class="paper" id="reports"><summary>Reports</summary>',
        f"<dl>{''.join(lists)}</dl></details>",
    ]


def _listed(jobs: list[str], reports: Mapping[str, str]) -> str:
    known = [job for job in jobs if job in reports]
    links = [f'<a href="{escaped(reports[job])}">{escaped(job)}</a>' for job in known[:MOST_ROWS]]
    more = f" and {len(known) - MOST_ROWS:,} more" if len(known) > MOST_ROWS else ""
    return ", ".join(links) + more or "none"


def verdict(history: History) -> Verdict:
    """Whether anything drifts or stands out; what could not be tested is the reason to doubt it."""
    drifts, findings = history.drifts.height, history.findings.height
    level: Level = "reservations" if drifts or findings or history.untested else "good"
    told = f"{counted(history.robots, 'robot')}, {counted(history.logs, 'log')}"
    found = f"{counted(drifts, 'drift')} and {counted(findings, 'finding')}"
    return Verdict(level, f"{LEVEL_WORDS[level]}: {told}: {found}{_clearest(history)}.", tuple(history.untested))


def _clearest(history: History) -> str:
    """The clearest trend of all that were tested, whether it drifts or not."""
    import polars as pl

    tested = history.windows.filter(pl.col("p").is_not_nan() & (pl.col("mean") != 0.0))
    if not tested.height:
        return ""
    row = tested.sort("p", "robot", "parameter").row(0, named=True)
    slope = 100 * row["slope"] / abs(row["mean"])
    what = f"{row['parameter']} of {visible(row['robot'])}, {slope:+.2g} % a month (p = {significant(row['p'], 2)})"
    return f"; the clearest trend is {what}" + ("" if row["drift"] else f", which does not pass p < {ALPHA:g}")


def fleet_document(history: History) -> Document:
    """The report of a fleet; a long list of robots of which nothing was found is left to the page."""
    found = [table for table in (drift_table(history), finding_table(history)) if table.rows]
    robots = [robot_table(history)] if history.robots <= MOST_ROBOTS else []
    return Document("Fleet", verdict(history), (*found, *robots))


def robot_table(history: History) -> Table:
    """Every robot: its logs, their dates, and what was found of it."""
    import polars as pl

    drifting = dict(history.drifts.group_by("robot").agg(pl.col("parameter").sort()).iter_rows())
    standing_out = dict(history.findings.group_by("robot").agg(pl.col("job").n_unique()).iter_rows())
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
            *(ABSENT if row[end] is None else row[end].date().isoformat() for end in ("first", "last")),
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
    rows = tuple(_drift_row(row) for row in history.drifts.head(MOST_ROWS).iter_rows(named=True))
    note = f"{history.drifts.height} found. A slope over {SPAN} months is told from none at p < {ALPHA:g}."
    return Table("Drift", columns, rows, note)


def _drift_row(row: dict[str, Any]) -> tuple[str, ...]:
    percent = 100 / abs(row["mean"]) if row["mean"] else np.nan
    slope, half = percent * row["slope"], 1.96 * percent * row["slope_std"]
    return (
        visible(row["robot"]),
        row["parameter"],
        row["end"].date().isoformat(),
        str(row["logs"]),
        significant(row["mean"]),
        f"{slope:+.3g}",
        f"[{slope - half:.3g}, {slope + half:.3g}]",
        f"{row['p']:.1e}",
    )


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
    if not panels:
        return []
    reading = f"Read: each dot is the mean of {SPAN} months that end there, with its 95 % interval."
    return [Figure("drift", "Parameters that drift", panels, reading, columns=2)]


def _panel(history: History, robot: str, parameter: str) -> Panel:
    import polars as pl

    own = history.windows.filter((pl.col("robot") == robot) & (pl.col("parameter") == parameter)).sort("month")
    trace = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": [end.isoformat() for end in own["end"]],
        "y": own["mean"].to_list(),
        "error_y": {"type": "data", "array": (1.96 * own["mean_std"]).to_list(), "color": "@blue"},
        "line": {"color": "@blue", "width": 1.4},
        "hovertemplate": "%{y:.6g}<extra></extra>",
    }
    title = f"{label(robot)}: {parameter}"
    says = f"{visible(robot)}, {parameter}, {counted(own.height, 'month')}"
    return Panel(
        [trace],
        {"xaxis": axis(type="date"), "yaxis": axis(f"{parameter}, {unit_text(UNITS[parameter])}")},
        says,
        title=title,
    )
