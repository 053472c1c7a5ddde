"""Which estimates err together: the correlation matrix."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.report.figures.base import Figure, Missing, Panel, axis, label, packed
from algid.results import Result
from algid.text import joined

TITLE = "Correlation of the estimates"
STRONG = 0.95
MOST_WRITTEN = 14
SCALE = [[0, "@orange/0.5"], [0.5, "@page/0"], [1, "@blue/0.5"]]  # pale enough to write on


def correlation(result: Result) -> Figure | Missing:
    """The covariance scaled to ones on the diagonal."""
    if result.fit is None or not result.fit.covariance:
        return Missing(
            "correlation",
            TITLE,
            f"the estimator {result.estimator} gives no covariance",
            absent=True,
        )
    names = result.fit.covariance_names
    matrix = correlation_matrix(result.fit.covariance)
    reading = (
        "Read: a strong colour off the diagonal means two estimates err together: trust "
        "their combination first."
    )
    strong = np.argwhere(np.triu(np.abs(matrix) > STRONG, 1))
    pairs = [f"{names[i]} and {names[j]} ({matrix[i, j]:+.3f})" for i, j in strong]
    note = (
        f"Correlated beyond {STRONG:g}: {joined(pairs)}."
        if pairs
        else f"No pair is correlated beyond {STRONG:g}."
    )
    if np.isnan(matrix).any():
        note += " What is not identifiable has no correlation."
    return Figure("correlation", TITLE, (_panel(names, matrix, note),), reading, note=note)


def correlation_matrix(covariance: list[list[float | None]]) -> FloatArray:
    """Correlations (n, n); NaN where a variance is unknown or not positive."""
    known = np.array(covariance, dtype=np.float64)  # None becomes NaN
    variance = np.diag(known)
    scale = 1 / np.sqrt(np.where(variance > 0, variance, np.nan))
    scaled: FloatArray = known * scale[:, None] * scale
    return scaled


def _panel(names: list[str], matrix: FloatArray, says: str) -> Panel:
    shown = [label(name) for name in names]
    trace = {
        "type": "heatmap",
        "x": shown,
        "y": shown,
        "z": {**packed(matrix), "shape": f"{len(names)}, {len(names)}"},
        "zmin": -1,
        "zmax": 1,
        "colorscale": SCALE,
        "xgap": 2,
        "ygap": 2,
        "hovertemplate": "%{y} and %{x}: %{z:.3f}<extra></extra>",
        "colorbar": {"thickness": 10, "outlinewidth": 0, "tickvals": [-1, 0, 1], "len": 0.9},
    }
    if len(names) <= MOST_WRITTEN:
        trace |= {"texttemplate": "%{z:.2f}", "textfont": {"size": 11, "color": "@ink"}}
    layout = {
        "xaxis": axis(
            type="category", showgrid=False, side="bottom", tickangle=0 if len(names) < 9 else -45
        ),
        "yaxis": axis(type="category", showgrid=False, autorange="reversed"),
    }
    return Panel(
        [trace],
        layout,
        f"Correlation matrix of the estimates. {says}",
        height=min(140 + 34 * len(names), 620),
    )
