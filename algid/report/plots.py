"""Figures for papers: each figure of a page as PDF or PNG, drawn by matplotlib."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from algid.arm import FloatArray
from algid.errors import SettingError
from algid.files import whole_file
from algid.options import flag
from algid.report.figures.base import Figure, Legend, Missing, Panel, Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Form = Literal["pdf", "png"]
WIDTH = 7.1  # inches: two columns of a journal
INCHES = 1 / 96  # of a page's pixel
POINTS = 0.75  # of a page's pixel
DPI = 200
UPRIGHT = 6  # names of logs: more stand upright
MISSING = (
    f"{flag('save_plots')}: expected matplotlib, found none; install it with: pip install "
    "'algid[plots]'"
)
STYLE: Any = {"font.size": 8, "axes.titlesize": 8, "pdf.fonttype": 42}
DASHES: dict[str, Any] = {"dash": "--", "dot": ":", "solid": "-"}


def save_plots(
    figures: Sequence[Figure | Missing], folder: Path, prefix: str, form: Form = "pdf"
) -> list[Path]:
    """Write each figure that there is as `folder`/`prefix`-KEY.`form`.

    Raises
    ------
    SettingError
        If matplotlib is not installed.
    OutputError
        If a file cannot be written.
    """
    try:
        import matplotlib as mpl
    except ImportError as error:
        raise SettingError(MISSING) from error
    written = []
    for figure in figures:
        if isinstance(figure, Missing):
            continue
        path = folder / f"{prefix}-{figure.key}.{form}"
        with mpl.rc_context(STYLE), whole_file(path) as temporary, temporary.open("wb") as stream:
            _save(figure, stream, form)
        written.append(path)
    return written


def _save(figure: Figure, stream: Any, form: Form) -> None:
    from matplotlib.figure import Figure as Sheet

    columns = min(figure.columns, len(figure.panels))
    rows = -(-len(figure.panels) // columns)
    tallest = max(panel.height for panel in figure.panels)
    sheet = Sheet(
        figsize=(WIDTH, 0.4 + rows * tallest * INCHES * (0.75 if columns > 1 else 1.0)),
        layout="constrained",
    )
    colours = Colours()
    cells = sheet.add_gridspec(rows, columns)
    hidden = {entry.group for entry in figure.legend if not entry.shown}
    for place, whole in enumerate(figure.panels):
        seen = [trace for trace in whole.traces if trace.get("legendgroup") not in hidden]
        panel = replace(whole, traces=seen)
        _panel(sheet, cells[place // columns, place % columns], panel, colours)
    marks = [_mark(entry, colours) for entry in figure.legend if entry.shown]
    if marks:
        sheet.legend(
            handles=marks, loc="outside upper left", ncols=min(len(marks), 3), frameon=False
        )
    metadata = {"CreationDate": None} if form == "pdf" else {"Software": None}
    sheet.savefig(stream, format=form, dpi=DPI, metadata=metadata)


class Colours:
    """The page's colours by day."""

    def __init__(self) -> None:
        style = (resources.files("algid.report") / "assets" / "report.css").read_text(
            encoding="utf-8"
        )
        light = style.partition("@media")[0]
        self._known = dict(re.findall(r"--([\w-]+): (#\w{6})", light))

    def __call__(self, token: str) -> tuple[str, float]:
        """Colour and opacity of ``@name/opacity``."""
        name, _, opacity = token.removeprefix("@").partition("/")
        return self._known[name], float(opacity or 1)


def _mark(entry: Legend, colours: Colours) -> Any:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour, opacity = colours(entry.colour)
    if entry.mark == "area":
        return Patch(facecolor=colour, alpha=opacity, label=_text(entry.words))
    return Line2D(
        [],
        [],
        color=colour,
        alpha=opacity,
        linestyle=DASHES.get(entry.mark, "-"),
        label=_text(entry.words),
    )


def _panel(sheet: Any, cell: Any, panel: Panel, colours: Colours) -> None:
    layout = panel.layout
    lower = layout.get("yaxis2", {})
    if "domain" in lower:  # the residual below the torque
        heights = [
            layout["yaxis"]["domain"][1] - layout["yaxis"]["domain"][0],
            lower["domain"][1] - lower["domain"][0],
        ]
        top, bottom = cell.subgridspec(2, 1, height_ratios=heights, hspace=0.08).subplots(
            sharex=True
        )
        axes = {"y": top, "y2": bottom}
        top.tick_params(labelbottom=False)
    else:
        top = bottom = sheet.add_subplot(cell)
        axes = {"y": top, "y2": top.twinx()} if lower else {"y": top}
        if lower:
            axes["y2"].set_ylim(*lower["range"])
            axes["y2"].set_axis_off()
    if panel.title:
        top.set_title(_text(panel.title), loc="left", fontweight="bold")
    before: dict[str, Trace] = {}
    for trace in panel.traces:
        on = axes.get(trace.get("yaxis", "y"), top)
        _trace(on, trace, before.get(trace.get("yaxis", "y")), colours)
        before[trace.get("yaxis", "y")] = trace
    for shape in layout.get("shapes", ()):
        for one in {id(top): top, id(bottom): bottom}.values():
            _shape(one, shape, colours)
    for note in layout.get("annotations", ()):
        top.text(
            note["x"],
            1.0,
            _text(note["text"]),
            transform=top.get_xaxis_transform(),
            va="bottom",
            size=6,
            rotation=90 if len(layout["annotations"]) > UPRIGHT else 0,
        )
    _axes(bottom, layout.get("xaxis", {}), "x")
    _axes(top, layout["yaxis"], "y")
    if "domain" in lower:
        _axes(bottom, lower, "y")
    for one in axes.values():
        one.grid(visible=True, color="#e4e8ee", linewidth=0.5)
        one.set_axisbelow(True)


def _text(words: str) -> str:
    """A page's words as they are: no entity of HTML, no formula of matplotlib."""
    return html.unescape(words).replace("$", r"\$")


def _values(packed: Any) -> Any:
    """What stands behind a typed array, a list of numbers, of dates or of names."""
    if isinstance(packed, Mapping):
        return np.frombuffer(base64.b64decode(packed["bdata"]), dtype=f"<{packed['dtype']}").astype(
            np.float64
        )
    if packed and isinstance(packed[0], str):
        try:
            return np.array(packed, dtype="datetime64[ms]")
        except ValueError:
            return packed
    return np.asarray(packed, dtype=np.float64)


def _trace(axes: Axes, trace: Trace, before: Trace | None, colours: Colours) -> None:
    if trace["type"] == "heatmap":
        _heatmap(axes, trace, colours)
        return
    x, y = _values(trace["x"]), _values(trace["y"])
    fill = trace.get("fill")
    if fill:
        _filled(axes, x, y, fill, before, colours(trace["fillcolor"]))
    line = trace.get("line", {})
    if "lines" in trace["mode"] and line.get("width", 1) > 0:
        colour, opacity = colours(line["color"])
        steps = "steps-post" if line.get("shape") == "hv" else "default"
        dash = DASHES[line.get("dash", "solid")]
        width = POINTS * line.get("width", 1.4)
        axes.plot(
            x, y, color=colour, alpha=opacity, linewidth=width, linestyle=dash, drawstyle=steps
        )
    if "markers" in trace["mode"]:
        marker = trace.get("marker", {})
        colour, opacity = colours(marker.get("color", line.get("color", "@blue")))
        alpha = opacity * marker.get("opacity", 1.0)
        axes.plot(
            x,
            y,
            "o",
            color=colour,
            alpha=alpha,
            markersize=POINTS * marker.get("size", 6),
            markeredgewidth=0,
        )
    for way in ("x", "y"):
        if error := trace.get(f"error_{way}"):
            ends: dict[str, Any] = {f"{way}err": np.asarray(error["array"])}
            axes.errorbar(
                x, y, **ends, fmt="none", ecolor=colours(error["color"])[0], elinewidth=1.2
            )


def _filled(
    axes: Axes, x: Any, y: Any, fill: str, before: Trace | None, colour: tuple[str, float]
) -> None:
    face: dict[str, Any] = {"color": colour[0], "alpha": colour[1], "linewidth": 0}
    if fill == "toself":
        for part in np.split(np.arange(x.size), np.flatnonzero(np.isnan(y))):
            kept = part[np.isfinite(y[part])]
            if kept.size > 2:
                axes.fill(x[kept], y[kept], **face)
        return
    other = _values(before["y"]) if fill == "tonexty" and before is not None else np.zeros_like(y)
    axes.fill_between(x, y, other, **face)


def _heatmap(axes: Axes, trace: Trace, colours: Colours) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    rows, columns = map(int, trace["z"]["shape"].split(","))
    z = _values(trace["z"]).reshape(rows, columns)
    x = _values(trace["x"])
    scale = [(place, _blended(colours(token))) for place, token in trace["colorscale"]]
    shades = LinearSegmentedColormap.from_list("page", scale)
    named = isinstance(x, list)
    centres: FloatArray = np.arange(columns, dtype=np.float64) if named else x
    middle = 0.5 * (centres[1:] + centres[:-1])
    half = middle[0] - centres[0] if middle.size else 0.5
    edges = np.concatenate([[centres[0] - half], middle, [centres[-1] + half]])
    limits: dict[str, Any] = {"vmin": trace.get("zmin"), "vmax": trace.get("zmax")}
    drawn = axes.pcolormesh(edges, np.arange(rows + 1) - 0.5, z, cmap=shades, **limits)
    axes.figure.colorbar(drawn, ax=axes, shrink=0.9, aspect=30)
    axes.set_yticks(range(rows), list(map(_text, trace["y"])))
    if named:
        axes.set_xticks(range(columns), list(map(_text, x)))
    if "texttemplate" in trace:
        for i, j in np.ndindex(rows, columns):
            if np.isfinite(z[i, j]):
                axes.text(j, i, f"{z[i, j]:.2f}", ha="center", va="center", size=6)


def _blended(colour: tuple[str, float]) -> tuple[float, ...]:
    """A pale colour on white."""
    shade, opacity = colour
    return tuple(1 - opacity * (1 - part / 255) for part in bytes.fromhex(shade[1:7]))


def _shape(axes: Axes, shape: Mapping[str, Any], colours: Colours) -> None:
    over_x, over_y = shape.get("xref") == "paper", shape.get("yref") == "paper"
    if shape["type"] == "rect":
        colour, opacity = colours(shape["fillcolor"])
        face: dict[str, Any] = {"color": colour, "alpha": opacity, "linewidth": 0, "zorder": 0.5}
        if over_x:
            axes.axhspan(shape["y0"], shape["y1"], **face)
        elif over_y:
            axes.axvspan(shape["x0"], shape["x1"], **face)
        else:
            axes.fill_between([shape["x0"], shape["x1"]], shape["y0"], shape["y1"], **face)
        return
    colour, opacity = colours(shape["line"]["color"])
    line: dict[str, Any] = {
        "color": colour,
        "alpha": opacity,
        "linewidth": POINTS * shape["line"].get("width", 1),
        "linestyle": DASHES[shape["line"].get("dash", "solid")],
    }
    if over_x:
        axes.axhline(shape["y0"], **line)
    else:
        axes.axvline(shape["x0"], **line)


def _axes(axes: Axes, layout: Mapping[str, Any], way: Literal["x", "y"]) -> None:
    """Title, scale, ticks and range of one axis."""
    one = getattr(axes, f"{way}axis")
    one.set_label_text(_text(layout.get("title", {}).get("text", "")))
    logarithmic = layout.get("type") == "log"
    if logarithmic:
        getattr(axes, f"set_{way}scale")("log")
    if "ticktext" in layout:
        one.set_ticks(list(layout["tickvals"]), list(map(_text, layout["ticktext"])))
        one.set_ticks([], minor=True)
    if layout.get("range") is not None:
        low, high = layout["range"]
        getattr(axes, f"set_{way}lim")(*((10.0**low, 10.0**high) if logarithmic else (low, high)))
    elif layout.get("autorange") == "reversed":
        one.set_inverted(True)
    elif layout.get("rangemode") == "tozero":
        getattr(axes, f"set_{way}lim")(**{"bottom" if way == "y" else "left": 0.0})
