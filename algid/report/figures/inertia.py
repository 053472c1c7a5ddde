"""The mass matrix over θ2, with its band, and where the logs went."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray, mass_matrix
from algid.model import K1, K3, K5
from algid.report.figures.base import (
    Figure,
    Legend,
    Missing,
    Panel,
    Trace,
    axis,
    line,
    packed,
    stretch,
)
from algid.report.series import TorqueLog
from algid.results import Result
from algid.significance import NORMAL

TITLE = "Mass matrix M(θ)"
NAMES = (K1, K3, K5)
PARTS = (("M11", "@blue"), ("M12 = M21", "@orange"), ("M22", "@green"))
LEGEND = (
    *(Legend(name, name, colour) for name, colour in PARTS),
    Legend("", "θ2 that the logs reached", "@muted/0.16", "area"),
)


def inertia(result: Result, found: TorqueLog | None) -> Figure | Missing:
    """M11, M12 and M22 over one turn of joint 2."""
    known = []
    for name in NAMES:
        one = result.parameters.get(name)
        if one is not None and one.estimate is not None:
            known.append(one.estimate)
    if len(known) < len(NAMES):
        return Missing("inertia", TITLE, "k1, k3 or k5 has no estimate that can be drawn")
    theta2 = np.linspace(-np.pi, np.pi, 181)
    parts, stds = _parts(known, theta2), _stds(result, theta2)
    m11, m12, m22 = parts
    smallest = float((0.5 * (m11 + m22) - np.hypot(0.5 * (m11 - m22), m12)).min())  # eigenvalue
    reading = (
        "Read: M11 and M22 must stay above zero; outside the grey stretch the curves extrapolate."
    )
    definite = "M is positive definite for every θ2"
    if smallest <= 0:
        definite = "M is not positive definite for every θ2, which no arm is"
    shapes = []
    if found is not None:
        first, last = np.clip(np.degrees(found.extremes["theta2"]), -180, 180).tolist()
        shapes.append(stretch(first, last, "@muted/0.16"))
    layout = {
        "xaxis": axis("θ2, °", range=[-180, 180], dtick=45),
        "yaxis": axis("kg m²", rangemode="tozero"),
        "shapes": shapes,
        "hovermode": "closest",
    }
    panel = Panel(_traces(theta2, parts, stds), layout, f"{TITLE} over θ2. {definite}", height=300)
    return Figure(
        "inertia",
        TITLE,
        (panel,),
        reading,
        LEGEND,
        f"{definite}; its smallest eigenvalue is {smallest:.3g} kg m².",
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
    if result.fit is None:
        return None
    covariance = result.fit.covariance_of(NAMES)
    if not np.isfinite(covariance).all():
        return None
    slopes = np.stack([_parts(unit, theta2) for unit in np.eye(3).tolist()])
    variance = np.einsum("ipn,ij,jpn->pn", slopes, covariance, slopes)
    return np.sqrt(np.maximum(variance, 0))


def _traces(theta2: FloatArray, parts: FloatArray, stds: FloatArray | None) -> list[Trace]:
    """M11, M12, M22, each with its 95 % band as one closed area."""
    degrees = np.degrees(theta2)
    both = packed(np.concatenate([degrees, degrees[::-1]]))
    traces: list[Trace] = []
    for place, (name, colour) in enumerate(PARTS):
        middle = parts[place]
        if stds is not None:
            half = NORMAL * stds[place]
            area = {
                "fill": "toself",
                "fillcolor": f"{colour}/0.22",
                "line": {"width": 0},
                "hoverinfo": "skip",
            }
            edge = packed(np.concatenate([middle + half, (middle - half)[::-1]]))
            traces.append({"type": "scatter", "mode": "lines", "x": both, "y": edge, **area})
            traces[-1] |= {"legendgroup": name, "name": name}
        hover = f"{name} %{{y:.4g}} kg m² at %{{x:.0f}}°<extra></extra>"
        traces.append(line(degrees, middle, colour, name, name, width=2, hover=hover))
        traces[-1]["line"]["simplify"] = False
    return traces
