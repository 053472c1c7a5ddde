"""The worst moment at full rate: the stretch around each joint's largest residual."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.report.figures.base import Figure, Legend, Missing, Panel, axis, line
from algid.report.series import TorqueLog
from algid.report.text import significant

TITLE = "The worst moment, at full rate"
HALF = 0.5  # s before and after
LEGEND = (
    Legend("measured", "measured", "@measured"),
    Legend("predicted", "predicted by the model", "@blue"),
    Legend("residual", "residual", "@orange"),
)


def closeup(path: Path, found: TorqueLog) -> Figure | Missing:
    """One second around the largest residual of each joint, every sample. Raises `ResultError`."""
    panels = tuple(_panel(path, found, joint) for joint in (1, 2) if joint in found.worst)
    if not panels:
        return Missing("closeup", TITLE, "no torque is predicted")
    reading = (
        "Read: a residual that stands out once is an event, such as a knock; one like the rest is the model's limit."
    )
    return Figure("closeup", TITLE, panels, reading, LEGEND, columns=2)


def _panel(path: Path, found: TorqueLog, joint: int) -> Panel:
    log, moment = found.worst[joint]
    t, measured, predicted = _stretch(path, log, moment, joint)
    residual = measured - predicted
    traces = [
        line(t, measured, "@measured", "measured", "measured", width=3.6),
        line(t, predicted, "@blue", "predicted", "predicted"),
        line(t, residual, "@orange", "residual", "residual", width=1.0),
    ]
    where = f" of log {log + 1}" if len(found.ranges) > 1 else ""
    largest = significant(float(np.nanmax(np.abs(residual))), 3)
    says = f"Joint {joint}, largest residual {largest} N m at {moment:.3f} s{where}"
    layout = {"xaxis": axis(f"time{where}, s"), "yaxis": axis("N m"), "hovermode": "closest"}
    return Panel(traces, layout, says, says)


def _stretch(path: Path, log: int, moment: float, joint: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, measured and predicted torque around `moment`; only the file's row groups around it are read."""
    import polars as pl

    near = pl.col("t").is_between(moment - HALF, moment + HALF) & (pl.col("log") == log)
    names = ["t", f"tau{joint}", f"tau{joint}_predicted"]
    try:
        rows = pl.scan_parquet(path).filter(near).select(names).collect()
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ResultError(f"{path}: cannot read it ({error}); identify again with this version") from error
    t, measured, predicted = (rows[name].cast(pl.Float64).fill_null(float("nan")).to_numpy() for name in names)
    return t, measured, predicted
