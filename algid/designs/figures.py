"""The figures of a design: its motion within the limits, and the information of each second."""

from __future__ import annotations

from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.designs.campaign import SECOND, Design
from algid.report.figures.base import Figure, Legend, Panel, Trace, axis, level, line
from algid.report.figures.information import information_panel

POINTS = 2_000
SCALE = [[0, "@card"], [1, "@blue"]]
COLOURS = ("@blue", "@orange")


def figures(design: Design) -> list[Figure]:
    """Every figure of the page."""
    return [_motion(design), _teaching(design)]


def _motion(design: Design) -> Figure:
    limits, motion = design.campaign.limits, design.motion
    panels = [
        _panel(design, "angles", motion.theta, "angle, rad", (limits.low, limits.high)),
        _panel(
            design, "velocities", motion.omega, "velocity, rad/s", (-limits.speed, limits.speed)
        ),
    ]
    for loaded, torque in design.torque.items():
        kind = {True: "loaded", False: "unloaded"}[loaded]
        panels.append(
            _panel(
                design, f"torques, {kind}", torque, "torque, N m", (-limits.torque, limits.torque)
            )
        )
    legend: tuple[Legend, ...] = (
        Legend("joint 1", "joint 1", COLOURS[0]),
        Legend("joint 2", "joint 2", COLOURS[1]),
    )
    reading = "Read: the motion starts and ends at rest; torques are the believed arm's."
    if any(panel.layout["shapes"] for panel in panels):
        legend += (Legend("", "its limits", "@muted", "dash"),)
        reading += (
            " Limits hold for every arm that is believed possible, which is why the believed one "
            "keeps some distance "
            "from its torques' limits."
        )
    return Figure("motion", "The motion", tuple(panels), reading, legend)


def _panel(
    design: Design, what: str, values: FloatArray, title: str, limits: tuple[FloatArray, FloatArray]
) -> Panel:
    every = max(1, design.t.size // POINTS)
    t = design.t[::every]
    traces: list[Trace] = []
    for joint, name in enumerate(("joint 1", "joint 2")):
        traces.append(line(t, values[joint, ::every], COLOURS[joint], name, name))
    size = float(np.abs(values).max())
    levels = []
    for side in limits:
        for value, colour in zip(side.tolist(), COLOURS, strict=False):
            if abs(value) < 3 * size:
                levels.append(level(value, f"{colour}/0.6", width=1))
    layout: dict[str, Any] = {
        "xaxis": axis("time, s"),
        "yaxis": axis(title),
        "shapes": levels,
        "hovermode": "x",
    }
    return Panel(
        traces, layout, f"Planned {what} of both joints over time", what.capitalize(), 230, "plan"
    )


def _teaching(design: Design) -> Figure:
    shares = 100 * design.shares
    x = (np.arange(shares.shape[1]) + 0.5) * SECOND
    panel = information_panel(design.names, x, shares, SCALE)
    reading = (
        "Read: strongly coloured seconds inform most; cut the motion there, and that "
        "parameter's error bar grows."
    )
    return Figure("teaching", "Information by second", (panel,), reading)
