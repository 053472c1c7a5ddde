"""What a page's script draws, as plain data: panels for plotly, and the arm with its motion.

Texts that plotly shows may hold a little HTML: every name passes through `label`.
"""

from __future__ import annotations

import base64
import html
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.base.text import visible

LONGEST = 55
FRAME, TICKS = 24, 55
"""Pixels of a figure around its panels, less those below the last; of a panel below its drawing."""
FRAMES = 30.0  # a second
MOST_FRAMES = 6_000


class Panels:
    """A figure: a grid of panels with a common legend, counted row by row from 0.

    Parameters
    ----------
    key : by which `figures.toml` has the figure's title, how to read it, and its grid
    titles : one a panel, where the file has none
    height : int
        Pixels of a panel, where the file has none.
    """

    note = ""
    """What it shows in words."""

    def __init__(self, key: str, titles: Sequence[str] = (), height: int = 240) -> None:
        usual = {"titles": titles, "height": height, "columns": 1, "layout": {}, "curves": ()}
        own: dict[str, Any] = usual | _data()["figures"][key]
        self.key, self.title, self.reading = key, own["title"], own["reading"]
        self.curves = own["curves"]
        rows = -(-len(own["titles"]) // own["columns"])
        grid = {"rows": rows, "columns": own["columns"], "pattern": "independent"}
        self.data: list[dict[str, Any]] = []
        self.layout: dict[str, Any] = own["layout"] | {
            "grid": grid | {"xgap": 0.12, "ygap": TICKS / own["height"]},
            "shapes": [],
            "annotations": [],
            "height": own["height"] * rows + FRAME,
        }
        for place, words in enumerate(own["titles"]):
            self.axes(place, {"matches": "x"} if place and "together" in own else "")
            self.text(place, words)

    def axes(self, place: int, x: dict[str, Any] | str = "", y: dict[str, Any] | str = "") -> None:
        """Set more of a panel's axes, their titles, or what `figures.toml` has of such a title."""
        for name, given in ((ref("xaxis", place), x), (ref("yaxis", place), y)):
            if isinstance(given, str):
                given = _data()["axes"].get(given, {"title": {"text": given}})
            self.layout[name] = self.layout.get(name, {}) | given

    def add(self, place: int, x: Any, y: Any, name: str, look: str = "", **more: Any) -> None:
        """Add a trace that looks as `look` or its name says, or is a plain curve.

        The first one of a name stands in the legend.
        """
        shown, looks = label(name), _data()["looks"]
        trace = {"type": "scatter", "x": packed(x), "y": packed(y), "name": shown}
        trace |= {"legendgroup": shown, "showlegend": all(o["name"] != shown for o in self.data)}
        trace |= {"xaxis": ref("x", place), "yaxis": ref("y", place)}
        self.data.append(trace | looks.get(look or name, looks["curve"]) | more)

    def draw(self, place: int, x: FloatArray, of: Any) -> None:
        """Add the curves that `figures.toml` has of a panel, `of` their columns by name."""
        for column, name in self.curves[place].items():
            self.add(place, x, of[column], name)

    def band(self, place: int, x: FloatArray, low: FloatArray, high: FloatArray, name: str) -> None:
        """Add the area between two series, an area for each stretch without a gap."""
        known = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
        for part in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
            around = np.concatenate([part, part[::-1]])
            ends = np.concatenate([high[part], low[part][::-1]])
            self.add(place, x[around], ends, name, "band")

    def mark(self, place: int, look: str, low: Any, high: Any = None, way: str = "x") -> None:
        """Add a line over the whole panel where an axis is `low`, or a band up to `high`."""
        over = "y" if way == "x" else "x"
        ends = {f"{way}0": low, f"{way}1": low if high is None else high, f"{over}0": 0}
        ends |= {f"{over}1": 1, f"{over}ref": f"{ref(over, place)} domain"}
        ends[f"{way}ref"] = ref(way, place)
        self.layout["shapes"].append(_data()["marks"][look] | ends)

    def heat(self, names: Sequence[str], x: Any, z: FloatArray, **more: Any) -> None:
        """Fill the only panel with a map of numbers, a row a name."""
        rows = list(map(label, names))
        self.add(0, x, rows, "map", self.key, z=packed(z), ygap=3, showlegend=False, **more)
        self.axes(0, y="names")
        self.layout["height"] = 110 + 30 * len(rows)

    def text(self, place: int, words: str, x: Any = None) -> None:
        """Add a text at the top of a panel, at `x`; without one it is the panel's title."""
        at = {"text": label(words), "x": x, "xref": ref("x", place), "yanchor": "top"}
        if x is None:
            at = {"text": f"<b>{at['text']}</b>", "x": 0, "yanchor": "bottom"}
            at["xref"] = f"{ref('x', place)} domain"
        at |= {"y": 1, "yref": f"{ref('y', place)} domain", "xanchor": "left", "showarrow": False}
        self.layout["annotations"].append(at)


def down(key: str, over: str, names: Sequence[str], limit: float) -> Panels:
    """A panel for points beside names, the first one at the top, within ± `limit`."""
    panels = Panels(key, [over], 60 + 22 * len(names))
    panels.axes(0, {"range": [-limit, limit]}, "names")
    panels.axes(0, y={"categoryarray": names})
    return panels


@cache
def _data() -> dict[str, dict[str, Any]]:
    """What is the same on every page: of figures by their keys, and looks of traces and marks."""
    file = resources.files(__package__) / "templates/figures.toml"
    return tomllib.loads(file.read_text("utf-8"))


def ref(name: str, place: int) -> str:
    """What plotly calls an axis of a panel: x, x2, x3."""
    return f"{name}{place + 1}" if place else name


def label(text: str) -> str:
    """Foreign text for plotly, shown as it is, never as markup."""
    return html.escape(visible(text, LONGEST), quote=False)


def packed(values: Any) -> Any:
    """Numbers as plotly's typed array.

    In single precision, unless they are integers, such as dates, or beyond it.
    """
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        return values
    with np.errstate(over="ignore"):
        made = values.astype("<f4")
    if values.dtype.kind != "f" or np.isinf(made).any():
        made = values.astype("<f8")
    shape = {} if values.ndim == 1 else {"shape": ", ".join(map(str, values.shape))}
    return {
        "dtype": made.dtype.str[1:],
        "bdata": base64.b64encode(made.tobytes()).decode(),
        **shape,
    }


@dataclass(frozen=True, eq=False)
class ArmDrawing:
    """The arm to scale, which stands as its motion begins; a script plays that and draws its path.

    Parameters
    ----------
    l1, l2 : float, m
    t : (N,), s, increasing
    theta : (2, N), rad, θ1 from the horizontal, θ2 from link 1
    reading : str
        One line that says what to look at.
    payload : str
        What hangs at the tip, in words; empty where nothing does.
    height : float, m, or None
        Below which the tip may not come.
    aside : float, m
        How far beside link 2's line the payload's centre of mass lies.
    """

    l1: float
    l2: float
    t: FloatArray
    theta: FloatArray
    reading: str
    payload: str = ""
    height: float | None = None
    aside: float = 0.0

    @property
    def frames(self) -> dict[str, list[float]]:
        """Times and angles at `FRAMES` a second, fewer of a long motion."""
        first, last = self.t[0], self.t[-1]
        t = np.linspace(first, last, 2 + int(min((last - first) * FRAMES, MOST_FRAMES)))
        frames = {"t": t}
        for joint, angle in enumerate(self.theta, start=1):
            frames[f"theta{joint}"] = np.interp(t, self.t, angle)
        return {name: values.round(3).tolist() for name, values in frames.items()}
