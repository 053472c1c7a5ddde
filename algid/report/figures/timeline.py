"""Several logs one after another on one time axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile

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
    x, y = [], []
    for log, (own_x, own_y) in sorted(series.items()):
        x += [own_x + moved[log], own_x[-1:] + moved[log]]
        y += [own_y, np.full(own_x[-1:].size, np.nan)]
    return (np.concatenate(x), np.concatenate(y)) if x else (np.empty(0), np.empty(0))


def views(
    ranges: Mapping[int, LogRange], logs: list[LogSummary]
) -> tuple[tuple[str, float, float], ...]:
    """Name, start and end of each log on the common axis; nothing for a single one."""
    moved = offsets(ranges)
    spans = [
        (log_name(log, logs), moved[log] + span.first, moved[log] + span.last)
        for log, span in sorted(ranges.items())
    ]
    return tuple(spans) if len(spans) > 1 else ()


def separators(
    ranges: Mapping[int, LogRange], moved: Mapping[int, float], logs: list[LogSummary]
) -> Layout:
    """Shapes and annotations that tell the logs apart; none for a single one."""
    if len(ranges) < 2:
        return {}
    starts = {log: moved[log] + span.first for log, span in sorted(ranges.items())}
    shapes = [upright(start, "@muted/0.6") for start in list(starts.values())[1:]]
    words = [log_name(log, logs) for log in starts]
    if len(words) > MOST_NAMES:
        words = short(words)
    name: Layout = {
        "y": 1,
        "yref": "paper",
        "xanchor": "left",
        "yanchor": "bottom",
        "showarrow": False,
    }
    name["font"] = {"size": 11, "color": "@muted"}
    names = [
        {**name, "x": start, "text": text}
        for start, text in zip(starts.values(), words, strict=True)
    ]
    return {"shapes": shapes, "annotations": names, "margin": {"t": ROOM}}


def short(names: Sequence[str]) -> list[str]:
    """The names less the words that all of them begin and end with."""
    begin = _in_common(names)
    end = _in_common([name[::-1] for name in names])
    cut = [name[begin : len(name) - end] for name in names]
    return cut if all(cut) else list(names)


def _in_common(names: Sequence[str]) -> int:
    """How many characters all names begin with, up to the end of a word."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    first = [letters[0] for letters in alike]
    return max((at + 1 for at, letter in enumerate(first) if not letter.isalnum()), default=0)


def log_name(log: int, logs: list[LogSummary]) -> str:
    """The name of the log of that number, for plotly."""
    return label(file_name(logs[log].path), 22) if 0 <= log < len(logs) else f"log {log + 1}"
