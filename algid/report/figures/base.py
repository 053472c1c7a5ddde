"""What every figure is made of, and how its numbers travel to plotly.

Colours are written as tokens, ``@name`` or ``@name/opacity``; the page replaces them by the
colours of the light or dark theme whenever it draws. Foreign text passes through `label`.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.text import visible

Trace = dict[str, Any]
Layout = dict[str, Any]


@dataclass(frozen=True)
class Legend:
    """An entry of a figure's legend, which shows and hides the traces of its `group`.

    They are hidden at first where not `shown`.
    """

    group: str
    words: str
    colour: str
    mark: str = "line"
    shown: bool = True


@dataclass(frozen=True)
class Panel:
    """One drawing area.

    `says` is what a screen reader reads out; `sync` names panels that zoom together.
    """

    traces: list[Trace]
    layout: Layout
    says: str
    title: str = ""
    height: int = 260
    sync: str = ""


@dataclass(frozen=True)
class Figure:
    """A figure: title, panels, legend, a line on how to read it, and a line on its content.

    `views` are stretches of the time axis to choose from: name, start and end.
    """

    key: str
    title: str
    panels: tuple[Panel, ...]
    reading: str
    legend: tuple[Legend, ...] = ()
    note: str = ""
    columns: int = 1
    views: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True)
class Missing:
    """A figure that cannot be drawn, and why; `absent` where nothing of it was written."""

    key: str
    title: str
    why: str
    absent: bool = False


def packed(values: FloatArray, precise: bool = False) -> dict[str, str]:
    """`values` as plotly's typed array: single precision, or double if `precise` or beyond it."""
    size = np.abs(values[np.isfinite(values)])
    kind = "f8" if precise or np.any(size > np.finfo(np.float32).max) else "f4"
    data = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"dtype": kind, "bdata": base64.b64encode(data.tobytes()).decode("ascii")}


def times(x: FloatArray) -> dict[str, str]:
    """Increasing `x` in single precision where its error is below 1 % of the usual step."""
    steps = np.diff(x)
    steps = steps[steps > 0]
    coarse = 1e2 * np.finfo(np.float32).eps * np.abs(x).max() if x.size else 0.0
    return packed(x, precise=bool(steps.size and coarse > np.median(steps)))


def line(
    x: FloatArray,
    y: FloatArray,
    colour: str,
    name: str,
    group: str,
    *,
    width: float = 1.4,
    hover: str = "",
) -> Trace:
    """A line without markers."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": times(x),
        "y": packed(y),
        "name": name,
        "legendgroup": group,
        "line": {"color": colour, "width": width},
        "hovertemplate": hover or f"{name} %{{y:.5g}}<extra></extra>",
    }


def axis(title: str = "", **more: Any) -> Layout:
    """An axis with that title; the rest of its looks comes from the page's template."""
    return {"title": {"text": title}, **more} if title else dict(more)


def label(text: str, longest: int = 40) -> str:
    """Foreign text for plotly, which reads a little HTML: shown as it is, never as markup."""
    shown = visible(text)
    shown = shown if len(shown) <= longest else shown[: longest - 1] + "…"
    return shown.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def upright(x: float, colour: str, dash: str = "dot", yref: str = "paper") -> Layout:
    """A vertical line over the whole panel."""
    return {
        "type": "line",
        "x0": x,
        "x1": x,
        "y0": 0,
        "y1": 1,
        "yref": yref,
        "line": {"color": colour, "width": 1, "dash": dash},
    }


def level(y: float, colour: str, dash: str = "dash", width: float = 1.5) -> Layout:
    """A horizontal line over the whole panel."""
    return {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "y0": y,
        "y1": y,
        "line": {"color": colour, "width": width, "dash": dash},
    }


def band(low: float, high: float, colour: str) -> Layout:
    """A horizontal band over the whole panel, below the traces."""
    return {
        "type": "rect",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "y0": low,
        "y1": high,
        "fillcolor": colour,
        "line": {"width": 0},
        "layer": "below",
    }


def stretch(first: float, last: float, colour: str) -> Layout:
    """A vertical band over the whole panel, below the traces."""
    place = {"yref": "paper", "x0": first, "x1": last, "y0": 0, "y1": 1}
    return {"type": "rect", **place, "fillcolor": colour, "line": {"width": 0}, "layer": "below"}


def between(
    x: FloatArray, low: FloatArray, high: FloatArray, colour: str, group: str = ""
) -> list[Trace]:
    """The area between two series, as their unseen edges."""
    edge = {
        "type": "scatter",
        "mode": "lines",
        "line": {"width": 0},
        "hoverinfo": "skip",
        "x": times(x),
    }
    edge |= {"legendgroup": group} if group else {}
    return [
        {**edge, "y": packed(low)},
        {**edge, "y": packed(high), "fill": "tonexty", "fillcolor": colour},
    ]
