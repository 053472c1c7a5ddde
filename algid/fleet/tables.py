"""A fleet's tables: its robots, what drifts or changed, and which logs stand out."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

import numpy as np
import polars as pl

from algid.base.compiled import student_quantile
from algid.base.text import ABSENT, joined, significant, visible
from algid.base.words import counted
from algid.fleet.changes import ALPHA as CHANGED
from algid.fleet.drift import ALPHA, SPAN
from algid.fleet.history import History
from algid.report.document import Kind, Table

MOST_ROWS = 200
KINDS = {"payload": "payload unlike its label", "outlier": "outlier"}


def robot_table(history: History, links: Mapping[str, str] | None = None) -> Table:
    """Every robot: its logs, what was found of it, and their dates."""
    drifting = dict(history.drifts.group_by("robot").agg(pl.col("parameter").sort()).iter_rows())
    outlying = dict(history.findings.group_by("robot").agg(pl.col("job").n_unique()).iter_rows())
    changed: dict[str, list[str]] = {}
    if history.changes is not None:
        for robot, after in history.changes.select("robot", "after").unique().sort("after").rows():
            changed.setdefault(robot, []).append(_day(after))
    rows = []
    for row in history.roster.head(MOST_ROWS).iter_rows(named=True):
        robot, none = row["robot"], "none" if row["tested"] else "not tested"
        found = (joined(drifting.get(robot, [])) or none, joined(changed.get(robot, [])) or ABSENT)
        dates = (_day(row["first"]), _day(row["last"]))
        out = str(outlying.get(robot, 0))
        rows.append((visible(robot), str(row["logs"]), *found, out, *dates))
    notes = []
    if len(rows) < history.robots:
        notes.append(f"{counted(history.robots, 'robot')}; the first {len(rows)} are shown.")
    if history.scattered is not None:
        notes.append(history.scattered.text)
    columns: dict[str, Kind] = {
        "Robot": "name", "Logs": "number", "Drift": "text", "Changed": "text",
        "Stand out": "number", "From": "text", "To": "text",
    }  # fmt: skip
    table = Table("Robots", columns, tuple(rows), " ".join(notes), links)
    return table if changed else table.without(("Changed",))


def _day(time: datetime | None) -> str:
    return ABSENT if time is None else time.date().isoformat()


def change_table(history: History) -> Table:
    """Parameters that drift, then those that changed at once, the clearest first."""
    rows = []
    for row in history.drifts.head(MOST_ROWS).iter_rows(named=True):
        percent = 100 / abs(row["mean"]) if row["mean"] else np.nan
        half = significant(student_quantile(row["logs"] - 2) * percent * row["slope_std"], 2)
        trend = f"{percent * row['slope']:+.3g} ± {half}"
        rows.append((row["robot"], row["parameter"], "drift", trend, "% a month", _day(row["end"])))
    changes = history.changes if history.changes is not None else pl.DataFrame()
    logs = dict(history.roster.select("robot", "logs").rows())
    for row in changes.head(MOST_ROWS).iter_rows(named=True):
        percent = 100 * abs(row["share"] / row["step"])
        half = significant(student_quantile(logs[row["robot"]] - 2) * percent * row["step_std"], 2)
        step = f"{100 * row['share']:+.3g} ± {half}"
        between = f"{_day(row['before'])} to {_day(row['after'])}"
        rows.append((row["robot"], row["parameter"], "step", step, "%", between))
    note = (
        f"± is 95 %. A drift is a slope over {SPAN} months with p < {significant(ALPHA, 1)}; a "
        f"step, where an arm, a drive or a convention was replaced, has p < "
        f"{significant(CHANGED, 1)} in a robot's life: what comes before and after is tested apart."
    )
    columns: dict[str, Kind] = {
        "Robot": "name", "Parameter": "text", "Kind": "text", "Change": "number", "Unit": "text",
        "When": "text",
    }  # fmt: skip
    shown = tuple((visible(robot), *rest) for robot, *rest in rows)
    return Table("Drift and steps", columns, shown, note)


def finding_table(history: History, links: Mapping[str, str] | None = None) -> Table:
    """Payloads unlike their labels, and outliers, the farthest first."""
    worst = history.findings.sort(pl.col("sigmas").abs(), descending=True).head(MOST_ROWS)
    rows = []
    for row in worst.iter_rows(named=True):
        numbers = (significant(row["value"]), significant(row["expected"]))
        away = f"{row['sigmas']:+.1f}"
        what = (row["parameter"], away, *numbers, KINDS[row["kind"]], visible(row["robot"]))
        rows.append((visible(row["job"]), *what))
    note = f"{history.findings.height} found."
    if history.findings.height > len(rows):
        note = f"{history.findings.height} found; the farthest {len(rows)} are shown."
    columns: dict[str, Kind] = {
        "Job": "name", "Parameter": "text", "σ away": "number", "Value": "number",
        "Expected": "number", "What": "text", "Robot": "text",
    }  # fmt: skip
    return Table("Logs that stand out", columns, tuple(rows), note, links)
