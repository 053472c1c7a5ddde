"""The fleet's page: its robots, what was found of them, and a figure of that."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import polars as pl
from numpy.typing import NDArray

from algid import __version__
from algid.arm import FloatArray
from algid.base.significance import NORMAL
from algid.base.text import ABSENT, joined, significant, unit_text, visible
from algid.base.verdict import Verdict, graded
from algid.base.words import counted
from algid.fleet.findings import ALPHA, CHANGED, SPAN
from algid.fleet.history import History
from algid.model import UNITS
from algid.notices import Notice
from algid.report.document import Document, Section, Table
from algid.report.plot import GREY, ORANGE, RED, Panels, Plot

KINDS = {"drift": "drift", "step": "step", "payload": "payload label", "outlier": "outlier"}
"""Of findings, in words."""
MOST_ROBOTS = 40  # whose table is printed
MOST_ROWS = 200
MOST_NAMED = 3  # in a reason of the verdict
MOST_PANELS = 12
MOST_POINTS = 400  # of a robot: the latest logs


def fleet_document(
    history: History, batch: Path | None = None, out: Path | None = None
) -> Document:
    """The report of a fleet; with the folders of `batch` and page also its figure and links.

    A long list of robots is left to the page.
    """
    robots, found, figure = robot_table(history), finding_table(history), None
    if batch is not None and out is not None:
        figure = overview(history)
        robots, found = (linked(table, batch, out) for table in (robots, found))
    return Document(
        title="Fleet",
        verdict=verdict(history),
        sections=(
            Section("numbers", "Findings", (found,)),
            Section("logs", "Log by log", (figure,) if figure else ()),
            Section("robots", "Robots", (robots,), folded=history.robots > MOST_ROBOTS),
        ),
        kicker="a fleet's history",
        name="Fleet",
        facts=f"{counted(history.robots, 'robot')} · {counted(history.logs, 'log')}",
        made=f"Made by algid {__version__}.",
    )


def linked(table: Table, batch: Path, out: Path) -> Table:
    """The table, whose rows begin with logs, with links to their reports as seen from `out`."""
    links = {}
    for log, *_ in table.rows:
        page = batch / f"{log}.algid" / "report.html"
        if Path(page).is_file():  # False for a name that no file can have
            there = os.path.relpath(page.resolve(), out.resolve()).replace(os.sep, "/")
            links[log] = "./" + quote(there)  # a name such as javascript: leads nowhere else
    return Table(table.title, table.columns, table.rows, table.note, links)


def verdict(history: History) -> Verdict:
    """Grade a fleet by what drifts, changed or stands out, and by what could not be tested."""
    found, reasons = history.findings, []
    steps = found.filter(kind="step")
    drifting = found.filter(kind="drift").select("parameter", "robot").rows()
    if drifting:
        names = [f"{parameter} of {visible(robot)}" for parameter, robot in drifting]
        reasons.append(_named("drift", names))
    if steps.height:
        row, count = steps.row(0, named=True), steps.n_unique(["robot", "time"])
        numbers = {
            "before": _day(row["before"]),
            "after": _day(row["time"]),
            "robot": visible(row["robot"]),
            "parameter": row["parameter"],
            "percent": _percent(row["value"], row),
            "count": count if count > 1 else 0,
        }
        reasons.append(Notice("FLEET_CHANGE", numbers={"case": "step"} | numbers))
    names = []
    for row in found.filter(pl.col("kind").is_in(["payload", "outlier"])).iter_rows(named=True):
        sigmas = significant(row["sigmas"], 2)
        names.append(f"{visible(row['job'])} ({row['parameter']}, {sigmas} σ)")
    if names:
        reasons.append(_named("log", names))
    fleet = f"{counted(history.robots, 'robot')}, {counted(history.logs, 'log')}"
    return graded(f"{fleet}: {_counts(found) or 'no findings'}", reasons + history.untested)


def _counts(found: pl.DataFrame) -> str:
    """How many findings there are of each kind, in words; empty of none."""
    counts = dict(found["kind"].value_counts().iter_rows())
    return joined([counted(counts[kind], what) for kind, what in KINDS.items() if kind in counts])


def _percent(value: float, row: dict[str, Any]) -> float:
    """A value of a finding in percent of what is expected."""
    return 100 * value / abs(row["expected"]) if row["expected"] else np.nan


def _named(case: str, names: list[str]) -> Notice:
    """How many there are of a kind, and the clearest ones."""
    shown, rest = names[:MOST_NAMED], len(names) - MOST_NAMED
    if rest > 0:
        shown.append(f"{rest} more")
    return Notice("FLEET_CHANGE", numbers={"case": case, "count": len(names), "names": shown})


def robot_table(history: History) -> Table:
    """Every robot: its latest log, how many logs, what was found of it, and their dates."""
    counts = {robot: _counts(own) for (robot,), own in history.findings.group_by("robot")}
    rows = []
    for row in history.roster.head(MOST_ROWS).iter_rows(named=True):
        found = counts.get(row["robot"]) or ("none" if row["tested"] else "not tested")
        latest = (visible(row["latest"]), visible(row["robot"]), str(row["logs"]))
        rows.append((*latest, found, _day(row["first"]), _day(row["last"])))
    return Table(
        "Robots",
        "Latest log | Robot | Logs | Findings | From | To",
        tuple(rows),
        _shown(history.robots, "robot"),
    ).without_empty()


def finding_table(history: History) -> Table:
    """Drifts, steps, payloads unlike their labels and outliers, of each the clearest first."""
    rows = []
    for row in history.findings.head(MOST_ROWS).iter_rows(named=True):
        when, kind = _day(row["time"]), row["kind"]
        if kind in ("drift", "step"):
            half = significant(abs(_percent(row["half"], row)), 2)
            by = f"{_percent(row['value'], row):+.3g} ± {half} %"
            if kind == "drift":
                by += " a month"
            else:
                when = f"{_day(row['before'])} to {when}"
        else:
            value, expected = significant(row["value"]), significant(row["expected"])
            by = f"{row['sigmas']:+.1f} σ: {value} for {expected}"
        own = (visible(row["job"]), visible(row["robot"]), row["parameter"])
        rows.append((*own, KINDS[kind], by, when))
    note = (
        f"± is 95 %. A drift is a slope over {SPAN} months with p < {significant(ALPHA, 1)}; a "
        f"step, where an arm, a drive or a convention was replaced, has p < "
        f"{significant(CHANGED, 1)} in a robot's life: what comes before and after is tested apart."
    )
    return Table(
        "Findings",
        "Log | Robot | Parameter | What | By | When",
        tuple(rows),
        f"{note} {_shown(history.findings.height, 'finding')}".rstrip(),
    )


def _shown(count: int, things: str) -> str:
    """That a long table is cut; nothing of a short one."""
    if count <= MOST_ROWS:
        return ""
    return f"{counted(count, things)}; the first {MOST_ROWS} are shown."


def _day(time: datetime | None) -> str:
    return ABSENT if time is None else time.date().isoformat()


def overview(history: History) -> Plot | None:
    """A point a log on a dated axis: of drifts, changes and outliers, the clearest of each first.

    Of a fleet without, its clearest trends. None without a log that has a time.
    """
    if history.jobs["time"].null_count() == history.jobs.height:
        return None
    found = history.findings.filter(pl.col("kind") != "payload")
    pairs = found.select("robot", "parameter").rows()
    if not pairs:
        pairs = history.windows.sort("p", "parameter", "robot").select("robot", "parameter").rows()
    pairs = list(dict.fromkeys(pairs))[:MOST_PANELS]
    titles = [f"{robot}: {name}, {unit_text(UNITS[name])}" for robot, name in pairs]
    panels = Panels(titles, 2, 230)
    for place, (robot, name) in enumerate(pairs):
        own = (pl.col("robot") == robot) & (pl.col("parameter") == name)
        of_robot = history.jobs.filter(pl.col(f"{name}_std") > 0, robot=robot)
        logs = of_robot.drop_nulls("time").head(MOST_POINTS)
        half = (NORMAL * logs[f"{name}_std"]).to_list()
        bars = {"type": "data", "array": half, "thickness": 1, "width": 0}
        panels.dots(place, _dates(logs["time"]), _numbers(logs[name]), "log", size=5, error_y=bars)
        for day in _dates(found.filter(robot=robot, kind="step")["time"].unique().sort()).tolist():
            panels.line(place, x=day, colour=RED)
        windows = history.windows.filter(own)
        for stint in windows.partition_by("stint", maintain_order=True):
            panels.curve(place, _dates(stint["end"]), _numbers(stint["mean"]), "mean", GREY, 2)
        drifting, outliers = windows.filter("drift"), found.filter(own, kind="outlier")
        for marked, end, y, name, colour, size, symbol in (
            (drifting, "end", "mean", "drift", ORANGE, 9, "diamond"),
            (outliers.drop_nulls("time"), "time", "value", "outlier", RED, 13, "circle-open"),
        ):
            if marked.height:
                x = _dates(marked[end])
                panels.dots(place, x, _numbers(marked[y]), name, colour, size, symbol)
        panels.axes(place, {"type": "date"})
    reading = (
        f"A dot is a log ± {NORMAL:.2f} standard deviations, grey the mean of the {SPAN} months "
        "before. A diamond ends a drift, a ring is an outlier, at a red line the arm changed at "
        "once."
    )
    return Plot("logs", "Log by log", panels, reading)


def _dates(column: pl.Series) -> NDArray[np.int64]:
    """Times as plotly's milliseconds since 1970."""
    return np.asarray(column.dt.epoch("ms").to_numpy(), dtype=np.int64)


def _numbers(column: pl.Series) -> FloatArray:
    return np.asarray(column.cast(float).fill_null(float("nan")).to_numpy(), dtype=np.float64)
