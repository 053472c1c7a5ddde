"""A fleet's tables: its robots, and what drifts, changed or stands out."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from algid.fleet.changes import ALPHA as CHANGED
from algid.fleet.drift import ALPHA, SPAN
from algid.fleet.history import History
from algid.model import PARAMETERS, UNITS
from algid.report.document import Column, Table
from algid.significance import NORMAL
from algid.text import ABSENT, joined, resolved, significant, unit_text, visible
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

MOST_ROWS = 200


def robot_table(history: History) -> Table:
    """Every robot: its logs, their dates, and what was found of it."""
    import polars as pl

    drifting = dict(history.drifts.group_by("robot").agg(pl.col("parameter").sort()).iter_rows())
    standing_out = dict(
        history.findings.group_by("robot").agg(pl.col("job").n_unique()).iter_rows()
    )
    changed: dict[str, list[str]] = {}
    if history.changes is not None:
        changed = _days_of(history.changes)
    columns = (
        Column("Robot", "name"),
        Column("Logs", "number"),
        Column("From", "text", rank=2),
        Column("To", "text", rank=1),
        Column("Drift", "text"),
        Column("Changed", "text", rank=3),
        Column("Stand out", "number"),
    )
    shown = history.roster.head(MOST_ROWS)
    rows = []
    for row in shown.iter_rows(named=True):
        robot = row["robot"]
        no_drift = "none" if row["tested"] else "not tested"
        rows.append(
            (
                visible(robot),
                str(row["logs"]),
                _day(row["first"]),
                _day(row["last"]),
                joined(drifting.get(robot, [])) or no_drift,
                joined(changed.get(robot, [])) or ABSENT,
                str(standing_out.get(robot, 0)),
            )
        )
    notes = []
    if shown.height < history.robots:
        notes.append(f"{counted(history.robots, 'robot')}; the first {shown.height} are shown.")
    if history.scattered is not None:
        notes.append(history.scattered.text)
    table = Table("Robots", columns, tuple(rows), " ".join(notes))
    if not changed:
        return table.without(("Changed",))
    return table


def _day(time: datetime | None) -> str:
    if time is None:
        return ABSENT
    return time.date().isoformat()


def _days_of(changes: pl.DataFrame) -> dict[str, list[str]]:
    """The days on which each robot changed."""
    days: dict[str, list[str]] = {}
    for robot, after in changes.select("robot", "after").unique(maintain_order=True).iter_rows():
        days.setdefault(robot, []).append(after.date().isoformat())
    return days


def change_table(history: History) -> Table:
    """Robots that changed at once, each change's clearest parameters first."""
    columns = (
        Column("Robot", "name"),
        Column("Between", "text"),
        Column("Parameter", "text"),
        Column("Step, %", "number"),
        Column("Step", "number", rank=1),
        Column("Unit", "text", rank=2),
    )
    rows = []
    if history.changes is not None:
        for row in history.changes.head(MOST_ROWS).iter_rows(named=True):
            rows.append(
                (
                    visible(row["robot"]),
                    f"{_day(row['before'])} and {_day(row['after'])}",
                    row["parameter"],
                    f"{100 * row['share']:+.3g}",
                    _with_half(row["step"], row["step_std"]),
                    unit_text(UNITS[row["parameter"]]),
                )
            )
    note = (
        "An arm, a drive or a convention was replaced: what came before and what comes after are "
        f"tested apart. Significant at p < {significant(CHANGED, 1)} in a robot's life."
    )
    return Table("Changed at once", columns, tuple(rows), note)


def parameter_table(history: History, robot: str, jobs: pl.DataFrame) -> Table:
    """Every parameter of a robot with logs `jobs`: latest value, mean, trend, and findings."""
    import polars as pl

    columns = (
        Column("Parameter", "name"),
        Column("Latest log, ± 95 %", "number"),
        Column(f"Mean of {SPAN} months, ± 95 %", "number"),
        Column("Unit", "text"),
        Column("Trend, % a month", "number"),
        Column("Found", "text"),
        Column("Meaning", "text"),
    )
    own = history.windows.filter(pl.col("robot") == robot).sort("month", "end")
    rows = []
    for parameter in history.parameters:
        part = own.filter(pl.col("parameter") == parameter)
        if not part.height:
            continue
        last, std = part.row(-1, named=True), f"{parameter}_std"
        latest, value = jobs.filter(pl.col(std) > 0), ABSENT
        if latest.height:
            value = _with_half(latest[parameter][0], latest[std][0])
        rows.append(
            (
                parameter,
                value,
                _with_half(last["mean"], last["mean_std"]),
                unit_text(UNITS[parameter]),
                _trend(last),
                _found(history, robot, parameter),
                PARAMETERS[parameter].meaning,
            )
        )
    return Table("Parameters", columns, tuple(rows))


def _with_half(value: float, std: float) -> str:
    return f"{resolved(value, std)} ± {significant(NORMAL * std, 2)}"


def _trend(row: dict[str, float]) -> str:
    if np.isnan(row["p"]) or not row["mean"]:
        return "not tested"
    percent = 100 / abs(row["mean"])
    return f"{percent * row['slope']:+.2g} ± {significant(NORMAL * percent * row['slope_std'], 2)}"


def _found(history: History, robot: str, parameter: str) -> str:
    """What was found of a robot's parameter, in words."""
    import polars as pl

    own = (pl.col("robot") == robot) & (pl.col("parameter") == parameter)
    words = []
    if history.drifts.filter(own).height:
        words.append("drifts")
    if history.changes is not None:
        for row in history.changes.filter(own).iter_rows(named=True):
            words.append(f"changed by {100 * row['share']:+.2g} % on {_day(row['after'])}")
    outlying = history.findings.filter(own & (pl.col("kind") == "outlier")).height
    if outlying:
        words.append(counted(outlying, "outlier"))
    return joined(words) or ABSENT


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
        slope, half = percent * row["slope"], NORMAL * percent * row["slope_std"]
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
    note = (
        f"{history.drifts.height} found. A slope over {SPAN} months is significant at p < "
        f"{significant(ALPHA, 1)}."
    )
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
    kinds = {"payload": "payload unlike its label", "outlier": "outlier"}
    rows = []
    for row in worst.iter_rows(named=True):
        rows.append(
            (
                visible(row["job"]),
                visible(row["robot"]),
                kinds[row["kind"]],
                row["parameter"],
                significant(row["value"]),
                significant(row["expected"]),
                f"{row['sigmas']:+.1f}",
            )
        )
    note = f"{history.findings.height} found."
    if history.findings.height > len(rows):
        note = f"{history.findings.height} found; the farthest {len(rows)} are shown."
    return Table("Logs that stand out", columns, tuple(rows), note)
