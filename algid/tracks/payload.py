"""The payload in time: stretches of constant mass, their intervals, and m_p(t) with its band.

The variance of a mass is what its rows leave open and what the arm's own uncertainty adds,

    var m_p = s² / A + Jᵀ Σ J,    J = T / A

with Σ the covariance of constants and link lengths, T the cells' sensitivity to them and s² the
rows' variance where it exceeds one, slow errors (`algid.tracks.change_points`) included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from algid.arm import FloatArray
from algid.estimators.too_short import TooShortError
from algid.signals.differences import Stencil
from algid.signals.segments import Segment
from algid.tracks.bins import CELL, Cells, IdentifiedArm, cells_of, joined
from algid.tracks.change_points import CALM, GUARD, SHORTEST, Edges, edges, variance

QUANTILE = 1.959964  # of the normal distribution, for 95 %
ROUNDS = 2  # of linearising each stretch at its own mass and looking for the changes again
HOLE = 0.3  # s: cells this far apart have no log between them
FEWEST = 4  # cells that weigh a stretch
HALF_BAND = 0.25  # s: m_p(t) rests on so much log on both sides of t

Pass = Callable[[], Iterable[Segment]]


@dataclass(frozen=True)
class Stretch:
    """A time in s during which the payload was m_p kg, with its standard deviation."""

    start: float
    end: float
    m_p: float
    std: float

    @property
    def ci95(self) -> tuple[float, float]:
        """The 95 % interval, kg."""
        return self.m_p - QUANTILE * self.std, self.m_p + QUANTILE * self.std


@dataclass(frozen=True, eq=False)
class Track:
    """Stretches, and m_p(t) with its standard deviation and the stretch that each instant lies in, each (C,).

    Times at which the payload may be changing have no m_p(t).
    `left` (C,) is the RMS of what arm and payload leave of the torque, over the sensors' noise.
    `changes` (n, 3) are each change's time in s, and the times between which it surely lies.
    `colour` is the rows' variance over that of sensor noise, slow errors included: above one, the
    arm's model lacks something. `explained` is the share of the torque's power, noise aside, that
    arm and payload explain. `holes` (h, 2) are the times from and to which the log has no samples.
    `tip_equivalent` is the mass in kg that at the tip would weigh on joint 2 as link 2 does.
    """

    stretches: list[Stretch]
    t: FloatArray
    m_p: FloatArray
    std: FloatArray
    stretch: FloatArray
    left: FloatArray
    changes: FloatArray
    colour: float
    explained: float
    holes: FloatArray
    tip_equivalent: float


def track(source: Pass, arm: IdentifiedArm, covariance: FloatArray) -> Track:
    """Find the payload's stretches in a log.

    Parameters
    ----------
    source : callable
        Gives a fresh iterable of the log's `Segment`; called four times.
    arm : Arm
    covariance : (q + 2, q + 2) float64
        Of the arm's coefficients and link lengths.

    Raises
    ------
    TooShortError
        If the log is too short.
    """
    parts = cells_of(source(), arm, mass=0.0, settle=0)
    if not parts or sum(map(len, parts)) < 2 * SHORTEST:
        raise TooShortError(f"the log is too short: expected {2 * SHORTEST * CELL:g} s at least")
    cells = joined(parts)
    found = edges(cells, arm)
    for _ in range(ROUNDS):
        cells = joined(
            _settled(source, arm, [cells.part(*ends) for ends in pairwise(found.places)])
        )
        found = edges(cells, arm)
    # whitening remembers: what a stretch is weighed by starts behind the jolt at its beginning
    return _weigh(cells, found, _settled(source, arm, _inner_parts(cells, found)), arm, covariance)


def _weigh(
    cells: Cells, found: Edges, inner: Sequence[Cells], arm: IdentifiedArm, covariance: FloatArray
) -> Track:
    """The track whose stretches are `found` among `cells`, each weighed by its `inner` ones."""
    counts, calm = [len(part) for part in inner], joined(inner)
    masses = np.repeat([part.mass for part in inner], counts)
    colour, squares = variance(calm, masses, arm, covariance), calm.squares(masses)
    stds, curves = zip(*(_band(part, arm, covariance, colour) for part in inner), strict=True)
    t, m_p, std = np.concatenate(curves, axis=1)
    signal, left = calm.Q.sum() - calm.rows.sum(), max(squares.sum() - calm.rows.sum(), 0.0)
    changes = [
        (cells.start[at], cells.start[low - GUARD], cells.end[high + GUARD - 1])
        for at, (low, high) in zip(found.places[1:-1], found.spans, strict=True)
    ]
    wide = np.flatnonzero(cells.start[1:] - cells.end[:-1] > HOLE)
    return Track(
        stretches=[
            Stretch(float(cells.start[first]), float(cells.end[last - 1]), part.mass, one)
            for (first, last), part, one in zip(pairwise(found.places), inner, stds, strict=True)
        ],
        t=t,
        m_p=m_p,
        std=std,
        stretch=np.repeat(np.arange(len(inner)), counts).astype(np.float64),
        left=np.sqrt(np.maximum(squares, 0.0) / calm.rows),
        changes=np.array(changes, dtype=np.float64).reshape(-1, 3),
        colour=colour,
        explained=float(1 - left / signal) if signal > 0 else 0.0,
        holes=np.stack([cells.end[wide], cells.start[wide + 1]], axis=1),
        tip_equivalent=arm.tip_equivalent,
    )


def _settled(source: Pass, arm: IdentifiedArm, rough: Sequence[Cells]) -> list[Cells]:
    """Each stretch's cells, linearised again at its own mass, in one pass over the log."""
    found = list(rough)
    for place, own in groupby(_by_stretch(source(), arm, rough), key=itemgetter(0)):
        if cells := cells_of((segment for _, segment in own), arm, rough[place].mass):
            found[place] = joined(cells)
    return found


def _by_stretch(
    log: Iterable[Segment], arm: IdentifiedArm, rough: Sequence[Cells]
) -> Iterator[tuple[int, Segment]]:
    """The log's segments cut at the stretches' ends, each with its stretch's number."""
    for segment in log:
        end = segment.start + len(segment) * segment.dt
        for place, cells in enumerate(rough):
            if cells.start[0] < end and cells.end[-1] > segment.start:
                part = cut_to(segment, float(cells.start[0]), float(cells.end[-1]), arm.shift)
                if part is not None:
                    yield place, part


def cut_to(segment: Segment, start: float, end: float, shift: float) -> Segment | None:
    """The samples that give the torques from `start` to `end` s, their stencils' included.

    None where it has none.

    `shift` is the time in s after which a logged torque acts.
    """
    given = Stencil(segment.dt, shift).torques(len(segment))  # the others serve the stencil
    first = round((start - segment.start) / segment.dt) - given.start
    last = round((end - segment.start) / segment.dt) + len(segment) - given.stop
    first, last = max(0, first), min(len(segment), last)
    return segment.part(first, last) if last - first > 1 else None


def _inner_parts(cells: Cells, found: Edges) -> list[Cells]:
    """Each stretch's cells, less those around the changes at its ends.

    At least some of its middle.
    """
    begins = [found.places[0], *(high + GUARD + CALM for _, high in found.spans)]
    ends = [*(low - GUARD - CALM for low, _ in found.spans), found.places[-1]]
    parts = []
    for place, (first, last) in enumerate(pairwise(found.places)):
        begin, end = begins[place], ends[place]
        if end - begin < FEWEST:
            begin, end = min(first + GUARD, last - FEWEST), max(last - GUARD, first + FEWEST)
        parts.append(cells.part(begin, end))
    return parts


def _band(
    cells: Cells, arm: IdentifiedArm, covariance: FloatArray, colour: float
) -> tuple[float, FloatArray]:
    """The standard deviation of a stretch's mass.

    times, masses and their standard deviations (3, C) along it.

    Along the stretch each cell's mass comes from its neighbourhood within the stretch.
    """
    # the stretch's own variance of rows, or the log's where that is larger
    noise = max(colour, float(cells.squares(cells.mass).sum() / (cells.rows.sum() - 1)))
    half, T = round(HALF_BAND / CELL), cells.sensitivity(arm, cells.mass)
    low = np.clip(np.arange(len(cells)) - half, 0, None)
    high = np.clip(np.arange(len(cells)) + half + 1, None, len(cells))

    def moving(x: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
        return np.asarray(total[high] - total[low])

    def std(A: FloatArray, T: FloatArray) -> FloatArray:
        J = T / A[:, None]
        return np.sqrt(noise / A + np.einsum("cx,xy,cy->c", J, covariance, J))

    A, B = np.maximum(moving(cells.A), 1e-300), moving(cells.B)
    whole = std(np.maximum([cells.A.sum()], 1e-300), T.sum(axis=0)[None])
    return float(whole[0]), np.stack([(cells.start + cells.end) / 2, B / A, std(A, moving(T))])
