"""The figure of a design: its motion within the limits."""

from __future__ import annotations

import numpy as np

from algid.designs.campaign import Design
from algid.report.plot import BLUE, ORANGE, Panels, Plot

POINTS = 2_000


def motion(design: Design) -> Plot:
    """Angles, velocities and torques of both joints over time, with their limits."""
    limits, planned = design.campaign.limits, design.motion
    series = {
        "Angles, rad": (planned.theta, limits.low, limits.high),
        "Velocities, rad/s": (planned.omega, -limits.speed, limits.speed),
    }
    for loaded, torque in design.torque.items():
        kind = {True: "loaded", False: "unloaded"}[loaded]
        series[f"Torques, {kind}, N m"] = (torque, -limits.torque, limits.torque)
    panels = Panels(list(series), height=200, together=True)
    every = max(1, design.t.size // POINTS)
    for place, (values, *sides) in enumerate(series.values()):
        size = float(np.abs(values).max())
        for joint, colour, dash in ((0, BLUE, "solid"), (1, ORANGE, "5px,2px")):
            y = values[joint, ::every]
            panels.curve(place, design.t[::every], y, f"joint {joint + 1}", colour, 1.4, dash)
            for side in sides:
                if abs(side[joint]) < 3 * size:  # a limit far away would flatten the motion
                    panels.line(place, y=float(side[joint]), colour=colour)
    panels.axes(len(series) - 1, "time, s")
    reading = (
        "The motion starts and ends at rest; torques are the believed arm's. Dashed lines are "
        "limits, which hold for every arm that is believed possible."
    )
    return Plot("motion", "The motion", panels, reading)
