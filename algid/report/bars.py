"""Bars either side of zero, on one scale: what each of several things changes."""

from __future__ import annotations

from collections.abc import Mapping

from algid.report.html import escaped

WIDTH, HEIGHT = 120.0, 14.0  # of a row's drawing, pixels
LEAST = 1.0  # of the scale's end: changes all below are shown as small as they are


def bars(values: Mapping[str, float]) -> dict[str, str]:
    """A drawing a row: a bar from zero in the middle, to the left where the value is negative."""
    scale = max(LEAST, *(abs(value) for value in values.values()))
    return {name: _bar(name, value, scale) for name, value in values.items()}


def _bar(name: str, value: float, scale: float) -> str:
    middle = WIDTH / 2
    length = abs(value) / scale * (middle - 2)
    left = middle - length if value < 0 else middle
    kind = "less" if value < 0 else "more"
    return (
        f'<svg class="forest" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}" height="{HEIGHT:g}" role="img" '
        f'aria-label="{escaped(name)}: {value:+.2f}"><rect class="{kind}" x="{left:.1f}" y="2" width="{length:.1f}" '
        f'height="{HEIGHT - 4:g}"/><line class="zero" x1="{middle:g}" y1="0" x2="{middle:g}" y2="{HEIGHT:g}"/></svg>'
    )
