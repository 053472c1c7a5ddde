"""The fleet's page: what drifts and what stands out, in tables and figures that open offline."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from algid import __version__
from algid.fleet.history import ALPHA, SPAN
from algid.report.document import Document
from algid.report.figures.base import Figure, Panel, axis, label
from algid.report.frame import figures_html, framed, links_of
from algid.report.html import table_html
from algid.report.table import Column, Table
from algid.report.text import ABSENT, counted, joined, significant, visible
from algid.report.verdict import LEVEL_WORDS, Level, Verdict

if TYPE_CHECKING:
    from algid import __version__
from algid.fleet.history import History

MADE = f"Made by algid {__version__}."
MOST_ROBOTS = 40  # whose table is printed
MOST_ROWS = 200
MOST_PANELS = 12


def fleet_html(history: History) -> str:
    """The page's text."""
    figures = _figures(history)
    facts = f"{counted(history.robots, 'robot')} · {counted(history.logs, 'log')}"
    body = [
        *(table_html(table) for table in (drift_table(history), finding_table(history)) if table.rows),
        *figures_html(figures),
        table_html(robot_table(history)),
    ]
    return framed("a fleet's history", "Fleet", facts, verdict(history), links_of(figures), body, figures, MADE)


def verdict(history: History) -> Verdict:
    """Whether anything drifts or stands out; what could not be tested is the reason to doubt it."""
    drifts, findings = history.drifts.height, history.findings.height
    level: Level = "reservations" if drifts or findings or history.untested else "good"
    told = f"{counted(history.robots, 'robot')}, {counted(history.logs, 'log')}"
    found = f"{counted(drifts, 'drift')} and {counted(findings, 'finding')}"
    return Verdict(level, f"{LEVEL_WORDS[level]}: {told}: {found}.", tuple(history.untested))


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
        Column("Logs that stand out", "number"),
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
    note = "" if shown.height == history.robots else f"{history.robots:,} robots; the first {shown.height} are shown."
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
    reading = f"Read: the mean of {SPAN} months that end there, with its 95 % interval."
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
    says = f"{visible(robot)}, {parameter}, {own.height} months"
    return Panel([trace], {"xaxis": axis(type="date"), "yaxis": axis(parameter)}, says, title=title)
