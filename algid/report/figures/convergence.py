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
    targets = {name: _target(name, result, loaded) for name in read.lines}
    panels = [_panel(read, name, target, key) for name, target in targets.items()]
    if read.condition is not None:
        panels.append(_condition(read, read.condition, key))
    windows = f" in each window of {read.window:g} s" if len(read.windows) > 1 else ""
    reading = (
        f"Read: from ε = {EPSILON:g} s on{windows}, blue should settle on green; "
        "double-click shows the spikes that the frame cuts off."
    )
    return Figure(key, title, tuple(panels), reading, _legend(read, targets), columns=2)


def _target(name: str, result: Result, loaded: bool) -> Target:
    groups = (
        [result.loaded, result.paper_payload, result.payload] if loaded else [result.parameters]
    )
    estimate = next((group[name] for group in groups if name in group), None)
    row = next((row for row in result.table4 if row.parameter == name), None)
    unit = estimate.unit if estimate is not None else row.unit if row is not None else ""
    truth = result.truth.get(name) if row is None else row.truth
    return Target(estimate, truth, unit_text(unit))


def _panel(read: SeriesLog, name: str, target: Target, sync: str) -> Panel:
    estimate, unit = target.found, target.unit
    layout = {
        "xaxis": axis("time, s", range=[read.start, read.end]),
        "yaxis": axis(label(unit), range=_view(read.samples[name], target)),
        "yaxis2": {"overlaying": "y", "range": [0, 1], "visible": False, "fixedrange": True},
        "shapes": [*_marks(target), *_epsilons(read)],
        "hovermode": "closest",
    }
    final = (
        ""
        if estimate is None
        else f"; final estimate {resolved(estimate.estimate, estimate.std)} {unit}"
    )
    truth = "" if target.truth is None else f"; truth {significant(target.truth)} {unit}"
    return Panel(
        _traces(read, name, unit), layout, f"{name} over time{final}{truth}", name, HEIGHT, sync
    )


def _traces(read: SeriesLog, name: str, unit: str) -> list[Trace]:
    """The series, and behind it where the system was singular, as a share of the panel's height."""
    where, share = read.singular[name]
    traces: list[Trace] = []
    if share.any():
        area = {
            "fill": "tozeroy",
            "fillcolor": "@amber/0.35",
            "line": {"width": 0, "shape": "hv"},
            "hoverinfo": "skip",
        }
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": times(where),
                "y": packed(share),
                "yaxis": "y2",
                **area,
            }
        )
        traces[-1] |= {"legendgroup": "singular", "name": "singular"}
    hover = f"{label(name)} %{{y:.5g}} {label(unit)}<br>at %{{x:.4g}} s<extra></extra>"
    colour = "@blue/0.3" if read.coarse else "@blue"
    traces.append(line(*read.lines[name], colour, label(name), "series", width=1.2, hover=hover))
    if read.coarse:
        traces.append(
            line(*read.middles[name], "@blue", label(name), "middle", width=1.6, hover=hover)
        )
    return traces


def _condition(read: SeriesLog, condition: Series, sync: str) -> Panel:
    hover = "condition %{y:.3g} at %{x:.4g} s<extra></extra>"
    layout = {
        "xaxis": axis("time, s", range=[read.start, read.end]),
        "yaxis": axis(type="log", dtick=3, tickfont={"size": 10}),
        "shapes": [level(LARGEST_CONDITION, "@amber"), *_epsilons(read)],
        "hovermode": "closest",
    }
    trace = line(*condition, "@muted", "condition number", "", width=1.2, hover=hover)
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
    known = (
        [target.truth]
        if estimate is None
        else [target.truth, estimate.estimate, *(estimate.ci95 or ())]
    )
    ends = [
        *np.percentile(settled, [4, 96]).tolist(),
        *(value for value in known if value is not None),
    ]
    low, high = min(ends), max(ends)
    space = 0.25 * (high - low) or 0.05 * abs(high) or 1.0
    return [low - space, high + space]


def _marks(target: Target) -> list[Layout]:
    """The interval, the estimate and the truth, as far as they are known."""
    marks: list[Layout] = []
    estimate = target.found
    low, high = (estimate.ci95 if estimate is not None else None) or (None, None)
    if low is not None and high is not None:
        marks.append(band(low, high, "@green/0.28"))
    if estimate is not None and estimate.estimate is not None:
        marks.append(level(estimate.estimate, "@green", "solid"))
    if target.truth is not None:
        marks.append(level(target.truth, "@ink", "dash", 1.2))
    return marks


def _epsilons(read: SeriesLog) -> list[Layout]:
    ends = [begin + EPSILON for begin in read.windows if begin + EPSILON < read.end]
    return [upright(end, "@muted") for end in ends] if len(ends) <= MOST_WINDOWS else []


def _legend(read: SeriesLog, targets: Mapping[str, Target]) -> tuple[Legend, ...]:
    entries = [Legend("series", "the paper's estimate over time", "@blue")]
    if read.coarse:
        entries = [
            Legend("middle", "the paper's estimate, running median", "@blue"),
            Legend("series", "its extremes", "@blue/0.3"),
        ]
    results = [target.found for target in targets.values() if target.found is not None]
    if results:
        spread = " and its 95 % interval" if any(estimate.ci95 for estimate in results) else ""
        entries.append(Legend("", f"result{spread}", "@green"))
    if any(target.truth is not None for target in targets.values()):
        entries.append(Legend("", "truth", "@ink", "dash"))
    if _epsilons(read):
        entries.append(Legend("", "ε, before which estimates are arbitrary", "@muted", "dot"))
    if read.any_singular:
        entries.append(
            Legend("singular", "singular: condition number past 1e10", "@amber/0.35", "area")
        )
    return tuple(entries)
