"""A fleet's figure: a point a log on a dated axis, of what to look at first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.significance import NORMAL
from algid.base.text import unit_text
from algid.fleet.drift import SPAN
from algid.fleet.history import History
from algid.model import UNITS
from algid.report.plot import BLUE, GREY, ORANGE, RED, Panels, Plot

if TYPE_CHECKING:
    import polars as pl

MOST_PANELS = 12
MOST_POINTS = 400  # of a robot: the latest logs


def overview(history: History) -> Plot | None:
    """Drifts, changes and outliers, the clearest of each first.

    Of a fleet without, its clearest trends, and of one that could not be tested its first robots.
    None without a log that has a time.
    """
    import polars as pl

    if history.jobs is None or history.jobs["time"].null_count() == history.jobs.height:
        return None
    marked = [history.drifts, *([] if history.changes is None else [history.changes])]
    outlying = history.findings.filter(pl.col("kind") == "outlier")
    marked.append(outlying.sort(pl.col("sigmas").abs(), descending=True))
    pairs = [pair for frame in marked for pair in frame.select("robot", "parameter").rows()]
    title = "What was found, log by log"
    if not pairs:
        tested = history.windows.filter(pl.col("p").is_not_nan()).sort("p", "robot", "parameter")
        pairs = tested.select("robot", "parameter").rows()[:4]
        title = "The clearest trends, which are no drift"
    if not pairs:
        robots = history.roster["robot"].to_list()
        pairs = [(robot, name) for name in history.parameters for robot in robots]
        title = "Log by log"
    pairs = list(dict.fromkeys(pairs))[:MOST_PANELS]
    titles = [f"{robot}: {name}, {unit_text(UNITS[name])}" for robot, name in pairs]
    panels = Panels(titles, 2, 230)
    for place, (robot, name) in enumerate(pairs):
        _panel(panels, place, history, robot, name)
    reading = (
        f"A dot is a log ± {NORMAL:.2f} standard deviations, grey the mean of the {SPAN} months "
        "before. "
        "A diamond ends a drift, a ring is an outlier, at a red line the arm changed at once."
    )
    return Plot("logs", title, panels, reading)


def _panel(panels: Panels, place: int, history: History, robot: str, parameter: str) -> None:
    """Draw a robot's parameter, log by log."""
    import polars as pl

    assert history.jobs is not None
    own = (pl.col("robot") == robot) & (pl.col("parameter") == parameter)
    std = f"{parameter}_std"
    dated = history.jobs.filter((pl.col("robot") == robot) & pl.col("time").is_not_null())
    logs = dated.filter(pl.col(std) > 0).head(MOST_POINTS)
    bars = {"type": "data", "array": (NORMAL * logs[std]).to_list(), "thickness": 1, "width": 0}
    panels.dots(
        place, _dates(logs["time"]), _numbers(logs[parameter]), "log", BLUE, 5, error_y=bars
    )
    windows = history.windows.filter(own).sort("month", "end")
    if history.changes is not None:
        days = history.changes.filter(pl.col("robot") == robot)["after"].unique().sort()
        # a window that holds nothing at each change: no line leads across it
        breaks = pl.DataFrame({"end": days}, schema={"end": windows.schema["end"]})
        windows = pl.concat([windows, breaks], how="diagonal").sort("end")
        for day in _dates(days).tolist():
            panels.line(place, x=day, colour=RED)
    drifting = windows.filter(pl.col("drift"))
    ends, means = _dates(windows["end"]), _numbers(windows["mean"])
    panels.curve(place, ends, means, "mean", GREY, 2)
    outlying = history.findings.filter(own & (pl.col("kind") == "outlier")).drop_nulls("time")
    marks = (
        ("drift", ORANGE, "diamond", 9, drifting["end"], drifting["mean"]),
        ("outlier", RED, "circle-open", 13, outlying["time"], outlying["value"]),
    )
    for name, colour, symbol, size, x, y in marks:
        if len(x):
            panels.dots(place, _dates(x), _numbers(y), name, colour, size, symbol)
    panels.axes(place, {"type": "date"})


def _dates(column: pl.Series) -> NDArray[np.int64]:
    """Times as plotly's milliseconds since 1970."""
    return np.asarray(column.dt.epoch("ms").to_numpy(), dtype=np.int64)


def _numbers(column: pl.Series) -> FloatArray:
    return np.asarray(column.cast(float).fill_null(float("nan")).to_numpy(), dtype=np.float64)
