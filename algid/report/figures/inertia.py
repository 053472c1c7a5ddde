"""The mass matrix over θ2, with its band, and where the logs went."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray, mass_matrix
from algid.report.figures.base import Figure, Layout, Legend, Missing, Panel, Trace, axis, line, packed
from algid.report.series import TorqueLog
from algid.results import Result

TITLE = "Mass matrix M(θ)"
NAMES = ("k1", "k3", "k5")
PARTS = (("M11", "@blue"), ("M12 = M21", "@orange"), ("M22", "@green"))
LEGEND = (
    *(Legend(name, name, colour) for name, colour in PARTS),
    Legend("", "θ2 that the logs reached", "@muted/0.16", "area"),
)


def inertia(result: Result, found: TorqueLog | None) -> Figure | Missing:
    """M11, M12 and M22 over one turn of joint 2."""
    estimates = [result.parameters.get(name) for name in NAMES]
    values = [estimate.estimate for estimate in estimates if estimate is not None]
    known = [value for value in values if value is not None]
    if len(known) < len(NAMES):
        return Missing("inertia", TITLE, "k1, k3 or k5 has no estimate that can be drawn")
    theta2 = np.linspace(-np.pi, np.pi, 181)
    parts, stds = _parts(known, theta2), _stds(result, theta2)
    smallest = _smallest_eigenvalue(parts)
    reading = "Read: M11 and M22 must stay above zero; outside the grey stretch the curves extrapolate."
    definite = "M is positive definite for every θ2"
    if smallest <= 0:
        definite = "M is not positive definite for every θ2, which no arm is"
    panel = Panel(_traces(theta2, parts, stds), _layout(found), f"{TITLE} over θ2. {definite}", height=300)
    return Figure(
        "inertia", TITLE, (panel,), reading, LEGEND, f"{definite}; its smallest eigenvalue is {smallest:.3g} kg m²."
    )


def _parts(known: list[float], theta2: FloatArray) -> FloatArray:
    """M11, M12, M22 (3, n) of eq. (2) in kg m^2."""
    k1, k3, k5 = known
    constants = np.array([k1, 0.0, k3, 0.0, k5, 0.0, 0.0])
    return np.stack(mass_matrix(constants, np.stack([np.zeros_like(theta2), theta2])))


def _stds(result: Result, theta2: FloatArray) -> FloatArray | None:
    """Standard deviations (3, n) of the three parts; None without a covariance of k1, k3 and k5.

    The parts are linear in the constants, so that a unit vector each gives their derivatives.
    """
    fit = result.fit
    if fit is None or any(name not in fit.covariance_names for name in NAMES):
        return None
    place = [fit.covariance_names.index(name) for name in NAMES]
    chosen = [[fit.covariance[i][j] for j in place] for i in place]
    covariance = np.array([[np.nan if value is None else value for value in row] for row in chosen], dtype=np.float64)
    if not np.isfinite(covariance).all():
        return None
    slopes = np.stack([_parts([float(i == j) for j in range(3)], theta2) for i in range(3)])
    variance = np.einsum("ipn,ij,jpn->pn", slopes, covariance, slopes)
    return np.sqrt(np.maximum(variance, 0))


def _smallest_eigenvalue(parts: FloatArray) -> float:
    m11, m12, m22 = parts
    middle, half = 0.5 * (m11 + m22), 0.5 * (m11 - m22)
    return float((middle - np.hypot(half, m12)).min())


def _traces(theta2: FloatArray, parts: FloatArray, stds: FloatArray | None) -> list[Trace]:
    degrees = np.degrees(theta2)
    traces: list[Trace] = []
    for place, (name, colour) in enumerate(PARTS):
        if stds is not None:
            traces.append(_band(degrees, parts[place], 1.96 * stds[place], name, f"{colour}/0.22"))
        hover = f"{name} %{{y:.4g}} kg m² at %{{x:.0f}}°<extra></extra>"
        traces.append(line(degrees, parts[place], colour, name, name, width=2, hover=hover))
        traces[-1]["line"]["simplify"] = False
    return traces


def _band(x: FloatArray, middle: FloatArray, half: FloatArray, name: str, colour: str) -> Trace:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": packed(np.concatenate([x, x[::-1]])),
        "y": packed(np.concatenate([middle + half, (middle - half)[::-1]])),
        "fill": "toself",
        "fillcolor": colour,
        "line": {"width": 0},
        "hoverinfo": "skip",
        "legendgroup": name,
        "name": name,
    }


def _layout(found: TorqueLog | None) -> Layout:
    shapes = []
    if found is not None:
        low, high = np.clip(np.degrees(found.extremes["theta2"]), -180, 180)
        shapes.append(
            {
                "type": "rect",
                "yref": "paper",
                "x0": float(low),
                "x1": float(high),
                "y0": 0,
                "y1": 1,
                "fillcolor": "@muted/0.16",
                "line": {"width": 0},
                "layer": "below",
            }
        )
    return {
        "xaxis": axis("θ2, °", range=[-180, 180], dtick=45),
        "yaxis": axis("kg m²", rangemode="tozero"),
        "shapes": shapes,
        "hovermode": "closest",
    }
