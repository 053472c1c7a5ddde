"""Where the motion went: the θ1-θ2 plane and the plane of speeds."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.report.figures.base import Figure, Panel, axis, packed
from algid.report.series import TorqueLog
from algid.text import significant

TURN = 540.0  # degrees: an angle that spans more has turned round, and is shown within ±180


def coverage(found: TorqueLog) -> Figure:
    """Samples of the motion, evenly spaced in time."""
    degrees = np.degrees(found.motion[:2])
    turned = np.fmax.reduce(degrees, axis=1) - np.fmin.reduce(degrees, axis=1) > TURN
    degrees = np.where(turned[:, None], (degrees + 180) % 360 - 180, degrees)
    theta = [_range(found, f"theta{joint}", np.degrees(1.0), "°") for joint in (1, 2)]
    omega = [_range(found, f"omega{joint}", 1.0, " rad/s") for joint in (1, 2)]
    panels = (
        _cloud(degrees, ("θ1, °", "θ2, °"), "Angles", f"Angles: θ1 {theta[0]}; θ2 {theta[1]}", "°"),
        _cloud(
            found.motion[2:],
            ("θ̇1, rad/s", "θ̇2, rad/s"),
            "Speeds",
            f"Speeds: joint 1 {omega[0]}; joint 2 {omega[1]}",
            " rad/s",
        ),
    )
    reading = (
        "Read: dots spread over both planes inform; a line or a spot leaves parameters tied "
        "to each other."
    )
    note = f"θ1 {theta[0]}, θ2 {theta[1]}; speeds {omega[0]} and {omega[1]}."
    note += " Angles that turned round are shown within ±180°." if turned.any() else ""
    return Figure("coverage", "Coverage of the motion", panels, reading, note=note, columns=2)


def _range(found: TorqueLog, name: str, scale: float, unit: str) -> str:
    low, high = found.extremes[name]
    return f"{significant(scale * low, 3)} to {significant(scale * high, 3)}{unit}"


def _cloud(points: FloatArray, titles: tuple[str, str], title: str, says: str, unit: str) -> Panel:
    trace = {
        "type": "scatter",
        "mode": "markers",
        "x": packed(points[0]),
        "y": packed(points[1]),
        "marker": {"color": "@blue", "size": 4, "opacity": 0.45},
        "name": title,
        "hovertemplate": f"%{{x:.3g}}, %{{y:.3g}}{unit}<extra></extra>",
    }
    layout = {"xaxis": axis(titles[0]), "yaxis": axis(titles[1]), "hovermode": "closest"}
    return Panel([trace], layout, says, title, 320)
