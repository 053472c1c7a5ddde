"""Drift of friction since the arm was identified: it warms up, wears, or rises under a load.

An arm's friction, viscous and Coulomb, may differ from its constants by φ(t), straight lines
between knots. Masses and φ come from the same rows, by least squares over cells:

    ⎡ A   G ⎤ ⎡ m ⎤   ⎡ B ⎤
    ⎣ Gᵀ  N ⎦ ⎣ φ ⎦ = ⎣ D ⎦

======  =====================================================  =========
symbol  name                                                   shape
======  =====================================================  =========
f       how many columns of friction there are                 scalar
m       a mass for each group of cells                         (K,)
φ       change of each column's coefficient at each knot       (H f,)
A, B    information on the masses, and their scores            (K,)
G       Σ g c, c the column of friction times its hat          (K, H f)
N, D    Σ c cᵀ and Σ c e                                       (H f, H f), (H f,)
======  =====================================================  =========

Where the rows do without, φ is nothing: its price is a part of each mass's precision.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.tracks.cells import Cells

SPACING = 5.0  # s: of the knots
MOST_KNOTS = 60
BLOCK = 15  # cells that share a mass where no stretches are known yet: 0.3 s
SURE = 6.0  # standard deviations of χ² by which friction has to explain more than chance
_RIDGE = 1e-9  # of the diagonal: what a standing joint leaves open stays nothing


@dataclass(frozen=True, eq=False)
class Drift:
    """Change of friction φ (H, f) at `knots` (H,) in s; covariance (H f, H f) at unit variance.

    Both are zero where friction is as the arm's constants have it.
    """

    knots: FloatArray
    phi: FloatArray
    covariance: FloatArray

    def freed(self, cells: Cells) -> Cells:
        """The cells of a log whose friction is as its arm's constants have it."""
        phi = self.at(cells.middle)
        by_friction = cells.N[:, :, cells.friction]
        return replace(
            cells,
            B=cells.B - np.einsum("cf,cf->c", cells.S[:, cells.friction], phi),
            E=cells.E
            - 2 * np.einsum("cf,cf->c", cells.D, phi)
            + np.einsum("cf,cfg,cg->c", phi, by_friction, phi),
            D=cells.D - np.einsum("cfg,cg->cf", by_friction, phi),
        )

    def at(self, t: FloatArray) -> FloatArray:
        """Φ (C, f) at the times `t` (C,)."""
        return between(self.knots, self.phi, t)

    def variances(self, cells: Cells, starts: NDArray[np.int64]) -> FloatArray:
        """Part of φ in the variances (K,) of the masses of cell groups, for unit variance."""
        normal = _normal(cells, starts, self.knots)
        by_mass = normal.G / normal.A[:, None]
        return np.einsum("kx,xy,ky->k", by_mass, self.covariance, by_mass)

    def variance_at(self, t: FloatArray, slope: FloatArray) -> FloatArray:
        """Variances (C,) at the times `t` (C,) of what changes by `slope` (C, f) with φ."""
        f, near = slope.shape[1], np.abs(t[:, None] - self.knots).argmin(axis=1)
        blocks = self.covariance.reshape(self.knots.size, f, self.knots.size, f)
        return np.einsum("cf,cfg,cg->c", slope, blocks[near, :, near], slope)

    def sensitivity(
        self, cells: Cells, starts: NDArray[np.int64], T: FloatArray, V: FloatArray
    ) -> FloatArray:
        """T (C, p): shift of the scores by the arm's constants, while φ follows that of friction.

        `V` (C, f, p) is how `Cells.D` shifts with them.
        """
        normal = _normal(cells, starts, self.knots)
        sums = np.add.reduceat(T, starts, axis=0) / normal.A[:, None]
        shift = np.zeros((*self.phi.shape, T.shape[1]))
        for interval, own, hats in _intervals(self.knots, cells.middle):
            shift[interval] += np.einsum("hc,cfp->hfp", hats, V[own])
        by_knot = self.covariance @ (shift.reshape(-1, T.shape[1]) - normal.G.T @ sums)
        phi = between(self.knots, by_knot.reshape(shift.shape), cells.middle)
        return np.asarray(T - np.einsum("cf,cfp->cp", cells.S[:, cells.friction], phi))


@dataclass(frozen=True, eq=False)
class _Normal:
    """The normal equations of the module's table, and the knots of φ."""

    knots: FloatArray
    A: FloatArray
    B: FloatArray
    G: FloatArray
    N: FloatArray
    D: FloatArray

    @property
    def reduced(self) -> tuple[FloatArray, FloatArray]:
        """Information (H f, H f) on φ, masses free, and its scores (H f,)."""
        by_mass = self.G / self.A[:, None]
        return self.N - by_mass.T @ self.G, self.D - by_mass.T @ self.B


def no_drift(cells: Cells) -> Drift:
    """Friction as the arm's constants have it."""
    knots, f = knots_of(cells), len(cells.friction)
    return Drift(knots, np.zeros((knots.size, f)), np.zeros((knots.size * f,) * 2))


def drift_of(cells: Cells, starts: NDArray[np.int64], variance: float) -> Drift:
    """How friction changed during a log.

    Parameters
    ----------
    cells : Cells
    starts : (K,), cells at which groups begin that share a mass
    variance : float, of the rows

    Returns
    -------
    Drift
        Nothing where friction explains no more than chance does.
    """
    normal = _normal(cells, starts)
    information, score = normal.reduced
    scale = np.sqrt(np.maximum(np.diag(normal.N), 1e-300))
    scaled = information / np.outer(scale, scale) + _RIDGE * np.eye(scale.size)
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    phi = inverse @ score
    chance = scale.size + SURE * np.sqrt(2 * scale.size)
    if not score @ phi > variance * chance:
        return no_drift(cells)
    return Drift(normal.knots, phi.reshape(normal.knots.size, -1), inverse)


def knots_of(cells: Cells) -> FloatArray:
    """Times (H,) in s of the knots over a log."""
    start, end = float(cells.start[0]), float(cells.end[-1])
    return np.linspace(start, end, 1 + min(MOST_KNOTS, max(1, round((end - start) / SPACING))))


def between(knots: FloatArray, values: FloatArray, t: FloatArray) -> FloatArray:
    """Values (C, ...) at times `t` (C,) by linear interpolation of (H, ...) at the knots (H,)."""
    interval = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, knots.size - 2)
    share = (t - knots[interval]) / np.diff(knots)[interval]
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[interval] + share * values[interval + 1])


def _intervals(knots: FloatArray, t: FloatArray) -> Iterator[tuple[slice, slice, FloatArray]]:
    """For each interval its two knots, its times among the increasing `t`, their hats (2, c)."""
    ends = np.searchsorted(t, knots[1:-1])
    for place, own in enumerate(np.split(t, ends)):
        first = 0 if place == 0 else int(ends[place - 1])
        late = (own - knots[place]) / (knots[place + 1] - knots[place])
        yield slice(place, place + 2), slice(first, first + own.size), np.stack([1 - late, late])


def _normal(cells: Cells, starts: NDArray[np.int64], knots: FloatArray | None = None) -> _Normal:
    knots = knots_of(cells) if knots is None else knots
    f, count = len(cells.friction), knots.size
    group = np.searchsorted(starts, np.arange(len(cells)), side="right") - 1
    S, N = cells.S[:, cells.friction], cells.N[:, :, cells.friction]
    G, NN = np.zeros((starts.size, count, f)), np.zeros((count, f, count, f))
    D = np.zeros((count, f))
    for interval, own, hats in _intervals(knots, cells.middle):
        D[interval] += hats @ cells.D[own]
        np.add.at(G[:, interval], group[own], np.einsum("hc,cf->chf", hats, S[own]))
        NN[interval, :, interval] += np.einsum("hc,kc,cfg->hfkg", hats, hats, N[own], optimize=True)
    return _Normal(
        knots,
        np.maximum(np.add.reduceat(cells.A, starts), 1e-300),
        np.add.reduceat(cells.B, starts),
        G.reshape(starts.size, -1),
        NN.reshape(count * f, count * f),
        D.ravel(),
    )
