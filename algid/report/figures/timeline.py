"""Several logs one after another on one time axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from algid.arm import FloatArray
from algid.report.figures.base import Layout, label, upright
from algid.report.series import LogRange
from algid.results import LogSummary
from algid.text import file_name

SPACE = 0.01  # of the whole time, between two logs
MOST_NAMES = 6  # that are written in full
ROOM = 26  # pixels above a panel, for names; the page's script makes more where they stand upright


def offsets(ranges: Mapping[int, LogRange]) -> dict[int, float]:
    """Offsets to each log's times that put the logs in a row; the first keeps its times."""
    space = SPACE * sum(span.duration for span in ranges.values())
    moved: dict[int, float] = {}
    end = None
    for log, span in sorted(ranges.items()):
        moved[log] = 0.0 if end is None else end + space - span.first
        end = moved[log] + span.last
    return moved


def chained(
    series: Mapping[int, tuple[FloatArray, FloatArray]], moved: Mapping[int, float]
) -> tuple[FloatArray, FloatArray]:
    """The logs' series as one line that breaks between logs."""
    x: list[FloatArray] = [np.empty(0)]
    y: list[FloatArray] = [np.empty(0)]
    for log, (own_x, own_y) in sorted(series.items()):
        last = own_x[-1:]  # empty where the log is
        x += [own_x + moved[log], last + moved[log]]
        y += [own_y, np.full(last.size, np.nan)]
    return np.concatenate(x), np.concatenate(y)


def views(
    ranges: Mapping[int, LogRange], logs: list[LogSummary]
) -> tuple[tuple[str, float, float], ...]:
    """Name, start and end of each log on the common axis; nothing for a single one."""
    if len(ranges) < 2:
        return ()
    moved = offsets(ranges)
    spans = []
    for log, span in sorted(ranges.items()):
        spans.append((log_name(log, logs), moved[log] + span.first, moved[log] + span.last))
    return tuple(spans)


def separators(
    ranges: Mapping[int, LogRange], moved: Mapping[int, float], logs: list[LogSummary]
) -> Layout:
    """Shapes and annotations that tell the logs apart; none for a single one."""
    if len(ranges) < 2:
        return {}
    in_order = sorted(ranges)
    starts = [moved[log] + ranges[log].first for log in in_order]
    names = [log_name(log, logs) for log in in_order]
    if len(names) > MOST_NAMES:
        names = short(names)
    return {
        "shapes": [upright(start, "@muted/0.6") for start in starts[1:]],
        "annotations": [_name_at(x, name) for x, name in zip(starts, names, strict=True)],
        "margin": {"t": ROOM},
    }


def _name_at(x: float, text: str) -> Layout:
    """A log's name over the left end of its part of the panel."""
    return {
        "x": x,
        "y": 1,
        "yref": "paper",
        "xanchor": "left",
        "yanchor": "bottom",
        "showarrow": False,
        "font": {"size": 11, "color": "@muted"},
        "text": text,
    }


def short(names: Sequence[str]) -> list[str]:
    """The names less the words that all of them begin and end with."""
    begin = _in_common(names)
    end = _in_common([name[::-1] for name in names])
    cut = [name[begin : len(name) - end] for name in names]
    return cut if all(cut) else list(names)


def _in_common(names: Sequence[str]) -> int:
    """How many characters all names begin with, up to the end of a word."""
    in_common = 0
    for place, letters in enumerate(zip(*names, strict=False), start=1):
        if len(set(letters)) > 1:
            break
        if not letters[0].isalnum():
            in_common = place
    return in_common


def log_name(log: int, logs: list[LogSummary]) -> str:
    """The name of the log of that number, for plotly."""
    return label(file_name(logs[log].path), 22) if 0 <= log < len(logs) else f"log {log + 1}"
