"""The paper's Figure 2: convergence of each estimate, with final value, band and truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.report.figures.base import (
    Figure,
    Layout,
    Legend,
    Missing,
    Panel,
    Trace,
    axis,
    band,
    label,
    level,
    line,
    packed,
    times,
    upright,
)
from algid.report.series import EPSILON, LARGEST_CONDITION, Series, SeriesLog, read_series
from algid.results import Estimate, Result
from algid.text import resolved, significant, unit_text

HEIGHT = 230
TITLE = "Convergence of the estimates (the paper's Figure 2)"
LOADED = "Convergence, loaded log"
MOST_WINDOWS = 6  # beyond, a line at every window's ε hides the series


@dataclass(frozen=True)
class Target:
    """What a series converges to, as far as it is known, and its unit."""

    found: Estimate | None
    truth: float | None
    unit: str


def convergence(path: Path, result: Result, loaded: bool = False) -> Figure | Missing:
    """The series of `path` (estimates.parquet, or loaded.parquet where `loaded`), a panel each."""
    key, title = ("loaded", LOADED) if loaded else ("convergence", TITLE)
    read = read_series(path, result.settings)
    if not read.lines:
        return Missing(key, title, f"{path.name} holds no series")
    targets, panels = {}, []
    for name in read.lines:
        targets[name] = _target(name, result, loaded)
        panels.append(_panel(read, name, targets[name], key))
    if read.condition is not None:
        panels.append(_condition(read, read.condition, key))
    windows = ""
    if len(read.windows) > 1:
        windows = f" in each window of {read.window:g} s"
    reading = (
        f"Read: from ε = {EPSILON:g} s on{windows}, blue should settle on green; "
        "double-click shows the spikes that the frame cuts off."
    )
    return Figure(key, title, tuple(panels), reading, _legend(read, targets), columns=2)


def _target(name: str, result: Result, loaded: bool) -> Target:
    estimates = result.parameters
    if loaded:
        estimates = result.payload | result.paper_payload | result.loaded
    estimate = estimates.get(name)
    unit, truth = "", result.truth.get(name)
    for row in result.table4:
        if row.parameter == name:
            unit, truth = row.unit, row.truth
    if estimate is not None:
        unit = estimate.unit
    return Target(estimate, truth, unit_text(unit))


def _panel(read: SeriesLog, name: str, target: Target, sync: str) -> Panel:
    estimate, unit = target.found, target.unit
    layout = {
        "xaxis": axis("time, s", range=[read.start, read.end]),
        "yaxis": axis(label(unit), range=_view(read.samples[name], target)),
        "yaxis2": {"overlaying": "y", "range": [0, 1], "visible": False, "fixedrange": True},
        "shapes": _marks(target) + _epsilons(read),
        "hovermode": "closest",
    }
    says = f"{name} over time"
    if estimate is not None:
        says += f"; final estimate {resolved(estimate.estimate, estimate.std)} {unit}"
    if target.truth is not None:
        says += f"; truth {significant(target.truth)} {unit}"
    return Panel(_traces(read, name, unit), layout, says, name, HEIGHT, sync)


def _traces(read: SeriesLog, name: str, unit: str) -> list[Trace]:
    """The series, and behind it where the system was singular, as a share of the panel's height."""
    where, share = read.singular[name]
    traces: list[Trace] = []
    if share.any():
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": times(where),
                "y": packed(share),
                "yaxis": "y2",
                "fill": "tozeroy",
                "fillcolor": "@amber/0.35",
                "line": {"width": 0, "shape": "hv"},
                "hoverinfo": "skip",
                "legendgroup": "singular",
                "name": "singular",
            }
        )
    hover = f"{label(name)} %{{y:.5g}} {label(unit)}<br>at %{{x:.4g}} s<extra></extra>"
    colour = "@blue/0.3" if read.coarse else "@blue"
    t, values = read.lines[name]
    traces.append(line(t, values, colour, label(name), "series", width=1.2, hover=hover))
    if read.coarse:
        t, values = read.middles[name]
        traces.append(line(t, values, "@blue", label(name), "middle", width=1.6, hover=hover))
    return traces


def _condition(read: SeriesLog, condition: Series, sync: str) -> Panel:
    hover = "condition %{y:.3g} at %{x:.4g} s<extra></extra>"
    layout = {
        "xaxis": axis("time, s", range=[read.start, read.end]),
        "yaxis": axis(type="log", dtick=3, tickfont={"size": 10}),
        "shapes": [level(LARGEST_CONDITION, "@amber")] + _epsilons(read),
        "hovermode": "closest",
    }
    t, values = condition
    trace = line(t, values, "@muted", "condition number", "", width=1.2, hover=hover)
    return Panel(
        [trace],
        layout,
        "Condition number of the linear system over time",
        "condition number",
        HEIGHT,
        sync,
    )


def _view(samples: FloatArray, target: Target) -> list[float] | None:
    """The range in which the series settles; spikes near singular instants start outside."""
    finite = samples[np.isfinite(samples)]
    settled = finite[finite.size // 4 :]
    if not settled.size:
        return None
    estimate = target.found
    known = [target.truth]
    if estimate is not None:
        known.append(estimate.estimate)
        known += estimate.ci95 or ()
    ends = np.percentile(settled, [4, 96]).tolist()
    ends += [value for value in known if value is not None]
    low, high = min(ends), max(ends)
    space = 0.25 * (high - low) or 0.05 * abs(high) or 1.0
    return [low - space, high + space]


def _marks(target: Target) -> list[Layout]:
    """The interval, the estimate and the truth, as far as they are known."""
    marks: list[Layout] = []
    estimate = target.found
    if estimate is not None:
        low, high = estimate.ci95 or (None, None)
        if low is not None and high is not None:
            marks.append(band(low, high, "@green/0.28"))
        if estimate.estimate is not None:
            marks.append(level(estimate.estimate, "@green", "solid"))
    if target.truth is not None:
        marks.append(level(target.truth, "@ink", "dash", 1.2))
    return marks


def _epsilons(read: SeriesLog) -> list[Layout]:
    ends = [begin + EPSILON for begin in read.windows if begin + EPSILON < read.end]
    if len(ends) > MOST_WINDOWS:
        return []
    return [upright(end, "@muted") for end in ends]


def _legend(read: SeriesLog, targets: Mapping[str, Target]) -> tuple[Legend, ...]:
    entries = [Legend("series", "the paper's estimate over time", "@blue")]
    if read.coarse:
        entries = [
            Legend("middle", "the paper's estimate, running median", "@blue"),
            Legend("series", "its extremes", "@blue/0.3"),
        ]
    results = [target.found for target in targets.values() if target.found is not None]
    if results:
        words = "result"
        if any(estimate.ci95 for estimate in results):
            words += " and its 95 % interval"
        entries.append(Legend("", words, "@green"))
    if any(target.truth is not None for target in targets.values()):
        entries.append(Legend("", "truth", "@ink", "dash"))
    if _epsilons(read):
        entries.append(Legend("", "ε, before which estimates are arbitrary", "@muted", "dot"))
    if read.any_singular:
        entries.append(
            Legend("singular", "singular: condition number past 1e10", "@amber/0.35", "area")
        )
    return tuple(entries)
