"""A forest plot beside a table of estimates: each row's 95 % interval on one scale of percent of the estimate."""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from algid.report.html import escaped
from algid.report.text import significant
from algid.results import Estimate

WIDTH, HEIGHT = 124.0, 22.0  # of a row's drawing, pixels
EDGE = 8.0  # where an arrow tells that an interval goes on
WIDEST = 100.0  # percent: an interval beyond says little more than the estimate's size
ROOM = 1.15  # of the widest interval
MOST = 2.5  # of the median interval: wider ones end in arrows, so that they do not hide the others
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
    """Drawings of the estimates of `group` that have an interval.

    Parameters
    ----------
    group : estimates by name
    truth : what a synthetic log was made with, by name: drawn as a ring
    logs : each log's own estimates by name: drawn as dots
    """
    shares = {name: _share(found) for name, found in group.items()}
    known = {name: share for name, share in shares.items() if share is not None}
    limit = _limit(list(known.values()))
    rows = {
        name: _row(name, group[name], share, limit, (truth or {}).get(name), (logs or {}).get(name, ()))
        for name, share in known.items()
    }
    return Forest(rows, limit)


def _share(found: Estimate) -> float | None:
    """Half the interval in percent of the estimate's size; infinite about zero, None where there is none."""
    if found.estimate is None or found.ci95 is None or found.ci95[0] is None or found.ci95[1] is None:
        return None
    half = (found.ci95[1] - found.ci95[0]) / 2
    return 100 * half / abs(found.estimate) if found.estimate else math.inf


def _limit(shares: Sequence[float]) -> float:
    """The scale that holds every interval, or where a few are far wider than most, all but those."""
    widest = max(shares, default=0.0) * ROOM
    usual = MOST * statistics.median(shares) if shares else 0.0
    return _round_up(min(widest, usual, WIDEST))


def _round_up(value: float) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in STEPS if step * power >= value * (1 - 1e-9))


def _row(name: str, found: Estimate, share: float, limit: float, truth: float | None, logs: Sequence[float]) -> str:
    size = abs(found.estimate or 0.0)

    def place(value: float) -> float:
        """Where a value stands, in pixels; beyond the edges where it is beyond the scale."""
        off = 100 * (value - (found.estimate or 0.0)) / size / limit if size else 0.0
        return WIDTH / 2 * (1 + off * (1 - 2 * EDGE / WIDTH))

    reach = min(share / limit, 1.0) * (WIDTH / 2 - EDGE)
    middle, y = WIDTH / 2, HEIGHT / 2
    ends = (
        f'<path class="end" d="M{EDGE:g} {y - 4:g} L1 {y:g} L{EDGE:g} {y + 4:g} M{WIDTH - EDGE:g} {y - 4:g} '
        f'L{WIDTH - 1:g} {y:g} L{WIDTH - EDGE:g} {y + 4:g}"/>'
        if share > limit
        else ""
    )
    dots = "".join(_dot(place(value), y + 6) for value in logs)
    ring = (
        f'<circle class="truth" cx="{place(truth):.1f}" cy="{y:g}" r="4"/>'
        if truth is not None and 0 <= place(truth) <= WIDTH
        else ""
    )
    width = "wider than its value" if share > WIDEST else f"± {significant(share, 2)} %"
    return (
        f'<svg class="forest" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}" height="{HEIGHT:g}" role="img" '
        f'aria-label="{escaped(name)}: {width}"><line class="zero" x1="{middle:g}" y1="0" x2="{middle:g}" '
        f'y2="{HEIGHT:g}"/><line class="reach" x1="{middle - reach:.1f}" y1="{y:g}" x2="{middle + reach:.1f}" '
        f'y2="{y:g}"/>{ends}<circle class="value" cx="{middle:g}" cy="{y:g}" r="2.5"/>{dots}{ring}</svg>'
    )


def _dot(x: float, y: float) -> str:
    """A log's own estimate; hollow at the edge where it lies beyond."""
    if 0 <= x <= WIDTH:
        return f'<circle class="log" cx="{x:.1f}" cy="{y:g}" r="1.8"/>'
    return f'<circle class="log beyond" cx="{2.5 if x < 0 else WIDTH - 2.5:g}" cy="{y:g}" r="1.8"/>'
