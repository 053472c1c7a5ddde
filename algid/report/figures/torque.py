"""Time series of the logs: measured and predicted torque, worst moment at full rate, signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from algid.report.figures.base import Figure, Legend, Missing, Panel, Trace, axis, line
from algid.report.figures.timeline import chained, log_name, offsets, separators, views
from algid.report.reduce import between
from algid.report.series import Series, TorqueLog
from algid.results import LogSummary, TorquePrediction
from algid.results.verdict import share_text
from algid.text import significant

TITLE = "Measured and predicted torque"
CLOSEUP = "The worst moment, at full rate"
HALF = 0.5  # s before and after the worst moment
COLOURS = ("@blue", "@orange")
RAW = "as recorded"
READING = (
    "Read: blue should cover grey, and orange should look like noise without a trace of the motion."
)
DIFFERENTIATED = (
    "The prediction differentiates angles twice, and with them their noise: see "
    "Torque prediction above."
)
MEASURED, PREDICTED = (
    Legend("measured", "measured", "@measured"),
    Legend("predicted", "predicted by the model", "@blue"),
)


@dataclass(frozen=True, eq=False)
class Scored:
    """The scored torque by log and name, as in a `TorqueLog`, and the score of its prediction."""

    series: Mapping[int, Mapping[str, Series]]
    score: TorquePrediction


def torque(found: TorqueLog, logs: list[LogSummary], scored: Scored | None = None) -> Figure:
    """Measured and predicted torque of all logs in a row, above the residual; a panel a joint.

    With `scored` they are drawn as they are scored, and as recorded on demand.
    """
    if scored is not None and scored.series:
        return _scored(found, logs, scored)
    panels = []
    for joint in (1, 2):
        lines = (
            (found.series, f"tau{joint}", "@measured", "measured", 3.6),
            (found.series, f"tau{joint}_predicted", "@blue", "predicted", 1.3),
            (found.series, f"residual{joint}", "@orange", "residual", 1.0),
        )
        rms, left = found.rms[joint - 1], found.residual_rms[joint - 1]
        says = (
            f"Torque of joint {joint}: RMS {significant(rms, 3)} N m; "
            f"residual RMS {significant(left, 3)} N m"
        )
        panels.append(_torque_panel(found, logs, joint, lines, says))
    note = f"Residual of joint 1: {_shares(found)[0]}; of joint 2: {_shares(found)[1]}."
    note += _of_large(found)
    legend = (MEASURED, PREDICTED, Legend("residual", "residual: measured − predicted", "@orange"))
    return Figure(
        "torque", TITLE, tuple(panels), READING, legend, note, views=views(found.ranges, logs)
    )


def _scored(found: TorqueLog, logs: list[LogSummary], scored: Scored) -> Figure:
    """What is scored, and behind it what was recorded, which a click shows."""
    score = scored.score
    band = "" if score.bandwidth is None else f" below {score.bandwidth:g} Hz"
    panels, shares = [], []
    for joint in (1, 2):
        rms = score.rmse[joint - 1]
        shares.append(f"{significant(rms, 3)} N m RMS, R² {share_text(score.r2[joint - 1])}")
        lines = (
            (found.series, f"tau{joint}", "@measured/0.6", RAW, 1.0),
            (found.series, f"residual{joint}", "@orange/0.45", RAW, 1.0),
            (scored.series, f"tau{joint}", "@measured", "measured", 3.6),
            (scored.series, f"tau{joint}_predicted", "@blue", "predicted", 1.3),
            (scored.series, f"residual{joint}", "@orange", "residual", 1.3),
        )
        says = f"Torque of joint {joint}{band}; residual {shares[-1]}"
        panels.append(_torque_panel(found, logs, joint, lines, says))
    whole = _shares(found)
    note = (
        f"Residual{band}, which the table of predictions scores: joint 1 {shares[0]}; joint 2 "
        f"{shares[1]}. As recorded: joint 1 {whole[0]}; joint 2 {whole[1]}."
    )
    note += _of_large(found)
    legend = (
        MEASURED,
        PREDICTED,
        Legend("residual", f"residual{band}: measured − predicted", "@orange"),
        Legend(
            RAW, "as recorded: torque and residual of all frequencies", "@orange/0.45", shown=False
        ),
    )
    return Figure(
        "torque",
        f"{TITLE}{band}",
        tuple(panels),
        READING,
        legend,
        note,
        views=views(found.ranges, logs),
    )


def _of_large(found: TorqueLog) -> str:
    """Where a joint's residual has half of its torque: why it may be that large."""
    if np.any(2 * np.array(found.residual_rms) > found.rms):
        return f" {DIFFERENTIATED}"
    return ""


def _torque_panel(
    found: TorqueLog,
    logs: list[LogSummary],
    joint: int,
    lines: Sequence[tuple[Mapping[int, Mapping[str, Series]], str, str, str, float]],
    says: str,
) -> Panel:
    """Lines of series, name, colour, group and width; residuals below the torques."""
    moved = offsets(found.ranges)
    traces = []
    for series, name, colour, group, width in lines:
        x, y = chained(_of_each_log(series, name), moved)
        hover = f"{group} %{{y:.4g}} N m at %{{x:.4f}} s<extra></extra>"
        traces.append(line(x, y, colour, group, group, width=width, hover=hover))
        if name.startswith("residual"):
            traces[-1]["yaxis"] = "y2"
    layout = {
        "xaxis": axis("time, s", anchor="y2"),
        "yaxis": axis("torque, N m", domain=[0.42, 1]),
        "yaxis2": axis("residual, N m", domain=[0, 0.32], anchor="x"),
        "hovermode": "closest",
        **separators(found.ranges, moved, logs),
    }
    return Panel(traces, layout, says, f"Joint {joint}", 340, "torque")


def _of_each_log(series: Mapping[int, Mapping[str, Series]], name: str) -> dict[int, Series]:
    """The series of one name by log."""
    return {log: own[name] for log, own in series.items()}


def _shares(found: TorqueLog) -> list[str]:
    """The residual as recorded, beside the torque, a joint."""
    pairs = zip(found.residual_rms, found.rms, strict=True)
    return [f"{significant(left, 3)} of {significant(rms, 3)} N m RMS" for left, rms in pairs]


def closeup(path: Path, found: TorqueLog, logs: list[LogSummary]) -> Figure | Missing:
    """One second around the largest residual of each joint, every sample. Raises `ResultError`."""
    panels = tuple(
        _closeup_panel(path, found, joint, logs) for joint in (1, 2) if joint in found.worst
    )
    if not panels:
        return Missing("closeup", CLOSEUP, "no torque is predicted")
    reading = (
        "Read: a residual that stands out once is an event, such as a knock; one like the "
        "rest is the model's limit."
    )
    legend = (MEASURED, PREDICTED, Legend("residual", "residual", "@orange"))
    return Figure("closeup", CLOSEUP, panels, reading, legend, columns=2)


def _closeup_panel(path: Path, found: TorqueLog, joint: int, logs: list[LogSummary]) -> Panel:
    """The stretch around the worst moment of a joint.

    Only the file's row groups around it are read.

    Raises
    ------
    ResultError
        Where the file cannot be read.
    """
    log, moment = found.worst[joint]
    names = ("t", f"tau{joint}", f"tau{joint}_predicted")
    t, measured, predicted = between(path, names, log, moment - HALF, moment + HALF)
    residual = measured - predicted
    traces = [
        line(t, measured, "@measured", "measured", "measured", width=3.6),
        line(t, predicted, "@blue", "predicted", "predicted"),
        line(t, residual, "@orange", "residual", "residual", width=1.0),
    ]
    where = f" of {log_name(log, logs)}" if len(found.ranges) > 1 else ""
    largest = significant(float(np.fmax.reduce(np.abs(residual))), 3)
    says = f"Joint {joint}, largest residual {largest} N m at {moment:.3f} s{where}"
    layout = {"xaxis": axis(f"time{where}, s"), "yaxis": axis("N m"), "hovermode": "closest"}
    return Panel(traces, layout, says, says)


def signals(found: TorqueLog, logs: list[LogSummary]) -> Figure:
    """Angles, velocities of the estimator and torques of all logs; a panel holds both joints."""
    moved = offsets(found.ranges)
    panels = []
    for name, words, unit in (
        ("theta", "Angle", "rad"),
        ("omega", "Velocity", "rad/s"),
        ("tau", "Measured torque", "N m"),
    ):
        traces: list[Trace] = []
        for joint, colour in enumerate(COLOURS, start=1):
            x, y = chained(_of_each_log(found.series, f"{name}{joint}"), moved)
            hover = f"joint {joint} %{{y:.4g}} {unit} at %{{x:.4f}} s<extra></extra>"
            traces.append(
                line(x, y, colour, f"joint {joint}", f"joint{joint}", width=1.2, hover=hover)
            )
        layout = {
            "xaxis": axis("time, s"),
            "yaxis": axis(f"{words.lower()}, {unit}"),
            "hovermode": "closest",
            **separators(found.ranges, moved, logs),
        }
        reach = (*found.extremes[f"{name}1"], *found.extremes[f"{name}2"])
        says = f"{words} of both joints, {min(reach):.4g} to {max(reach):.4g} {unit}"
        panels.append(Panel(traces, layout, says, words, 200, "torque"))
    reading = (
        "Read: look for jumps, flat stretches and clipped tops; what is odd here is odd in "
        "every number above."
    )
    legend = tuple(
        Legend(f"joint{joint}", f"joint {joint}", colour)
        for joint, colour in enumerate(COLOURS, start=1)
    )
    return Figure(
        "signals", "Signals", tuple(panels), reading, legend, views=views(found.ranges, logs)
    )
