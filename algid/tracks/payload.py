"""The payload in time: stretches of constant mass, their intervals, and m_p(t) with its band.

The variance of a mass is what its rows leave open and what the arm's own uncertainty adds,

    var m_p = s² / A + Jᵀ Σ J,    J = T / A

with Σ the covariance of constants and link lengths, T the cells' sensitivity to them and s² the
rows' variance where it exceeds one, slow errors (`algid.tracks.change_points`) included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise, starmap
from operator import itemgetter

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import HOLE
from algid.base.significance import NORMAL
from algid.estimators.problem import TooShortError
from algid.signals.segments import Segment
from algid.tracks.arm import IdentifiedArm
from algid.tracks.cells import CELL, Cells, cells_of, joined
from algid.tracks.change_points import (
    AHEAD,
    BEHIND,
    PENALTY,
    SHORTEST,
    Segmentation,
    first_segmentation,
    rough_variance,
    variance,
)
from algid.tracks.change_times import Changes, ChangeTime, Confirmation, cut_to
from algid.tracks.drift import Drift, drift_of

ROUNDS = 2  # of linearising each stretch at its own mass and looking for the changes again
FEWEST = 4  # cells that weigh a stretch
CALM = 1  # cells more on both sides of the times at which a payload may be changing
LASTING = 2.5  # s: for so long friction that drifts counts as constant where rows are linearised
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
        return self.m_p - NORMAL * self.std, self.m_p + NORMAL * self.std

    @property
    def empty(self) -> bool:
        """True if the 95 % interval contains zero."""
        low, high = self.ci95
        return low <= 0 <= high


@dataclass(frozen=True, eq=False)
class Track:
    """Stretches; m_p(t), its standard deviation and its stretch at each instant, each (C,).

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
    parts = cells_of(source(), arm, arm.k, settle=False)
    if not parts or sum(map(len, parts)) < 2 * SHORTEST:
        raise TooShortError(f"the log is too short: expected {2 * SHORTEST * CELL:g} s at least")
    cells = joined(parts)
    segments = first_segmentation(cells)
    for _ in range(ROUNDS):
        rough = _cut(cells, segments.places)
        cells = joined(_settled(source, arm, rough, segments.drift))
        segments = first_segmentation(cells)
    changes = _changes(source, arm, cells, segments)
    inner = _inner_parts(cells, changes)
    # whitening remembers: what a stretch is weighed by starts behind the jolt at its beginning
    settled = _settled(source, arm, inner, segments.drift)
    return _weigh(cells, changes, settled, arm, covariance)


def _masses(parts: Sequence[Cells], drift: Drift) -> list[float]:
    """What each part's payload weighs, friction's drift freed."""
    return [drift.freed(part).mass for part in parts]


def _cut(cells: Cells, places: Sequence[int]) -> list[Cells]:
    """The cells between each two neighbouring places."""
    return list(starmap(cells.part, pairwise(places)))


def _changes(
    source: Pass, arm: IdentifiedArm, cells: Cells, rough: Segmentation
) -> list[ChangeTime]:
    """Changes of the payload: those that cells show, as far as their rows confirm them."""
    places = []
    for place in rough.places[1:-1]:
        safe = float(cells.start[place - AHEAD]), float(cells.start[place]) + BEHIND * CELL
        places.append(ChangeTime(float(cells.start[place]), safe, safe, np.inf))
    masses = _masses(_cut(cells, rough.places), rough.drift)
    changes = Changes(tuple(places), tuple(masses))
    ends = (float(cells.start[0]), float(cells.end[-1]))
    evidence = Confirmation(
        source, arm, rough.drift, ends, PENALTY * rough.variance, rough.variance
    )
    return evidence.of(changes)


def _weigh(
    cells: Cells,
    changes: Sequence[ChangeTime],
    inner: Sequence[Cells],
    arm: IdentifiedArm,
    covariance: FloatArray,
) -> Track:
    """The track of a log with payload changes at `changes`, each stretch from its `inner` cells."""
    counts = list(map(len, inner))
    places = np.append(0, np.cumsum(counts))
    starts = places[:-1]
    whole = joined(inner)
    drift = drift_of(whole, starts, rough_variance(whole))
    calm = drift.freed(whole)
    information = np.maximum(np.add.reduceat(calm.A, starts), 1e-300)
    weights = np.add.reduceat(calm.B, starts) / information
    masses = np.repeat(weights, counts)
    V = calm.friction_sensitivity(arm, masses)
    T = drift.sensitivity(calm, starts, calm.sensitivity(arm, masses), V)
    parts = list(pairwise(places.tolist()))
    colour = variance(calm, parts, known=(T, covariance), robust=False)
    squares = calm.squares(masses)
    own = np.add.reduceat(squares, starts) / (np.add.reduceat(calm.rows, starts) - 1)
    noise = np.maximum(own, colour)  # a stretch's own, or the log's where that is larger
    J = np.add.reduceat(T, starts) / information[:, None]
    scatter = 1 / information + drift.variances(calm, starts)
    stds = np.sqrt(noise * scatter + np.einsum("kx,xy,ky->k", J, covariance, J))
    curves = []
    for (first, last), one in zip(parts, noise, strict=True):
        curves.append(_band(calm.part(first, last), T[first:last], covariance, one, drift))
    t, m_p, std = np.concatenate(curves, axis=1)
    signal, left = calm.Q.sum() - calm.rows.sum(), max(squares.sum() - calm.rows.sum(), 0.0)
    share = float(1 - left / signal) if signal > 0 else 0.0
    wide = np.flatnonzero(cells.start[1:] - cells.end[:-1] > HOLE)
    times = [float(cells.start[0]), *(one.time for one in changes), float(cells.end[-1])]
    brackets = [(one.time, *one.bracket) for one in changes]
    stretches = []
    for (start, end), mass, one in zip(pairwise(times), weights, stds, strict=True):
        stretches.append(Stretch(start, end, float(mass), float(one)))
    return Track(
        stretches=stretches,
        t=t,
        m_p=m_p,
        std=std,
        stretch=np.repeat(np.arange(len(inner)), counts).astype(np.float64),
        left=np.sqrt(np.maximum(squares, 0.0) / calm.rows),
        changes=np.array(brackets).reshape(-1, 3),
        colour=colour,
        explained=share,
        holes=np.stack([cells.end[wide], cells.start[wide + 1]], axis=1),
        tip_equivalent=arm.tip_equivalent,
    )


def _settled(source: Pass, arm: IdentifiedArm, rough: Sequence[Cells], drift: Drift) -> list[Cells]:
    """Each stretch's cells, linearised again at its own mass and friction, in one pass."""
    parts, about, counts = [], [], []
    for cells, mass in zip(rough, _masses(rough, drift), strict=True):
        own = _short(cells, drift)
        counts.append(len(own))
        parts += own
        about += [_coefficients(arm, mass, part, drift) for part in own]
    settled = list(parts)
    for place, segments in groupby(_by_part(source(), arm, parts), key=itemgetter(0)):
        linearised = cells_of((segment for _, segment in segments), arm, about[place])
        if linearised:
            settled[place] = joined(linearised)
    ends = np.cumsum([0] + counts).tolist()
    return [joined(settled[first:last]) for first, last in pairwise(ends)]


def _short(cells: Cells, drift: Drift) -> list[Cells]:
    """Parts of a stretch so short that friction hardly changes in them."""
    if not drift.phi.any():
        return [cells]
    count = max(1, round(len(cells) * CELL / LASTING))
    return _cut(cells, np.linspace(0, len(cells), count + 1).astype(int).tolist())


def _coefficients(arm: IdentifiedArm, mass: float, part: Cells, drift: Drift) -> FloatArray:
    """The arm's coefficients (q,) with a payload of `mass` kg, and with friction as in the part.

    The angles' noise passes through the torque's partial derivatives, friction's among them: where
    these are of another friction, rows have not the noise that is reckoned with, and masses err.
    """
    c = arm.k + mass * arm.unit
    c[arm.friction] += drift.at(part.middle).mean(axis=0)
    return c


def _by_part(
    log: Iterable[Segment], arm: IdentifiedArm, parts: Sequence[Cells]
) -> Iterator[tuple[int, Segment]]:
    """The log's segments cut at the parts' ends, each with its part's number."""
    for segment in log:
        end = segment.start + len(segment) * segment.dt
        for place, cells in enumerate(parts):
            if cells.start[0] < end and cells.end[-1] > segment.start:
                part = cut_to(segment, float(cells.start[0]), float(cells.end[-1]), arm.shift)
                if part is not None:
                    yield place, part


def _inner_parts(cells: Cells, changes: Sequence[ChangeTime]) -> list[Cells]:
    """Cells of each stretch where its payload surely is constant, or some in its middle."""
    parts = []
    for place in range(len(changes) + 1):
        start, first = -np.inf, 0
        if place > 0:
            before = changes[place - 1]
            start = before.time
            first = int(np.searchsorted(cells.start, before.safe[1])) + CALM
        end, last = np.inf, len(cells)
        if place < len(changes):
            after = changes[place]
            end = after.time
            last = int(np.searchsorted(cells.end, after.safe[0], side="right")) - CALM
        if last - first < FEWEST:
            own = np.searchsorted(cells.start, [start, end])
            first = min(max(int(own.sum() - FEWEST) // 2, 0), len(cells) - FEWEST)
            last = first + FEWEST
        parts.append(cells.part(first, last))
    return parts


def _band(
    cells: Cells, T: FloatArray, covariance: FloatArray, noise: float, drift: Drift
) -> FloatArray:
    """Times, masses and their standard deviations (3, C) along a stretch.

    Each cell's mass comes from its neighbourhood within the stretch; `noise` is the variance of
    the rows.
    """
    half = round(HALF_BAND / CELL)
    low = np.clip(np.arange(len(cells)) - half, 0, None)
    high = np.clip(np.arange(len(cells)) + half + 1, None, len(cells))

    def moving(x: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros_like(x[:1]), np.cumsum(x, axis=0)])
        return np.asarray(total[high] - total[low])

    A = np.maximum(moving(cells.A), 1e-300)
    J, by_friction = moving(T) / A[:, None], moving(cells.S[:, cells.friction]) / A[:, None]
    scatter = 1 / A + drift.variance_at(cells.middle, by_friction)
    std = np.sqrt(noise * scatter + np.einsum("cx,xy,cy->c", J, covariance, J))
    return np.stack([cells.middle, moving(cells.B) / A, std])
