"""Measured against predicted torque, and the residual below it, a panel a joint."""

from __future__ import annotations

from algid.report.figures.base import Figure, Layout, Legend, Panel, Trace, axis, line
from algid.report.figures.timeline import chained, offsets, separators, views
from algid.report.series import TorqueLog
from algid.report.text import significant
from algid.results import LogSummary

TITLE = "Measured and predicted torque"
LEGEND = (
    Legend("measured", "measured", "@measured"),
    Legend("predicted", "predicted by the model", "@blue"),
    Legend("residual", "residual: measured − predicted", "@orange"),
)


def torque(found: TorqueLog, logs: list[LogSummary]) -> Figure:
    """The torques of all logs one after another."""
    panels = tuple(_joint(found, logs, joint) for joint in (1, 2))
    reading = "Read: blue should cover grey, and orange should look like noise without a trace of the motion."
    return Figure("torque", TITLE, panels, reading, LEGEND, _note(found), views=views(found.ranges, logs))


def _joint(found: TorqueLog, logs: list[LogSummary], joint: int) -> Panel:
    moved = offsets(found.ranges)
    traces: list[Trace] = []
    for name, colour, group, width in (
        (f"tau{joint}", "@measured", "measured", 3.6),
        (f"tau{joint}_predicted", "@blue", "predicted", 1.3),
        (f"residual{joint}", "@orange", "residual", 1.0),
    ):
        x, y = chained({log: series[name] for log, series in found.series.items()}, moved)
        traces.append(
            line(
                x, y, colour, group, group, width=width, hover=f"{group} %{{y:.4g}} N m at %{{x:.4f}} s<extra></extra>"
            )
        )
    traces[2]["yaxis"] = "y2"
    return Panel(traces, _layout(found, logs), _says(found, joint), f"Joint {joint}", 340, "torque")


def _layout(found: TorqueLog, logs: list[LogSummary]) -> Layout:
    moved = offsets(found.ranges)
    return {
        "xaxis": axis("time, s", anchor="y2"),
        "yaxis": axis("torque, N m", domain=[0.42, 1]),
        "yaxis2": axis("residual, N m", domain=[0, 0.32], anchor="x"),
        "hovermode": "closest",
        **separators(found.ranges, moved, logs),
    }


def _says(found: TorqueLog, joint: int) -> str:
    rms, residual = found.rms[joint - 1], found.residual_rms[joint - 1]
    return f"Torque of joint {joint}: RMS {significant(rms, 3)} N m; residual RMS {significant(residual, 3)} N m"


def _note(found: TorqueLog) -> str:
    shares = [
        f"{significant(residual, 3)} of {significant(rms, 3)} N m RMS"
        for residual, rms in zip(found.residual_rms, found.rms, strict=True)
    ]
    noisy = any(2 * residual > rms for residual, rms in zip(found.residual_rms, found.rms, strict=True))
    why = " The prediction differentiates angles twice, and with them their noise: see Torque prediction above."
    return f"Residual of joint 1: {shares[0]}; of joint 2: {shares[1]}.{why if noisy else ''}"
