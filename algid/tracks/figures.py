"""The figure of a track: the payload in time, above what it leaves of the torque."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import HOLE
from algid.base.significance import NORMAL
from algid.report.plot import BLUE, GREEN, ORANGE, Panels, Plot
from algid.tracks.bins import CELL
from algid.tracks.payload import HALF_BAND
from algid.tracks.result import TrackResult

POINTS = 4_000
MOST_MARKS = 60  # changes beyond which bands over the whole panel would hide it
SPACE = 0.08  # of the masses' range, above and below


def payload_figure(result: TrackResult) -> Plot:
    """Payload and residual over time, with the stretches, the changes and the true schedule."""
    track, stretches = result.track, result.track.stretches
    titles = ("payload, kg", f"residual over the sensors' noise, RMS of each {CELL:g} s")
    panels = Panels(titles, height=320, together=True)
    t, low, m_p, high, left = _thinned(result)
    panels.band(0, t, low, high, "its 95 % band")
    panels.curve(0, t, m_p, f"m_p(t) from ± {HALF_BAND:g} s around", BLUE, 1.2)
    ends = np.array([[one.start, one.end] for one in stretches]).ravel()
    masses = np.repeat([one.m_p for one in stretches], 2)
    panels.curve(0, ends, masses, "mass of each stretch", GREEN, 2.6)
    reach = [[one.m_p, *one.ci95] for one in stretches]
    if result.schedule is not None:
        first, last = float(ends[0]), float(ends[-1])
        steps = [(max(time, first), mass) for time, mass in result.schedule if time < last]
        corners = np.repeat([time for time, _ in steps], 2).tolist()
        true = np.repeat([0.0, *(mass for _, mass in steps)], 2)
        panels.curve(
            0, np.array([first, *corners, last]), true, "true schedule", ORANGE, 1.6, "dash"
        )
        reach.append(true.tolist())
    if len(track.changes) <= MOST_MARKS:
        for _, start, end in track.changes.tolist():
            for place in (0, 1):
                panels.stretch(place, start, end, ORANGE)
    # masses, their intervals and the truth; m_p(t) where it is as certain as usual, less jolts
    certain = track.std <= 3 * np.median(track.std)
    half = NORMAL * track.std[certain]
    reach.append([np.percentile(track.m_p[certain] - half, 1)])
    reach.append([np.percentile(track.m_p[certain] + half, 99)])
    least, most = min(map(min, reach)), max(map(max, reach))
    space = SPACE * (most - least) or 0.05
    panels.axes(0, y={"range": [least - space, most + space]})
    panels.curve(1, t, left, "residual", ORANGE, 1.0)
    panels.line(1, y=1.0)
    panels.axes(1, "time, s", {"rangemode": "tozero"})
    reading = (
        "Blue should run level, green within its band; the payload may step in the orange bands. "
        "A band that opens wide shows that the arm moved too little. A residual about 1 is the "
        "sensors' noise; more is torque that neither arm nor payload explains."
    )
    note = f"Median of the residual over the noise: {float(np.median(track.left)):.2f}."
    return Plot("payload", "Payload in time", panels, reading, note)


def _thinned(result: TrackResult) -> tuple[FloatArray, ...]:
    """Time, band's lower end, m_p, upper end and residual, broken at holes and between stretches.

    Of each bucket the lowest and the highest value.
    """
    track = result.track
    size = max(1, -(-2 * track.t.size // POINTS))
    half = NORMAL * track.std
    series = np.stack([track.t, track.m_p - half, track.m_p, track.m_p + half, track.left])
    apart = (np.diff(track.stretch) != 0) | (np.diff(track.t) > HOLE + CELL)
    parts = []
    for part in np.split(series, np.flatnonzero(apart) + 1, axis=1):
        if size > 2:
            at = np.arange(0, part.shape[1], size)
            low, high = np.minimum.reduceat(part, at, axis=1), np.maximum.reduceat(part, at, axis=1)
            part = np.stack([low, high], axis=2).reshape(5, -1)
            part[1], part[3] = np.repeat(low[1], 2), np.repeat(high[3], 2)
        gap = np.full((5, 1), np.nan)
        gap[0] = part[0, -1]
        parts += [part, gap]
    return tuple(np.concatenate(parts, axis=1))
