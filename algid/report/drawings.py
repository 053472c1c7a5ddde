"""Drawings so small that one stands in each row of a table: inline SVG on one scale a column.

A forest plot beside estimates, bars either side of zero beside what each of several things
changes, and courses over time.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.report.text import escaped
from algid.results import Estimate
from algid.text import significant


def _svg(kind: str, width: float, height: float, says: str, drawing: str) -> str:
    return (
        f'<svg class="{kind}" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}" role="img" '
        f'aria-label="{escaped(says)}">{drawing}</svg>'
    )


WIDTH, HEIGHT = 124.0, 22.0  # of a forest plot's row, pixels
EDGE = 8.0  # where an arrow tells that an interval goes on
WIDEST = 100.0  # percent: an interval beyond says little more than the estimate's size
ROOM = 1.15  # of the widest interval
MOST = 4.0  # of the median interval: wider ones end in arrows, so that they do not hide the others
STEPS = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class Forest:
    """Each row's drawing by name, and the half width of the scale in percent."""

    rows: dict[str, str]
    limit: float

    @property
    def heading(self) -> str:
        """What stands above the column."""
        return f"within ± {significant(self.limit, 1)} %"


def forest(
    group: Mapping[str, Estimate],
    truth: Mapping[str, float] | None = None,
    logs: Mapping[str, Sequence[float]] | None = None,
) -> Forest:
    """Each row's 95 % interval on one scale of percent of the estimate.

    Parameters
    ----------
    group : estimates by name; those without an interval have no drawing
    truth : what a synthetic log was made with, by name: drawn as a ring
    logs : each log's own estimates by name: drawn as dots
    """
    truth, logs = truth or {}, logs or {}
    shares = {}
    for name, estimate in group.items():
        share = _share(estimate)
        if share is not None:
            shares[name] = share
    limit = _limit(list(shares.values()))
    rows = {}
    for name, share in shares.items():
        rows[name] = _row(name, group[name], share, limit, truth.get(name), logs.get(name, ()))
    return Forest(rows, limit)


def _share(found: Estimate) -> float | None:
    """Half the interval in percent of the estimate's size.

    Infinite about zero, None where there is none.
    """
    low, high = found.ci95 or (None, None)
    if found.estimate is None or low is None or high is None:
        return None
    if found.estimate == 0:
        return math.inf
    return 100 * ((high - low) / 2) / abs(found.estimate)


def _limit(shares: Sequence[float]) -> float:
    """The scale that holds every interval, or where a few are far wider than most, all but those.

    Intervals as wide as their estimates do not count: they hold zero, and would flatten the others.
    It is rounded up to the next 1, 2 or 5 times a power of ten.
    """
    if not shares:
        return 1.0
    shares = [share for share in shares if share < WIDEST] or shares
    least = min(max(shares) * ROOM, MOST * statistics.median(shares), WIDEST)
    if least <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(step * power for step in STEPS if step * power >= least * (1 - 1e-9))


def _row(
    name: str,
    found: Estimate,
    share: float,
    limit: float,
    truth: float | None,
    logs: Sequence[float],
) -> str:
    size = abs(found.estimate or 0.0)

    def place(value: float) -> float:
        """Where a value stands, in pixels; beyond the edges where it is beyond the scale."""
        if size == 0:
            return WIDTH / 2
        off = 100 * (value - (found.estimate or 0.0)) / size / limit
        return WIDTH / 2 * (1 + off * (1 - 2 * EDGE / WIDTH))

    reach = min(share / limit, 1.0) * (WIDTH / 2 - EDGE)
    middle, y = WIDTH / 2, HEIGHT / 2
    ends = ring = ""
    if share > limit:
        ends = (
            f'<path class="end" d="M{EDGE:g} {y - 4:g} L1 {y:g} L{EDGE:g} {y + 4:g} '
            f'M{WIDTH - EDGE:g} {y - 4:g} L{WIDTH - 1:g} {y:g} L{WIDTH - EDGE:g} {y + 4:g}"/>'
        )
    if truth is not None and 0 <= place(truth) <= WIDTH:
        ring = f'<circle class="truth" cx="{place(truth):.1f}" cy="{y:g}" r="4"/>'
    dots = "".join(_dot(place(value), y + 6) for value in logs)
    width = f"± {significant(share, 2)} %"
    if share > WIDEST:
        width = "wider than its value"
    drawing = (
        f'<line class="zero" x1="{middle:g}" y1="0" x2="{middle:g}" y2="{HEIGHT:g}"/>'
        f'<line class="reach" x1="{middle - reach:.1f}" y1="{y:g}" x2="{middle + reach:.1f}" '
        f'y2="{y:g}"/>'
        f'{ends}<circle class="value" cx="{middle:g}" cy="{y:g}" r="2.5"/>{dots}{ring}'
    )
    return _svg("forest", WIDTH, HEIGHT, f"{name}: {width}", drawing)


def _dot(x: float, y: float) -> str:
    """A log's own estimate; hollow at the edge where it lies beyond."""
    if 0 <= x <= WIDTH:
        return f'<circle class="log" cx="{x:.1f}" cy="{y:g}" r="1.8"/>'
    return f'<circle class="log beyond" cx="{2.5 if x < 0 else WIDTH - 2.5:g}" cy="{y:g}" r="1.8"/>'


BAR_WIDTH, BAR_HEIGHT = 120.0, 14.0
LEAST = 1.0  # of the bars' scale: changes all below are shown as small as they are


def bars(values: Mapping[str, float]) -> dict[str, str]:
    """A drawing a row: a bar from zero in the middle, to the left where the value is negative."""
    scale = max(LEAST, max(map(abs, values.values()), default=LEAST))
    return {name: _bar(name, value, scale) for name, value in values.items()}


def _bar(name: str, value: float, scale: float) -> str:
    middle = BAR_WIDTH / 2
    length = abs(value) / scale * (middle - 2)
    kind, left = ("less", middle - length) if value < 0 else ("more", middle)
    drawing = (
        f'<rect class="{kind}" x="{left:.1f}" y="2" width="{length:.1f}" '
        f'height="{BAR_HEIGHT - 4:g}"/>'
        f'<line class="zero" x1="{middle:g}" y1="0" x2="{middle:g}" y2="{BAR_HEIGHT:g}"/>'
    )
    return _svg("forest", BAR_WIDTH, BAR_HEIGHT, f"{name}: {value:+.2f}", drawing)


def gauges(shares: Mapping[str, float]) -> dict[str, str]:
    """A drawing a row: a bar for a share between 0 and 1, and a line for the whole."""
    return {name: _gauge(name, share) for name, share in shares.items()}


def _gauge(name: str, share: float) -> str:
    whole = BAR_WIDTH - 2
    drawing = (
        f'<rect class="more" x="0" y="2" width="{min(max(share, 0.0), 1.0) * whole:.1f}" '
        f'height="{BAR_HEIGHT - 4:g}"/>'
        f'<line class="zero" x1="{whole:g}" y1="0" x2="{whole:g}" y2="{BAR_HEIGHT:g}"/>'
    )
    return _svg("forest", BAR_WIDTH, BAR_HEIGHT, f"{name}: {100 * share:.1f} %", drawing)


SPARK_WIDTH, SPARK_HEIGHT = 54.0, 24.0
SPARK_EDGE = 3.0
# quantile of a column's rows that its scale holds: a wild one leaves the frame, and the others
# their shape
USUAL = 0.9


@dataclass(frozen=True, eq=False)
class Course:
    """Values (n,) at times `t` (n,) in any unit, half band widths, and whether they are marked."""

    t: FloatArray
    value: FloatArray
    half: FloatArray
    says: str
    marked: bool = False

    @property
    def middle(self) -> float:
        """The level that changes are drawn from."""
        return float(np.median(self.value))

    @property
    def reach(self) -> float:
        """How far value and band leave the level."""
        return float(np.max(np.abs(self.value - self.middle) + self.half))


def sparklines(courses: Mapping[str, Course]) -> dict[str, str]:
    """A drawing a row; every row has the same scale of time and of change."""
    shown = {name: course for name, course in courses.items() if course.t.size}
    if not shown:
        return {}
    first = min(float(course.t[0]) for course in shown.values())
    last = max(float(course.t[-1]) for course in shown.values())
    reaches = [course.reach for course in shown.values()]
    scale = float(np.quantile(reaches, USUAL))
    for course in shown.values():
        if course.marked:
            scale = max(scale, course.reach)
    span = (first, last)
    return {name: _course(name, course, span, scale or 1.0) for name, course in shown.items()}


def _course(name: str, course: Course, span: tuple[float, float], scale: float) -> str:
    first, last = span
    x = SPARK_EDGE + (course.t - first) / ((last - first) or 1.0) * (SPARK_WIDTH - 2 * SPARK_EDGE)
    changes = course.value - course.middle + np.array([[0.0], [-1.0], [1.0]]) * course.half
    middle = SPARK_HEIGHT / 2
    y, low, high = np.clip(middle - changes / scale * (middle - SPARK_EDGE), 0.0, SPARK_HEIGHT)
    ends = x
    if x.size == 1:  # a lone value has its band as a bar
        ends, high, low = x[0] + np.array([-1.0, 1.0]), high.repeat(2), low.repeat(2)
    band = _points(np.append(ends, ends[::-1]), np.append(high, low[::-1]))
    drawing = (
        f"<title>{escaped(course.says)}</title>"
        f'<polygon class="band" points="{band}"/>'
        f'<polyline class="course" points="{_points(x, y)}"/>'
        f'<circle class="last" cx="{x[-1]:.1f}" cy="{y[-1]:.1f}" r="1.8"/>'
    )
    kind = "spark marked" if course.marked else "spark"
    return _svg(kind, SPARK_WIDTH, SPARK_HEIGHT, f"{name}: {course.says}", drawing)


def _points(x: FloatArray, y: FloatArray) -> str:
    return " ".join(f"{one:.1f},{other:.1f}" for one, other in zip(x, y, strict=True))
