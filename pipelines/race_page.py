"""A page of the race: one dot a contender and figure, on logarithmic axes, and the tables below."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

_WIDTH, _LEFT, _ROW, _TOP, _KEY = 640, 190, 22, 30, 110  # px
_COLOURS = ("#3b82c4", "#d0691f", "#4d9a49", "#a05a9d", "#9a862b")  # seen on white and on black

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
        svg("Median error of k1 … k7, %", error, kinds),
        svg("RMS error over the Cramér-Rao bound", bound, ["RMS"]),
    ]
    if real:
        plots += [
            svg("Repeatability on real runs, %", of_real(lambda r: r["repeatability"]), builds),
            svg(
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


def svg(title: str, series: Series, names: Sequence[str]) -> str:
    """Dots on a logarithmic axis, a row a contender, a colour a name; nothing without figures."""
    every = [v for row in series.values() for v in row.values() if np.isfinite(v) and v > 0]
    if not every:
        return ""
    low, high = np.floor(np.log10(min(every))), np.ceil(np.log10(max(every)))
    span = max(high - low, 1.0)

    def x(value: float) -> float:
        return float(_LEFT + (_WIDTH - _LEFT - 20) * (np.log10(value) - low) / span)

    height = _TOP + _ROW * (len(series) + 1)
    parts = [f'<text x="0" y="16" font-weight="bold">{escape(title)}</text>']
    if len(names) > 1:
        for place, name in enumerate(names):
            left = _WIDTH - _KEY * (len(names) - place)
            parts.append(_dot(left, 12, place, name))
            parts.append(f'<text x="{left + 10}" y="16">{escape(name)}</text>')
    for n in np.arange(low, low + span + 1):
        at = f"{x(10.0**n):.1f}"
        parts.append(f'<path d="M{at} {_TOP}V{height - 22}" stroke="#888" stroke-opacity="0.4"/>')
        parts.append(f'<text x="{at}" y="{height - 6}" text-anchor="middle">{10.0**n:g}</text>')
    for place, (peer, row) in enumerate(series.items()):
        y = _TOP + _ROW * place + 12
        parts.append(f'<text x="{_LEFT - 12}" y="{y + 4}" text-anchor="end">{escape(peer)}</text>')
        for name, value in row.items():
            if np.isfinite(value) and value > 0:
                tip = f"{peer}, {name}: {value:.3g}"
                parts.append(_dot(x(value), y, list(names).index(name), tip))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        f'font-family="system-ui, sans-serif" font-size="12" fill="#7a7a7a">\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def _dot(x: float, y: float, colour: int, tip: str) -> str:
    return (
        f'<circle cx="{x:.1f}" cy="{y}" r="5" fill="{_COLOURS[colour % len(_COLOURS)]}" '
        f'fill-opacity="0.8"><title>{escape(tip)}</title></circle>'
    )
