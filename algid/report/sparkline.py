"""A course so small that many stand in a table: values with their bands, on one scale a column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.report.html import escaped

WIDTH, HEIGHT = 78.0, 24.0  # pixels
EDGE = 3.0
USUAL = 0.9  # quantile of a column's rows that its scale holds: a wild one leaves the frame, and the others their shape


@dataclass(frozen=True, eq=False)
class Course:
    """Values (n,) at times `t` (n,) in any unit, half the width of their bands, whether they are to be looked at."""

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
    marked = [course.reach for course in shown.values() if course.marked]
    scale = max([float(np.quantile([course.reach for course in shown.values()], USUAL)), *marked]) or 1.0
    return {name: _drawn(name, course, (first, last), scale) for name, course in shown.items()}


def _drawn(name: str, course: Course, span: tuple[float, float], scale: float) -> str:
    first, last = span
    x = EDGE + (course.t - first) / ((last - first) or 1.0) * (WIDTH - 2 * EDGE)
    y, low, high = (_place(course.value + sign * course.half - course.middle, scale) for sign in (0.0, -1.0, 1.0))
    band = _points([*zip(x, high, strict=True), *zip(x[::-1], low[::-1], strict=True)])
    if x.size == 1:  # a lone value has its band as a bar
        band = _points([(x[0] - 1, high[0]), (x[0] + 1, high[0]), (x[0] + 1, low[0]), (x[0] - 1, low[0])])
    line = _points(list(zip(x, y, strict=True)))
    kind = "spark marked" if course.marked else "spark"
    return (
        f'<svg class="{kind}" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}" height="{HEIGHT:g}" role="img" '
        f'aria-label="{escaped(name)}: {escaped(course.says)}"><title>{escaped(course.says)}</title>'
        f'<polygon class="band" points="{band}"/><polyline class="course" points="{line}"/>'
        f'<circle class="last" cx="{x[-1]:.1f}" cy="{y[-1]:.1f}" r="1.8"/></svg>'
    )


def _place(change: FloatArray, scale: float) -> FloatArray:
    return np.clip(HEIGHT / 2 - change / scale * (HEIGHT / 2 - EDGE), 0.0, HEIGHT)


def _points(pairs: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in pairs)
