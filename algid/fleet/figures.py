"""A fleet's drawings: courses in the table of robots, and a point a log on a dated axis."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.fleet.drift import SPAN
from algid.fleet.history import History
from algid.model import PARAMETERS, UNITS
from algid.report.document import Drawn
from algid.report.drawings import Course, sparklines
from algid.report.figures.base import (
    Figure,
    Layout,
    Legend,
    Panel,
    Trace,
    axis,
    label,
    packed,
    upright,
)
from algid.significance import NORMAL
from algid.text import significant, unit_text, visible
from algid.words import counted

if TYPE_CHECKING:
    import polars as pl

Marked = tuple[str, str]
"""A robot and a parameter."""

HEIGHT = 230
MOST_PANELS = 12
MOST_POINTS = 400  # of a robot: the latest logs
SIDE_BY_SIDE = 6  # robots that one panel can hold in a colour each
MOST_ROBOTS = 40  # that it can hold in one
COLOURS = ("@blue", "@orange", "@green", "@amber", "@red", "@muted")
LEGEND = {
    "log": Legend("log", "a log, ± 95 %", "@blue", "point"),
    "mean": Legend("mean", f"mean of {SPAN} months", "@measured"),
    "drift": Legend("drift", "drift", "@orange"),
    "outlier": Legend("outlier", "outlier", "@red", "ring"),
    "change": Legend("", "changed at once", "@red", "dash"),
}
READING = {
    "log": "a dot is a log with its 95 % interval",
    "report": "it leads to its report",
    "mean": f"grey is the mean of the {SPAN} months before",
    "drift": "an orange line is a drift",
    "outlier": "a red ring is an outlier",
    "change": "at a red line the arm changed at once",
}
"""What is said of what the panels show."""


def courses(history: History, most: int) -> list[Drawn]:
    """A column of sparklines a parameter: each robot's mean over time with its 95 % band.

    None where no robot has a course, but a mean of one month.
    """
    import polars as pl

    if history.windows.group_by("robot", "parameter").len()["len"].max() in (None, 1):
        return []
    drifting = set(history.drifts.select("robot", "parameter").iter_rows())
    shown = history.roster.head(most)["robot"].implode()
    columns = []
    for (parameter,), rows in history.windows.filter(pl.col("robot").is_in(shown)).group_by(
        "parameter", maintain_order=True
    ):
        own = {}
        for (robot,), part in rows.group_by("robot", maintain_order=True):
            drifts = (robot, parameter) in drifting
            own[visible(robot)] = _course(str(parameter), part, drifts)
        columns.append(Drawn(str(parameter), sparklines(own), small=True))
    return columns


def _course(parameter: str, rows: pl.DataFrame, drifts: bool) -> Course:
    rows = rows.sort("month", "end").drop_nulls(["mean", "mean_std"])
    t = rows["end"].dt.epoch("ms").to_numpy().astype(np.float64)
    mean, half = rows["mean"].to_numpy(), NORMAL * rows["mean_std"].to_numpy()
    says = f"{parameter} "
    if mean.size:
        says += significant(mean[0])
    if mean.size > 1:
        says += f" to {significant(mean[-1])}"
    if drifts:
        says += ", drifts"
    return Course(t, mean, half, says, drifts)


def overview(history: History, reports: Mapping[str, str]) -> Figure | None:
    """What to look at first: all parameters of a few robots, or what was found of many."""
    import polars as pl

    if history.jobs is None or not history.windows.height:
        return None
    robots = history.roster["robot"].to_list()
    pairs = _worth_a_look(history)
    if len(robots) <= SIDE_BY_SIDE or not pairs:
        robots = robots[:MOST_ROBOTS]
        colour_of = dict.fromkeys(robots, COLOURS[0])
        legend = []
        if len(robots) <= SIDE_BY_SIDE:
            colour_of = dict(zip(robots, COLOURS, strict=False))
            for place, (robot, colour) in enumerate(colour_of.items()):
                legend.append(Legend(f"robot{place}", visible(robot), colour, "point"))
        panels = tuple(
            _side_by_side(history, colour_of, name, reports) for name in history.parameters
        )
        reading = _reading(shown_in(panels))
        title = "Every log of every robot"
        return Figure("logs", title, panels, reading, tuple(legend), columns=2)
    clearest = []
    for robot, name in pairs:
        jobs = history.jobs.filter(pl.col("robot") == robot)
        title = f"{label(robot)}: {name}"
        clearest.append(_panel(history, jobs, (robot, name), reports, title))
    title = "The clearest trends, which are no drift"
    if history.drifts.height or history.findings.height or _changed(history):
        title = "What was found, log by log"
    return _log_by_log("logs", title, tuple(clearest))


def _log_by_log(key: str, title: str, panels: tuple[Panel, ...], note: str = "") -> Figure:
    """A figure of single robots, which explains what its panels show and nothing else."""
    shown = shown_in(panels)
    legend = tuple(one for name, one in LEGEND.items() if name in shown)
    return Figure(key, title, panels, _reading(shown), legend, note, columns=2)


def shown_in(panels: Sequence[Panel]) -> set[str]:
    """Which of logs, their reports, means, drifts, outliers and changes the panels show."""
    shown = {"log"}
    for panel in panels:
        if panel.layout["shapes"]:
            shown.add("change")
        for trace in panel.traces:
            if "customdata" in trace:
                shown.add("report")
            if trace["mode"] == "lines":
                shown.add("drift")
            elif trace["mode"] == "lines+markers":
                shown.add("mean")
            elif trace["marker"].get("symbol") == "circle-open":
                shown.add("outlier")
    return shown


def _reading(shown: Collection[str]) -> str:
    """How to read panels that show so much."""
    return f"Read: {'; '.join(words for name, words in READING.items() if name in shown)}."


def robot_figure(
    history: History, robot: str, jobs: pl.DataFrame, reports: Mapping[str, str], key: str
) -> Figure:
    """Every parameter of a robot, whose logs are `jobs`, log by log."""
    panels = []
    for name in history.parameters:
        if (jobs[f"{name}_std"] > 0).any():
            title = f"{name}: {PARAMETERS[name].meaning}"
            panels.append(_panel(history, jobs, (robot, name), reports, title))
    note = (
        f"The latest {MOST_POINTS} of {counted(jobs.height, 'log')} are drawn."
        if jobs.height > MOST_POINTS
        else ""
    )
    return _log_by_log(key, f"{visible(robot)}, log by log", tuple(panels), note)


def _changed(history: History) -> int:
    return 0 if history.changes is None else history.changes.height


def _worth_a_look(history: History) -> list[Marked]:
    """Drifts, changes and outliers, the clearest of each first.

    Of a fleet without, its clearest trends.
    """
    import polars as pl

    outlying = history.findings.filter(pl.col("kind") == "outlier")
    outlying = outlying.sort(pl.col("sigmas").abs(), descending=True)
    pairs = history.drifts.select("robot", "parameter").rows()
    if history.changes is not None:
        pairs += history.changes.select("robot", "parameter").rows()
    pairs += outlying.select("robot", "parameter").rows()
    if not pairs:
        tested = history.windows.filter(pl.col("p").is_not_nan()).sort("p", "robot", "parameter")
        pairs = tested.select("robot", "parameter").unique(maintain_order=True).head(4).rows()
    return list(dict.fromkeys(pairs))[:MOST_PANELS]


def _panel(
    history: History,
    jobs: pl.DataFrame,
    which: Marked,
    reports: Mapping[str, str],
    title: str,
) -> Panel:
    """A robot's parameter, log by log, with its means, drifts, outliers and changes."""
    import polars as pl

    robot, parameter = which
    own = (pl.col("robot") == robot) & (pl.col("parameter") == parameter)
    windows = history.windows.filter(own).sort("month", "end")
    shapes = []
    if history.changes is not None:
        days = history.changes.filter(pl.col("robot") == robot)["after"].unique()
        shapes = [upright(day.isoformat(), "@red", "dash") for day in days]
        windows = _broken(windows, days)
    traces = [_line(windows, "@measured", "mean")]
    traces += _drifts(history, jobs, which, "drift")
    traces += _points(history, jobs, which, reports, "@blue", "log")
    says = f"{visible(robot)}, {parameter}, {counted(jobs.height, 'log')}"
    return Panel(traces, _layout(parameter, shapes), says, title, HEIGHT)


def _broken(windows: pl.DataFrame, days: pl.Series) -> pl.DataFrame:
    """The windows with one that holds nothing at each change, so that no line leads across it."""
    import polars as pl

    breaks = pl.DataFrame({"end": days}, schema={"end": windows.schema["end"]})
    return pl.concat([windows, breaks], how="diagonal").sort("end")


def _side_by_side(
    history: History, robots: Mapping[str, str], parameter: str, reports: Mapping[str, str]
) -> Panel:
    """A parameter of robots, each in its colour."""
    import polars as pl

    assert history.jobs is not None
    points, lines = list[Trace](), list[Trace]()
    for place, (robot, colour) in enumerate(robots.items()):
        jobs = history.jobs.filter(pl.col("robot") == robot)
        which, group = (robot, parameter), f"robot{place}"
        points += _points(history, jobs, which, reports, colour, group)
        lines += _drifts(history, jobs, which, group)
    title = f"{parameter}: {PARAMETERS[parameter].meaning}"
    says = f"{parameter} of {counted(len(robots), 'robot')}"
    return Panel(points + lines, _layout(parameter, []), says, title, HEIGHT)


def _layout(parameter: str, shapes: list[Layout]) -> Layout:
    return {
        "xaxis": axis(type="date"),
        "yaxis": axis(unit_text(UNITS[parameter])),
        "shapes": shapes,
        "hovermode": "closest",
    }


def _drifts(history: History, jobs: pl.DataFrame, which: Marked, group: str) -> list[Trace]:
    """The line of each window that drifts, by weighted least squares over its logs."""
    import polars as pl

    robot, parameter = which
    std = f"{parameter}_std"
    own = (pl.col("robot") == robot) & (pl.col("parameter") == parameter) & pl.col("drift")
    known = jobs.filter(pl.col("time").is_not_null() & (pl.col(std) > 0)).sort("time")
    x: list[float] = []
    y: list[float] = []
    for row in history.windows.filter(own).sort("month").iter_rows(named=True):
        inside = known.filter(
            (pl.col("stint") == row["stint"])
            & pl.col("month").is_between(row["month"] - SPAN + 1, row["month"])
        )
        t = inside["time"].dt.epoch("ms").to_numpy().astype(np.float64)
        off = (t - t[0]) / max(t[-1] - t[0], 1.0)
        slope, start = np.polyfit(
            off, inside[parameter].to_numpy(), 1, w=1 / inside[std].to_numpy()
        )
        x += [float(t[0]), float(t[-1]), float(t[-1])]
        y += [float(start), float(start + slope), np.nan]
    if not x:
        return []
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "x": packed(np.array(x), precise=True),
            "y": packed(np.array(y)),
            "line": {"color": "@orange", "width": 3},
            "legendgroup": group,
            "hoverinfo": "skip",
        }
    ]


def _line(windows: pl.DataFrame, colour: str, group: str) -> Trace:
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "x": _times(windows["end"]),
        "y": _packed(windows["mean"]),
        "line": {"color": colour, "width": 2},
        "marker": {"color": colour, "size": 3},
        "legendgroup": group,
        "hovertemplate": "mean %{y:.5g}<extra></extra>",
    }


def _points(
    history: History,
    jobs: pl.DataFrame,
    which: Marked,
    reports: Mapping[str, str],
    colour: str,
    group: str,
) -> list[Trace]:
    """A robot's logs, and the rings of those that are outliers; the undated ones are not drawn."""
    import polars as pl

    robot, parameter = which
    unit, std = unit_text(UNITS[parameter]), f"{parameter}_std"
    shown = jobs.filter(pl.col("time").is_not_null() & (pl.col(std) > 0)).head(MOST_POINTS)
    names = shown["job"].to_list()
    place = {"x": _times(shown["time"]), "y": _packed(shown[parameter])}
    point: Trace = {
        "type": "scatter",
        "mode": "markers",
        **place,
        "error_y": {
            "type": "data",
            "array": _packed(NORMAL * shown[std]),
            "color": f"{colour}/0.4",
            "thickness": 1,
            "width": 0,
        },
        "marker": {"color": colour, "size": 5},
        "text": [label(name) for name in names],
        "legendgroup": group,
        "hovertemplate": f"%{{text}}<br>%{{y:.5g}} ± %{{error_y.array:.2g}} {unit}<br>"
        f"%{{x|%Y-%m-%d %H:%M}}<extra>{label(robot)}</extra>",
    }
    if any(name in reports for name in names):
        point["customdata"] = [reports.get(name, "") for name in names]
    outlying = history.findings.filter(
        (pl.col("robot") == robot)
        & (pl.col("parameter") == parameter)
        & (pl.col("kind") == "outlier")
        & pl.col("time").is_not_null()
    )
    if not outlying.height:
        return [point]
    ring: dict[str, Any] = {"color": "@red", "size": 13, "symbol": "circle-open"}
    rings = {
        "type": "scatter",
        "mode": "markers",
        "x": _times(outlying["time"]),
        "y": _packed(outlying["value"]),
        "marker": {**ring, "line": {"color": "@red", "width": 2}},
        "legendgroup": "outlier" if group == "log" else group,
        "hoverinfo": "skip",
    }
    return [point, rings]


def _times(column: pl.Series) -> dict[str, str]:
    """Times as plotly's milliseconds since 1970."""
    return packed(column.dt.epoch("ms").to_numpy().astype(np.float64), precise=True)


def _packed(column: pl.Series) -> dict[str, str]:
    return packed(np.asarray(column.fill_null(float("nan")).to_numpy(), dtype=np.float64))
