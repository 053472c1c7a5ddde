"""The payload in time: stretches of constant mass, their intervals, and m_p(t) with its band.

The variance of a mass is what its rows leave open and what the arm's own uncertainty adds,

    var m_p = s² / A + (J / A)ᵀ Σ (J / A),    J = [S, m_p S ∂d/∂l1, m_p S ∂d/∂l2]

with Σ the covariance of constants and link lengths and s² the rows' own variance where it exceeds one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from algid.arm import FloatArray
from algid.sampling import Segment
from algid.track.cells import CELL, Arm, Cells, cells_of, joined
from algid.track.changes import cuts

QUANTILE = 1.959964  # of the normal distribution, for 95 %
SHORTEST = 10  # cells: no object is carried for less than 0.2 s
GUARD = 3  # cells left out on both sides of a change, which lies somewhere among them
PENALTY = 60.0  # of a change: 7.7 standard deviations, far beyond what white rows reach
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
    """Stretches, and m_p(t) with its standard deviation and the stretch that each instant lies in, each (C,)."""

    stretches: list[Stretch]
    t: FloatArray
    m_p: FloatArray
    std: FloatArray
    stretch: FloatArray


def track(source: Pass, arm: Arm, covariance: FloatArray) -> Track:
    """Find the payload's stretches in a log.

    Parameters
    ----------
    source : callable
        Gives a fresh iterable of the log's `Segment`.
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
    rough = joined(parts)
    penalty = PENALTY * _roughness(rough)
    edges = _merged([0, *cuts(rough.A, rough.B, penalty, SHORTEST), len(rough)], rough, penalty)
    found = [_settled(source, arm, rough.part(first, last)) for first, last in pairwise(edges)]
    inner = [_inner(cells, place > 0, place < len(found) - 1) for place, cells in enumerate(found)]
    stretches = [_stretch(cells, kept, arm, covariance) for cells, kept in zip(found, inner, strict=True)]
    curves = [_curve(cells, arm, covariance, s.m_p) for cells, s in zip(found, stretches, strict=True)]
    number = np.repeat(np.arange(len(found)), [len(cells) for cells in found]).astype(np.float64)
    t, m_p, std = np.concatenate(curves, axis=1)
    return Track(stretches, t, m_p, std, number)


def _roughness(cells: Cells) -> float:
    """Variance of the rows about masses that hold for a few cells, one at least."""
    groups = len(cells) // SHORTEST
    A, B, E, rows = (
        x[: groups * SHORTEST].reshape(groups, -1).sum(axis=1) for x in (cells.A, cells.B, cells.E, cells.rows)
    )
    left = (E - B**2 / np.maximum(A, 1e-300)) / rows
    return max(1.0, float(np.median(left)))  # groups that hold a change are few


def _merged(edges: list[int], cells: Cells, penalty: float) -> list[int]:
    """Edges less those that cells away from them do not need: a grasp jolts the cells it falls among."""
    while len(edges) > 2:
        worths = [_worth(cells, *edges[place : place + 3]) for place in range(len(edges) - 2)]
        weakest = int(np.argmin(worths))
        if worths[weakest] > penalty:
            break
        edges = edges[: weakest + 1] + edges[weakest + 2 :]
    return edges


def _worth(cells: Cells, first: int, cut: int, last: int) -> float:
    """Squared difference of the masses on both sides of a cut over its variance."""
    left, right = cells.part(first + GUARD, cut - GUARD), cells.part(cut + GUARD, last - GUARD)
    A, B = (np.array([x.A.sum() for x in (left, right)]), np.array([x.B.sum() for x in (left, right)]))
    return float(np.diff(B / A)[0] ** 2 / np.sum(1 / A))


def _settled(source: Pass, arm: Arm, rough: Cells) -> Cells:
    """The stretch's cells, linearised again at its own mass."""
    start, end = rough.start[0], rough.end[-1]
    mass = float(rough.B.sum() / max(rough.A.sum(), 1e-300))
    own = cells_of((cut for segment in source() if (cut := _cut(segment, start, end)) is not None), arm, mass)
    return joined(own) if own else rough


def _cut(segment: Segment, start: float, end: float) -> Segment | None:
    first = max(0, round((start - segment.start) / segment.dt) - 3)  # what the stencil takes away
    last = min(len(segment), round((end - segment.start) / segment.dt) + 3)
    return segment.part(first, last) if last - first > 1 else None


def _inner(cells: Cells, before: bool, after: bool) -> Cells:
    """Cells away from the changes at the stretch's ends."""
    return cells.part(GUARD if before else 0, len(cells) - (GUARD if after else 0))


def _stretch(whole: Cells, cells: Cells, arm: Arm, covariance: FloatArray) -> Stretch:
    A, B, S = cells.A.sum(), cells.B.sum(), cells.S.sum(axis=0)
    mass = float(B / A)
    noise = max(1.0, float((cells.E.sum() - B * mass) / (cells.rows.sum() - 1)))
    std = float(_std(np.array([A]), S[None], mass, noise, arm, covariance)[0])
    return Stretch(float(whole.start[0]), float(whole.end[-1]), mass, std)


def _curve(cells: Cells, arm: Arm, covariance: FloatArray, mass: float) -> FloatArray:
    """Times, masses and their standard deviations (3, C), each cell from its neighbourhood within the stretch."""
    half = round(HALF_BAND / CELL)
    low = np.clip(np.arange(len(cells)) - half, 0, None)
    high = np.clip(np.arange(len(cells)) + half + 1, None, len(cells))

    def moving(x: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
        return np.asarray(total[high] - total[low])

    A, B = moving(cells.A), moving(cells.B)
    noise = max(1.0, float((cells.E.sum() - cells.B.sum() * mass) / (cells.rows.sum() - 1)))
    std = _std(A, moving(cells.S), mass, noise, arm, covariance)
    return np.stack([(cells.start + cells.end) / 2, B / A, std])


def _std(A: FloatArray, S: FloatArray, mass: float, noise: float, arm: Arm, covariance: FloatArray) -> FloatArray:
    g, l1, l2 = arm.model.gravity, arm.l1, arm.l2
    by_l1 = arm.added(np.array([2 * l1, 0.0, l2, g, 0.0]))
    by_l2 = arm.added(np.array([0.0, 2 * l2, l1, 0.0, g]))
    J = np.column_stack([S, mass * (S @ by_l1), mass * (S @ by_l2)]) / A[:, None]
    return np.sqrt(noise / A + np.einsum("cx,xy,cy->c", J, covariance, J))
