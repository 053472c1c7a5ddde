"""The payload in time: stretches of constant mass, their intervals, and m_p(t) with its band.

The variance of a mass is what its rows leave open and what the arm's own uncertainty adds,

    var m_p = s² / A + Jᵀ Σ J,    J = T / A

with Σ the covariance of constants and link lengths, T the cells' sensitivity to them and s² the rows' variance
where it exceeds one, slow errors (`algid.track.colour`) included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from algid.arm import FloatArray
from algid.identify.stencil import Stencil
from algid.sampling import Segment
from algid.track.cells import CELL, Arm, Cells, cells_of, joined
from algid.track.edges import GUARD, SHORTEST, edges

QUANTILE = 1.959964  # of the normal distribution, for 95 %
ROUNDS = 2  # of linearising each stretch at its own mass and looking for the changes again
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

    `colour` is the variance of the rows over that of sensor noise: above one, the arm's model lacks something.
    """

    stretches: list[Stretch]
    t: FloatArray
    m_p: FloatArray
    std: FloatArray
    stretch: FloatArray
    colour: float


def track(source: Pass, arm: Arm, covariance: FloatArray) -> Track:
    """Find the payload's stretches in a log.

    Parameters
    ----------
    source : callable
        Gives a fresh iterable of the log's `Segment`; called three times.
    arm : Arm
    covariance : (q + 2, q + 2) float64
        Of the arm's coefficients and link lengths.

    Raises
    ------
    ValueError
        If the log is too short.
    """
    parts = cells_of(source(), arm, mass=0.0, settle=0)
    if not parts or sum(map(len, parts)) < 2 * SHORTEST:
        raise ValueError(f"the log is too short: expected {2 * SHORTEST * CELL:g} s at least")
    cells = joined(parts)
    found = edges(cells, arm, covariance)
    for _ in range(ROUNDS):
        cells = joined(_settled(source, arm, _parts(cells, found.places)))
        found = edges(cells, arm, covariance)
    own = _parts(cells, found.places)
    inner = [_inner(part, place > 0, place < len(own) - 1) for place, part in enumerate(own)]
    stretches = [_stretch(whole, kept, arm, covariance, found.scale) for whole, kept in zip(own, inner, strict=True)]
    curves = [_curve(part, arm, covariance, s.m_p, found.scale) for part, s in zip(own, stretches, strict=True)]
    number = np.repeat(np.arange(len(own)), [len(part) for part in own]).astype(np.float64)
    t, m_p, std = np.concatenate(curves, axis=1)
    return Track(stretches, t, m_p, std, number, found.scale)


def _parts(cells: Cells, places: Sequence[int]) -> list[Cells]:
    return [cells.part(first, last) for first, last in pairwise(places)]


def _settled(source: Pass, arm: Arm, rough: Sequence[Cells]) -> list[Cells]:
    """Each stretch's cells, linearised again at its own mass, in one pass over the log."""
    found = list(rough)
    for place, own in groupby(_by_stretch(source(), arm, rough), key=itemgetter(0)):
        mass = float(rough[place].B.sum() / max(rough[place].A.sum(), 1e-300))
        if cells := cells_of((segment for _, segment in own), arm, mass):
            found[place] = joined(cells)
    return found


def _by_stretch(log: Iterable[Segment], arm: Arm, rough: Sequence[Cells]) -> Iterator[tuple[int, Segment]]:
    """The log's segments cut at the stretches' ends, each with its stretch's number."""
    for segment in log:
        end = segment.start + len(segment) * segment.dt
        for place, cells in enumerate(rough):
            if cells.start[0] < end and cells.end[-1] > segment.start:
                part = _cut(segment, float(cells.start[0]), float(cells.end[-1]), arm.shift)
                if part is not None:
                    yield place, part


def _cut(segment: Segment, start: float, end: float, shift: float) -> Segment | None:
    told = Stencil(segment.dt, shift).torques(len(segment))  # the others serve the stencil
    first = round((start - segment.start) / segment.dt) - told.start
    last = round((end - segment.start) / segment.dt) + len(segment) - told.stop
    first, last = max(0, first), min(len(segment), last)
    return segment.part(first, last) if last - first > 1 else None


def _inner(cells: Cells, before: bool, after: bool) -> Cells:
    """Cells away from the changes at the stretch's ends."""
    return cells.part(GUARD if before else 0, len(cells) - (GUARD if after else 0))


def _stretch(whole: Cells, cells: Cells, arm: Arm, covariance: FloatArray, colour: float) -> Stretch:
    A, B = cells.A.sum(), cells.B.sum()
    mass = float(B / max(A, 1e-300))
    T = cells.sensitivity(arm, mass).sum(axis=0)
    std = float(_std(np.array([A]), T[None], _noise(cells, mass, colour), covariance)[0])
    return Stretch(float(whole.start[0]), float(whole.end[-1]), mass, std)


def _noise(cells: Cells, mass: float, colour: float) -> float:
    """Variance of a stretch's rows: its own, or the log's where that is larger."""
    left = cells.E.sum() - 2 * mass * cells.B.sum() + mass**2 * cells.A.sum()
    return max(colour, float(left / (cells.rows.sum() - 1)))


def _curve(cells: Cells, arm: Arm, covariance: FloatArray, mass: float, colour: float) -> FloatArray:
    """Times, masses and their standard deviations (3, C), each cell from its neighbourhood within the stretch."""
    half = round(HALF_BAND / CELL)
    low = np.clip(np.arange(len(cells)) - half, 0, None)
    high = np.clip(np.arange(len(cells)) + half + 1, None, len(cells))

    def moving(x: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
        return np.asarray(total[high] - total[low])

    A, B = np.maximum(moving(cells.A), 1e-300), moving(cells.B)
    std = _std(A, moving(cells.sensitivity(arm, mass)), _noise(cells, mass, colour), covariance)
    return np.stack([(cells.start + cells.end) / 2, B / A, std])


def _std(A: FloatArray, T: FloatArray, noise: float, covariance: FloatArray) -> FloatArray:
    A = np.maximum(A, 1e-300)
    J = T / A[:, None]
    return np.sqrt(noise / A + np.einsum("cx,xy,cy->c", J, covariance, J))
