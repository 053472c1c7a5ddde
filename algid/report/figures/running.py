"""What the estimator had found by each moment of the logs, and its shrinking 95 % band."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.report.figures.base import (
    Figure,
    Layout,
    Legend,
    Missing,
    Panel,
    axis,
    between,
    label,
    level,
    line,
)
from algid.report.figures.timeline import offsets, separators, views
from algid.report.reduce import blocks, by_log, columns_of
from algid.report.series import LogRange
from algid.report.tables import known_truth
from algid.results import Estimate, Result
from algid.text import resolved, significant, unit_text

TITLE = "Running estimate"
HALF = "_half"
HEIGHT = 210
SETTLED = 4.0  # final half widths that the first view shows at least, either way
READING = (
    "Read: the band must shrink and the line stay inside what the band was before; a line that "
    "leaves it late tells "
    "of a part of the logs that contradicts the rest."
)
LEGEND = (
    Legend("estimate", "estimate from all samples so far", "@blue"),
    Legend("band", "its 95 % interval", "@blue/0.25", "area"),
    Legend("", "final estimate", "@muted", "dash"),
)


@dataclass(frozen=True, eq=False)
class RunningCourse:
    """A parameter's estimate and half its 95 % interval (T,), NaN while not determined."""

    name: str
    value: FloatArray
    half: FloatArray

    @property
    def strays(self) -> NDArray[np.intp]:
        """Where the band misses the final estimate."""
        return np.flatnonzero(np.abs(self.value - self.value[-1]) > self.half)


def running(path: Path, result: Result) -> Figure | Missing:
    """A panel a parameter that has an estimate at the end. Raises `ResultError`."""
    names = [name.removesuffix(HALF) for name in columns_of(path) if name.endswith(HALF)]
    columns = ["log", "t"] + names + [name + HALF for name in names]
    logs = list(by_log(blocks(path, columns)))
    if not names or not logs:
        return Missing("running", TITLE, f"{path.name} holds no series")
    ranges: dict[int, LogRange] = {}
    for log, block in logs:
        ranges.setdefault(log, LogRange(0.0, 0.0)).last = float(block["t"][-1])
    moved = offsets(ranges)
    t = np.concatenate([block["t"] + moved[log] for log, block in logs])

    def whole(name: str) -> FloatArray:
        return np.concatenate([block[name] for _, block in logs])

    courses = []
    for name in names:
        if name in result.estimates and result.estimates[name].estimate is not None:
            course = RunningCourse(name, whole(name), whole(name + HALF))
            if np.isfinite(course.value[-1]):
                courses.append(course)
    if not courses:
        return Missing("running", TITLE, "no parameter is determined")
    starts = separators(ranges, moved, result.logs).get("shapes", [])
    panels = tuple(_panel(course, t, result.estimates[course.name], starts) for course in courses)
    note = _note(courses, t, result)
    return Figure("running", TITLE, panels, READING, LEGEND, note, 2, views(ranges, result.logs))


def _panel(course: RunningCourse, t: FloatArray, final: Estimate, starts: list[Layout]) -> Panel:
    name, value, half = course.name, course.value, course.half
    unit = unit_text(final.unit)
    hover = f"{label(name)} %{{y:.5g}} {unit}<br>by %{{x:.4g}} s<extra></extra>"
    traces = list(between(t, value - half, value + half, "@blue/0.25", "band"))
    traces.append(line(t, value, "@blue", label(name), "estimate", hover=hover))
    # the final interval several times over, and the last two thirds of the series with its band
    later = np.flatnonzero(np.isfinite(value) & np.isfinite(half))
    later = later[later.size // 3 :]
    low, high = value[-1] - SETTLED * half[-1], value[-1] + SETTLED * half[-1]
    low = np.min(value[later] - half[later], initial=low)
    high = np.max(value[later] + half[later], initial=high)
    layout = {
        "xaxis": axis("time, s", range=[0.0, float(t[-1])]),
        "yaxis": axis(unit, range=[float(low), float(high)]),
        "shapes": starts + [level(float(value[-1]), "@muted", "dash", 1.0)],
        "hovermode": "closest",
    }
    says = f"{name} over time, in the end {resolved(final.estimate, final.std)} {unit}"
    return Panel(traces, layout, says, name, HEIGHT, "running")


def _note(courses: list[RunningCourse], t: FloatArray, result: Result) -> str:
    """When the last band missed its final estimate, and how often bands hold a known truth."""
    note = "Every band held the final estimate from the start."
    late = {course.name: float(t[course.strays[-1]]) for course in courses if course.strays.size}
    if late:
        latest = max(late, key=lambda name: late[name])
        when = f"{significant(late[latest], 3)} s of {significant(float(t[-1]), 3)} s"
        note = f"The last band to miss its final estimate was that of {latest}, at {when}."
    truth = known_truth(result)
    held = count = 0
    for course in courses:
        if course.name in truth:
            within = np.abs(course.value - truth[course.name]) <= course.half
            held += int(np.count_nonzero(within))
            count += int(np.count_nonzero(np.isfinite(course.half)))
    if count:
        share = significant(100 * held / count, 3)
        note += f" The bands hold the truth {share} % of the time."
    return note
