"""Which seconds of the logs determine each parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.blocks import concatenated, stacked
from algid.report.figures.base import Figure, Layout, Missing, Panel, axis, label, packed, times
from algid.report.figures.timeline import offsets, separators
from algid.report.reduce import Block, blocks, by_log, columns_of
from algid.report.series import LogRange
from algid.results import Result
from algid.text import significant

TITLE = "Information per second of log"
MOST_CELLS = 600
Scale = list[list[Any]]
SCALE: Scale = [[0, "@page"], [0.5, "@blue/0.55"], [1, "@blue"]]


def information(path: Path, result: Result) -> Figure | Missing:
    """Each parameter's information, in shares of what all logs gave it."""
    names = [name for name in columns_of(path) if name not in ("log", "t")]
    logs = list(by_log(blocks(path, ["log", "t", *names])))
    if not names or not logs:
        return Missing("information", TITLE, f"{path.name} holds no second")
    x, gained, ranges = _summed(names, logs)
    total = gained.sum(axis=1, keepdims=True)
    shares = 100 * np.divide(gained, total, out=np.zeros_like(gained), where=total > 0)
    reading = (
        "Read: strongly coloured seconds tell most; a row with colour in one place only "
        "rests on that moment."
    )
    panel = information_panel(
        names, x, shares, SCALE, separators(ranges, offsets(ranges), result.logs)
    )
    return Figure("information", TITLE, (panel,), reading, note=_note(names, x, shares))


def _summed(
    names: list[str], found: list[tuple[int, Block]]
) -> tuple[FloatArray, FloatArray, dict[int, LogRange]]:
    """Middles of the stretches in running time, their information (names, m), each log's range.

    Information adds up, so that the seconds of a long log are summed, not thinned.
    """
    ranges: dict[int, LogRange] = {}
    for log, block in found:
        span = ranges.setdefault(log, LogRange(float(block["t"][0]), 0.0))
        span.last = float(block["t"][-1]) + 1.0
    moved = offsets(ranges)
    x = np.concatenate([block["t"] + 0.5 + moved[log] for log, block in found])
    gained = stacked(concatenated([block for _, block in found]), names)
    step = int(np.ceil(x.size / MOST_CELLS))
    starts = np.arange(0, x.size, step)
    counts = np.diff(starts, append=x.size)
    return (
        np.add.reduceat(x, starts) / counts,
        np.add.reduceat(np.nan_to_num(gained), starts, axis=1),
        ranges,
    )


def information_panel(
    names: Sequence[str],
    x: FloatArray,
    shares: FloatArray,
    scale: Scale,
    more: Layout | None = None,
) -> Panel:
    """Percent `shares` (Q, n) of each parameter's information at times `x` (n,) in s.

    `more` joins the layout.
    """
    trace = {
        "type": "heatmap",
        "x": times(x),
        "y": [label(name) for name in names],
        "z": {**packed(shares), "shape": f"{shares.shape[0]}, {shares.shape[1]}"},
        "zmin": 0,
        "zmax": float(shares.max()) or 1.0,
        "colorscale": scale,
        "ygap": 3,
        "hovertemplate": "%{y}: %{z:.3g} % of its information<br>about %{x:.1f} s<extra></extra>",
        "colorbar": {"thickness": 10, "outlinewidth": 0, "ticksuffix": " %", "nticks": 4},
    }
    layout = {
        "xaxis": axis("time, s", showgrid=False),
        "yaxis": axis(type="category", autorange="reversed", showgrid=False),
        **(more or {}),
    }
    return Panel(
        [trace],
        layout,
        "Share of each parameter's information by time",
        height=120 + 28 * len(names),
    )


def _note(names: list[str], x: FloatArray, shares: FloatArray) -> str:
    """Least share of time with half of a parameter's information, of the most uneven parameter."""
    half = {}
    for name, row in zip(names, shares, strict=True):
        most = np.cumsum(np.sort(row)[::-1])
        if row.any():
            half[name] = float(np.searchsorted(most, 0.5 * most[-1]) + 1) / row.size
    if len(half) < 2 or x.size < 4:
        return ""
    poorest = min(half, key=lambda name: half[name])
    return (
        f"Half of what is known of {poorest} comes from {significant(100 * half[poorest], 2)} "
        "% of the time."
    )
