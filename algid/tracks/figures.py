"""The figures of a track: the payload in time, and what it leaves of the torque."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from algid.arm import FloatArray
from algid.criteria import HOLE
from algid.report.figures.base import (
    Figure,
    Layout,
    Legend,
    Panel,
    Trace,
    axis,
    level,
    line,
    packed,
    stretch,
    times,
)
from algid.report.reduce import MinMax, broken_at_gaps, bucket_size
from algid.significance import NORMAL
from algid.text import joined
from algid.tracks.bins import CELL
from algid.tracks.payload import HALF_BAND, Track
from algid.tracks.result import TrackResult
from algid.tracks.tables import mass_text

POINTS = 4_000
MOST_MARKS = 60  # changes beyond which lines over the whole panel would hide it
SPACE = 0.08  # of the masses' range, above and below
SYNC = "track"


def figures(result: TrackResult) -> list[Figure]:
    """Every figure of the page."""
    return [_payload(result), _left(result)]


def _payload(result: TrackResult) -> Figure:
    track = result.track
    hover = "m_p %{y:.5g} kg at %{x:.3f} s<extra></extra>"
    t, m_p = _curve(track, track.m_p)
    traces = [_band(track)]
    traces.append(line(t, m_p, "@blue", "m_p(t)", "curve", width=1.2, hover=hover))
    ends, masses = [], []
    for one in track.stretches:
        ends += [one.start, one.end]
        masses += [one.m_p, one.m_p]
    traces.append(_steps(np.array(ends), np.array(masses), "@green", "stretch", "solid", 2.6))
    legend = [
        Legend("curve", f"m_p(t) from ± {HALF_BAND:g} s around, within its stretch", "@blue"),
        Legend("band", "its 95 % band", "@blue/0.25", "area"),
        Legend("stretch", "mass of each stretch", "@green"),
    ]
    if result.schedule is not None:
        times_of_truth, true_masses = _true_steps(result)
        traces.append(_steps(times_of_truth, true_masses, "@ink", "truth", "dash", 1.3))
        legend.append(Legend("truth", "true schedule", "@ink", "dash"))
    if 0 < len(track.changes) <= MOST_MARKS:
        legend.append(Legend("", "95 % interval of a change's time", "@orange/0.2", "area"))
    layout = {
        "xaxis": axis("time, s", range=_span(track)),
        "yaxis": axis("payload, kg", range=_view(result)),
        "shapes": _marks(track),
        "hovermode": "closest",
    }
    reading = (
        "Read: blue should run level, green within its band; orange is where it may step. "
        "A band that opens wide shows that the arm moved too little; double-click shows all of it."
    )
    words = joined(list(map(mass_text, track.stretches[:6])))
    panel = Panel(
        traces, layout, f"Payload over time; stretches of {words} kg", height=380, sync=SYNC
    )
    return Figure("payload", "Payload in time", (panel,), reading, tuple(legend))


def _left(result: TrackResult) -> Figure:
    track = result.track
    hover = "%{y:.3g} times the noise at %{x:.3f} s<extra></extra>"
    t, left = _curve(track, track.left)
    trace = line(t, left, "@orange", "residual", "left", width=1.0, hover=hover)
    layout = {
        "xaxis": axis("time, s", range=_span(track)),
        "yaxis": axis("residual / noise", rangemode="tozero"),
        "shapes": _marks(track) + [level(1.0, "@ink", "dash", 1.2)],
        "hovermode": "closest",
    }
    reading = (
        "Read: about 1 all along is the sensors' noise; anything that stands out is torque that "
        "neither arm nor payload explains. Times at which the payload may be changing are left out."
    )
    middle = float(np.median(track.left))
    panel = Panel(
        [trace],
        layout,
        f"Residual over the sensors' noise; median {middle:.2f}",
        height=240,
        sync=SYNC,
    )
    legend = (
        Legend("", f"RMS of each {CELL:g} s, over the sensors' noise", "@orange"),
        Legend("", "noise alone", "@ink", "dash"),
    )
    return Figure("left", "What arm and payload leave of the torque", (panel,), reading, legend)


def _span(track: Track) -> list[float]:
    return [track.stretches[0].start, track.stretches[-1].end]


def _view(result: TrackResult) -> list[float]:
    """Masses, their intervals and the truth; m_p(t) where it is as certain as usual."""
    track = result.track
    certain = track.std <= 3 * np.median(track.std)
    band = NORMAL * track.std[certain]
    # percentiles: a jolt's spike may leave the frame
    low = float(np.percentile(track.m_p[certain] - band, 1))
    high = float(np.percentile(track.m_p[certain] + band, 99))
    for one in track.stretches:
        low, high = min(low, one.ci95[0]), max(high, one.ci95[1])
    for _, mass in result.schedule or ():
        low, high = min(low, mass), max(high, mass)
    space = SPACE * (high - low) or 0.05
    return [low - space, high + space]


def _marks(track: Track) -> list[Layout]:
    """Each change, over the whole panel, as wide as it is uncertain."""
    if len(track.changes) > MOST_MARKS:
        return []
    return [stretch(low, high, "@orange/0.2") for _, low, high in track.changes.tolist()]


def _curve(track: Track, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A series, short enough to draw, broken where the log has no samples and between stretches."""
    size = bucket_size(track.t.size, POINTS)
    xs, ys = [], []
    for place in range(len(track.stretches)):
        own = track.stretch == place
        reducer = MinMax(size)
        reducer.feed(track.t[own], values[own])
        x, y = reducer.result()
        x, y = broken_at_gaps(x, y, HOLE + size * CELL)
        xs += [x, x[-1:]]
        ys += [y, np.full(x[-1:].size, np.nan)]
    return np.concatenate(xs), np.concatenate(ys)


def _band(track: Track) -> Trace:
    """The band as one closed area a stretch, between holes."""
    size = bucket_size(track.t.size, POINTS)
    xs, ys = [], []
    apart = (np.diff(track.stretch) != 0) | (np.diff(track.t) > HOLE + CELL)
    edges = [0] + (np.flatnonzero(apart) + 1).tolist() + [track.t.size]
    for first, last in pairwise(edges):
        starts = np.arange(first, last, size)
        low = np.minimum.reduceat(track.m_p[:last] - NORMAL * track.std[:last], starts)
        high = np.maximum.reduceat(track.m_p[:last] + NORMAL * track.std[:last], starts)
        x = track.t[starts]
        xs += [x, x[::-1], x[:1], x[:1]]
        ys += [high, low[::-1], high[:1], np.full(1, np.nan)]
    return {
        "type": "scatter",
        "mode": "lines",
        "fill": "toself",
        "fillcolor": "@blue/0.25",
        "line": {"width": 0, "color": "@blue/0.25"},
        "x": times(np.concatenate(xs)),
        "y": packed(np.concatenate(ys)),
        "name": "band",
        "legendgroup": "band",
        "hoverinfo": "skip",
    }


def _true_steps(result: TrackResult) -> tuple[FloatArray, FloatArray]:
    """Corners of the true schedule: times in s and masses in kg, nothing before the first."""
    first, last = _span(result.track)
    starts, masses = [], [0.0]
    for time, mass in result.schedule or ():
        if time < last:
            starts.append(max(time, first))
            masses.append(mass)
    corners = [first] + np.repeat(starts, 2).tolist() + [last]
    return np.array(corners), np.repeat(masses, 2)


def _steps(x: FloatArray, y: FloatArray, colour: str, name: str, dash: str, width: float) -> Trace:
    hover = f"{name} %{{y:.6g}} kg<extra></extra>"
    trace = line(x, y, colour, name, name, width=width, hover=hover)
    trace["line"] |= {"dash": dash}
    return trace
