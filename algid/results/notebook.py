"""A result in a notebook: its verdict, and each estimate with meaning and interval bar."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from algid.model import PARAMETERS
from algid.text import resolved, significant, unit_text, visible
from algid.verdict import MOST_REASONS

if TYPE_CHECKING:
    from algid.results.model import Estimate, Result

_HEADING = (
    "Parameter",
    "Meaning",
    "Estimate",
    "± std",
    "95 % interval, the line at zero",
    "Unit",
    "Status",
)
_WIDTH, _HEIGHT = 120, 12
"""Of a bar, in pixels."""


def html_of(result: Result, title: str) -> str:
    """The verdict with its first reasons, and a table of the estimates under `title`."""
    judged = result.verdict
    reasons = "".join(f"<li>{_text(one.text)}</li>" for one in judged.reasons[:MOST_REASONS])
    verdict = f"<p><strong>{judged.word}</strong>: {_text(judged.headline)}.</p><ul>{reasons}</ul>"
    head = "".join(f"<th>{cell}</th>" for cell in _HEADING)
    body = "".join(_row(name, estimate) for name, estimate in result.estimates.items())
    caption = f"<caption>{html.escape(title)}</caption>"
    return f"{verdict}<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _row(name: str, found: Estimate) -> str:
    meaning = PARAMETERS[name].meaning if name in PARAMETERS else ""
    value, std = resolved(found.estimate, found.std), significant(found.std, 2)
    unit = unit_text(found.unit).replace(" ", "\u00a0")  # on one line
    before, after = (name, meaning, value, std), (unit, found.status.value)
    cells = [*map(_text, before), interval_bar(found), *map(_text, after)]
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _text(text: str) -> str:
    return html.escape(visible(text, 1000))


def interval_bar(found: Estimate) -> str:
    """An SVG of the estimate and its 95 % interval, on a scale from zero to the interval's end.

    A wide bar is an interval as large as the estimate; empty where there is no bounded interval.
    """
    low, high = found.ci95 or (None, None)
    if found.estimate is None or low is None or high is None:
        return ""
    first, last = min(low, 0.0), max(high, 0.0)
    span = last - first
    if not span > 0:
        return ""

    def place(value: float) -> float:
        return 1 + (_WIDTH - 2) * (value - first) / span

    words = f"{low:.6g} to {high:.6g}"
    width = max(1.0, place(high) - place(low))
    return (
        f'<svg width="{_WIDTH}" height="{_HEIGHT}" role="img" '
        f'aria-label="{words}"><title>{words}</title>'
        f'<rect x="{place(low):.1f}" y="3" width="{width:.1f}" height="6" fill="currentColor" '
        'opacity="0.4"/>'
        f'<path d="M{place(0.0):.1f} 0v{_HEIGHT}" stroke="currentColor" opacity="0.4"/>'
        f'<circle cx="{place(found.estimate):.1f}" cy="6" r="2" fill="currentColor"/></svg>'
    )
