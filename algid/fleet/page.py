"""The fleet's page: its robots, what was found of them, and a figure of that."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from urllib.parse import quote

import numpy as np
import polars as pl
from numpy.typing import NDArray

from algid import __version__
from algid.arm import FloatArray
from algid.base.compiled import student_quantile
from algid.base.significance import NORMAL
from algid.base.text import ABSENT, joined, significant, unit_text, visible
from algid.base.verdict import Verdict, graded
from algid.base.words import counted
from algid.fleet.changes import ALPHA as CHANGED
from algid.fleet.drift import ALPHA, SPAN
from algid.fleet.history import History
from algid.model import UNITS
from algid.notices import Notice
from algid.report.document import Document, Section, Table
from algid.report.plot import BLUE, GREY, ORANGE, RED, Panels, Plot

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
    drifts, changes = history.drifts, history.changes
    findings = history.findings.sort(pl.col("sigmas").abs(), descending=True)
    steps = changes.n_unique(["robot", "after"]) if changes.height else 0
    counts = [counted(drifts.height, "drift"), counted(findings.height, "finding")]
    reasons = []
    if drifts.height:
        rows = drifts.select("robot", "parameter").rows()
        names = [f"{parameter} of {visible(robot)}" for robot, parameter in rows]
        reasons.append(_named("drift", names))
    if steps:
        counts.insert(1, counted(steps, "change"))
        row = changes.row(0, named=True)
        numbers = {
            "before": _day(row["before"]),
            "after": _day(row["after"]),
            "robot": visible(row["robot"]),
            "parameter": row["parameter"],
            "percent": 100 * row["share"],
            "count": steps if steps > 1 else 0,
        }
        reasons.append(Notice("FLEET_CHANGE", numbers={"case": "step"} | numbers))
    if findings.height:
        names = []
        for job, parameter, sigmas in findings.select("job", "parameter", "sigmas").iter_rows():
            names.append(f"{visible(job)} ({parameter}, {significant(sigmas, 2)} σ)")
        reasons.append(_named("log", names))
    if history.scattered is not None:
        reasons.append(history.scattered)
    fleet = f"{counted(history.robots, 'robot')}, {counted(history.logs, 'log')}"
    return graded(f"{fleet}: {joined(counts)}", reasons + history.untested)


def _named(case: str, names: list[str]) -> Notice:
    """How many there are of a kind, and the clearest ones."""
    shown, rest = names[:MOST_NAMED], len(names) - MOST_NAMED
    if rest > 0:
        shown.append(f"{rest} more")
    return Notice("FLEET_CHANGE", numbers={"case": case, "count": len(names), "names": shown})


def robot_table(history: History) -> Table:
    """Every robot: its latest log, how many logs, what was found of it, and their dates."""
    drifting = dict(history.drifts.group_by("robot").agg(pl.col("parameter").sort()).iter_rows())
    outlying = dict(history.findings.group_by("robot").agg(pl.col("job").n_unique()).iter_rows())
    changed: dict[str, list[str]] = {}
    for robot, after in history.changes.select("robot", "after").unique().sort("after").rows():
        changed.setdefault(robot, []).append(_day(after))
    rows = []
    for row in history.roster.head(MOST_ROWS).iter_rows(named=True):
        robot, none = row["robot"], "none" if row["tested"] else "not tested"
        found = (joined(drifting.get(robot, [])) or none, joined(changed.get(robot, [])) or ABSENT)
        dates = (_day(row["first"]), _day(row["last"]))
        out = str(outlying.get(robot, 0))
        latest = (visible(row["latest"]), visible(robot), str(row["logs"]))
        rows.append((*latest, *found, out, *dates))
    return Table(
        "Robots",
        {
            "Latest log": "name", "Robot": "text", "Logs": "number", "Drift": "text",
            "Changed": "text", "Stand out": "number", "From": "text", "To": "text",
        },
        tuple(rows),
        _shown(history.robots, "robot"),
    ).without_empty()  # fmt: skip


def finding_table(history: History) -> Table:
    """Drifts, steps, payloads unlike their labels and outliers, of each the clearest first."""
    roster = {row["robot"]: row for row in history.roster.iter_rows(named=True)}
    rows = []
    for row in history.drifts.iter_rows(named=True):
        percent = 100 / abs(row["mean"]) if row["mean"] else np.nan
        half = significant(student_quantile(row["logs"] - 2) * percent * row["slope_std"], 2)
        trend = f"{percent * row['slope']:+.3g} ± {half} % a month"
        log = roster[row["robot"]]["latest"]
        rows.append((log, row["robot"], row["parameter"], "drift", trend, _day(row["end"])))
    for row in history.changes.iter_rows(named=True):
        percent = 100 * abs(row["share"] / row["step"])
        freedom = roster[row["robot"]]["logs"] - 2
        half = significant(student_quantile(freedom) * percent * row["step_std"], 2)
        step = f"{100 * row['share']:+.3g} ± {half} %"
        between = f"{_day(row['before'])} to {_day(row['after'])}"
        rows.append((row["job"], row["robot"], row["parameter"], "step", step, between))
    for row in history.findings.sort(pl.col("sigmas").abs(), descending=True).iter_rows(named=True):
        what = {"payload": "payload label", "outlier": "outlier"}[row["kind"]]
        value, expected = significant(row["value"]), significant(row["expected"])
        away = f"{row['sigmas']:+.1f} σ: {value} for {expected}"
        rows.append((row["job"], row["robot"], row["parameter"], what, away, _day(row["time"])))
    note = (
        f"± is 95 %. A drift is a slope over {SPAN} months with p < {significant(ALPHA, 1)}; a "
        f"step, where an arm, a drive or a convention was replaced, has p < "
        f"{significant(CHANGED, 1)} in a robot's life: what comes before and after is tested apart."
    )
    shown = tuple((visible(log), visible(robot), *rest) for log, robot, *rest in rows[:MOST_ROWS])
    return Table(
        "Findings",
        {
            "Log": "name", "Robot": "text", "Parameter": "text", "What": "text", "By": "text",
            "When": "text",
        },
        shown,
        f"{note} {_shown(len(rows), 'finding')}".rstrip(),
    )  # fmt: skip


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
    outlying = history.findings.filter(kind="outlier")
    marked = (
        history.drifts,
        history.changes,
        outlying.sort(pl.col("sigmas").abs(), descending=True),
    )
    pairs = [pair for frame in marked for pair in frame.select("robot", "parameter").rows()]
    if not pairs:
        pairs = history.windows.sort("p", "parameter", "robot").select("robot", "parameter").rows()
    pairs = list(dict.fromkeys(pairs))[:MOST_PANELS]
    titles = [f"{robot}: {name}, {unit_text(UNITS[name])}" for robot, name in pairs]
    panels = Panels(titles, 2, 230)
    for place, (robot, name) in enumerate(pairs):
        own = (pl.col("robot") == robot) & (pl.col("parameter") == name)
        std = pl.col(f"{name}_std")
        logs = history.jobs.filter(
            pl.col("robot") == robot, pl.col("time").is_not_null(), std > 0
        ).head(MOST_POINTS)
        half = (NORMAL * logs[f"{name}_std"]).to_list()
        bars = {"type": "data", "array": half, "thickness": 1, "width": 0}
        dots = _dates(logs["time"]), _numbers(logs[name])
        panels.dots(place, *dots, "log", BLUE, 5, error_y=bars)
        days = history.changes.filter(pl.col("robot") == robot)["after"].unique().sort()
        for day in _dates(days).tolist():
            panels.line(place, x=day, colour=RED)
        # a window that holds nothing at each change: no line leads across it
        windows = history.windows.filter(own)
        breaks = pl.DataFrame({"end": days}, schema={"end": windows.schema["end"]})
        windows = pl.concat([windows, breaks], how="diagonal").sort("end", "month")
        panels.curve(place, _dates(windows["end"]), _numbers(windows["mean"]), "mean", GREY, 2)
        drifting, outliers = windows.filter("drift"), outlying.filter(own).drop_nulls("time")
        if drifting.height:
            dots = _dates(drifting["end"]), _numbers(drifting["mean"])
            panels.dots(place, *dots, "drift", ORANGE, 9, "diamond")
        if outliers.height:
            dots = _dates(outliers["time"]), _numbers(outliers["value"])
            panels.dots(place, *dots, "outlier", RED, 13, "circle-open")
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
