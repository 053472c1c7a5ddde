"""How every panel looks: plotly's template, in the page's colours."""

from __future__ import annotations

from typing import Any

_AXIS: dict[str, Any] = {
    "gridcolor": "@grid",
    "linecolor": "@line",
    "zerolinecolor": "@line",
    "zerolinewidth": 1,
    "tickcolor": "@line",
    "tickfont": {"color": "@muted", "size": 12},
    "title": {"font": {"color": "@muted", "size": 12}, "standoff": 6},
    "automargin": True,
    "exponentformat": "power",
}

TEMPLATE: dict[str, Any] = {
    "layout": {
        "font": {"family": "system-ui, -apple-system, Segoe UI, Roboto, sans-serif", "size": 12, "color": "@ink"},
        "paper_bgcolor": "@page",
        "plot_bgcolor": "@page",
        "margin": {"l": 58, "r": 12, "t": 22, "b": 40},
        "showlegend": False,
        "hoverlabel": {"bgcolor": "@card", "bordercolor": "@line", "font": {"color": "@ink", "size": 12}},
        "modebar": {"bgcolor": "@page/0", "color": "@muted", "activecolor": "@ink"},
        "xaxis": _AXIS,
        "yaxis": _AXIS,
        "coloraxis": {},
    },
    "data": {"heatmap": [{"colorbar": {"tickfont": {"color": "@muted"}}}]},
}
