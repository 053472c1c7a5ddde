"""The signals themselves: angles, velocities and torques over time, both joints in one panel."""

from __future__ import annotations

from algid.report.figures.base import Figure, Legend, Panel, Trace, axis, line
from algid.report.figures.timeline import chained, offsets, separators, views
from algid.report.series import TorqueLog
from algid.results import LogSummary

TITLE = "Signals"
COLOURS = ("@blue", "@orange")
LEGEND = tuple(Legend(f"joint{joint}", f"joint {joint}", colour) for joint, colour in enumerate(COLOURS, start=1))
ROWS = (("theta", "Angle", "rad"), ("omega", "Velocity", "rad/s"), ("tau", "Measured torque", "N m"))
READING = "Read: look for jumps, flat stretches and clipped tops; what is odd here is odd in every number above."


def signals(found: TorqueLog, logs: list[LogSummary]) -> Figure:
    """Angles, the velocities that the estimator used, and measured torques of all logs."""
    panels = tuple(_panel(found, logs, *row) for row in ROWS)
    return Figure("signals", TITLE, panels, READING, LEGEND, views=views(found.ranges, logs))


def _panel(found: TorqueLog, logs: list[LogSummary], name: str, words: str, unit: str) -> Panel:
    moved = offsets(found.ranges)
    traces: list[Trace] = []
    for joint, colour in enumerate(COLOURS, start=1):
        x, y = chained({log: series[f"{name}{joint}"] for log, series in found.series.items()}, moved)
        hover = f"joint {joint} %{{y:.4g}} {unit} at %{{x:.4f}} s<extra></extra>"
        traces.append(line(x, y, colour, f"joint {joint}", f"joint{joint}", width=1.2, hover=hover))
    layout = {
        "xaxis": axis("time, s"),
        "yaxis": axis(f"{words.lower()}, {unit}"),
        "hovermode": "closest",
        **separators(found.ranges, moved, logs),
    }
    low, high = (pick(found.extremes[f"{name}{joint}"][end] for joint in (1, 2)) for end, pick in ((0, min), (1, max)))
    return Panel(traces, layout, f"{words} of both joints, {low:.4g} to {high:.4g} {unit}", words, 200, "torque")
