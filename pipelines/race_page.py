"""A page of the race: one dot a contender and figure, on logarithmic axes, and the tables below."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

_WIDTH, _LEFT, _ROW = 640, 190, 22  # px
_COLOURS = ("#1c5d99", "#b8500f", "#3d7a3a", "#7a3d78", "#7a6a1f")

Series = Mapping[str, Mapping[str, float]]
"""By contender its figures by name."""


def page(simulated: Sequence[Any], real: Sequence[Any], text: str) -> str:
    """HTML with plots of the rows of a race, and its `text` in Markdown."""
    peers = list(dict.fromkeys(row["peer"] for row in simulated))
    kinds = list(dict.fromkeys(row["logs"] for row in simulated))
    error = {
        peer: {
            kind: _middle(v for row in _of(simulated, peer, kind) for v in row["error_percent"])
            for kind in kinds
        }
        for peer in peers
    }
    bound = {
        peer: {"RMS": _rms(v for row in _of(simulated, peer) for v in row["over_bound"] or ())}
        for peer in peers
    }
    builds = list(dict.fromkeys(row["build"] for row in real))

    def of_real(value: Callable[[Any], float | None]) -> Series:
        found: dict[str, dict[str, float]] = {peer: {} for peer in peers}
        for row in real:
            number = value(row)
            if number is not None:
                found[row["peer"]][row["build"]] = number
        return found

    plots = [
        _plot("Median error of k1 … k7, %", error, kinds),
        _plot("RMS error over the Cramér-Rao bound", bound, ["RMS"]),
    ]
    if real:
        plots += [
            _plot("Repeatability on real runs, %", of_real(lambda r: r["repeatability"]), builds),
            _plot(
                "Held-out RMSE of joint 1, N m",
                of_real(lambda r: None if r["held_out"] is None else r["held_out"][0]),
                builds,
            ),
        ]
    style = "body{font:15px system-ui;max-width:60rem;margin:2rem auto;padding:0 1rem}"
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>The '
        f"race</title><style>{style}"
        f"pre{{overflow-x:auto;font-size:12px}}</style><h1>The race</h1>{''.join(plots)}"
        f"<h2>Tables</h2><pre>{escape(text)}</pre></html>\n"
    )


def _of(rows: Sequence[Any], peer: str, kind: str | None = None) -> list[Any]:
    return [row for row in rows if row["peer"] == peer and kind in (None, row["logs"])]


def _middle(values: Any) -> float:
    found = [value for value in values if value is not None and np.isfinite(value)]
    return float(np.median(found)) if found else np.nan


def _rms(values: Any) -> float:
    found = [value for value in values if value is not None and np.isfinite(value)]
    return float(np.sqrt(np.mean(np.square(found)))) if found else np.nan


def _plot(title: str, series: Series, names: Sequence[str]) -> str:
    """Dots on a logarithmic axis, a row a contender, a colour a name."""
    every = [v for row in series.values() for v in row.values() if np.isfinite(v) and v > 0]
    if not every:
        return ""
    low, high = np.floor(np.log10(min(every))), np.ceil(np.log10(max(every)))
    span = max(high - low, 1.0)

    def x(value: float) -> float:
        return float(_LEFT + (_WIDTH - _LEFT - 20) * (np.log10(value) - low) / span)

    height = _ROW * (len(series) + 2)
    parts = [
        f'<line x1="{x(10.0**n):.1f}" x2="{x(10.0**n):.1f}" y1="5" y2="{height - 30}" '
        'stroke="#ddd"/>'
        f'<text x="{x(10.0**n):.1f}" y="{height - 14}" text-anchor="middle">{10.0**n:g}</text>'
        for n in np.arange(low, low + span + 1)
    ]
    for place, (peer, row) in enumerate(series.items()):
        y = _ROW * (place + 1) - 4
        parts.append(f'<text x="{_LEFT - 12}" y="{y + 4}" text-anchor="end">{escape(peer)}</text>')
        for name, value in row.items():
            if np.isfinite(value) and value > 0:
                colour = _COLOURS[list(names).index(name) % len(_COLOURS)]
                tip = escape(f"{peer}, {name}: {value:.3g}")
                parts.append(
                    f'<circle cx="{x(value):.1f}" cy="{y}" r="5" fill="{colour}" '
                    'fill-opacity="0.8">'
                    f"<title>{tip}</title></circle>"
                )
    legend = " ".join(
        f'<span style="color:{_COLOURS[n % len(_COLOURS)]}">● {escape(name)}</span>'
        for n, name in enumerate(names)
    )
    return (
        f"<h2>{escape(title)}</h2><p>{legend}</p><svg viewBox='0 0 {_WIDTH} {height}' "
        f"style='width:100%;font-size:12px'>{''.join(parts)}</svg>"
    )
