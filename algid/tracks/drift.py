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
from dataclasses import dataclass
from itertools import pairwise

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

    Both are zero where friction is as the arm's constants have it. `by_mass` (K, H f) is G / A of
    the groups of cells whose masses were free beside it.
    """

    knots: FloatArray
    phi: FloatArray
    covariance: FloatArray
    by_mass: FloatArray

    def freed(self, cells: Cells) -> Cells:
        """The cells of a log whose friction is as its arm's constants have it."""
        return cells.less(np.insert(self.at(cells.middle), 0, 0.0, axis=1))

    def at(self, t: FloatArray) -> FloatArray:
        """Φ (C, f) at the times `t` (C,)."""
        return between(self.knots, self.phi, t)

    @property
    def variances(self) -> FloatArray:
        """Part of φ in the variances (K,) of the groups' masses, for unit variance."""
        return variances(self.by_mass, self.covariance)

    def variance_at(self, t: FloatArray, slope: FloatArray) -> FloatArray:
        """Variances (C,) at the times `t` (C,) of what changes by `slope` (C, f) with φ."""
        f, near = slope.shape[1], np.abs(t[:, None] - self.knots).argmin(axis=1)
        blocks = self.covariance.reshape(self.knots.size, f, self.knots.size, f)
        return np.einsum("cf,cfg,cg->c", slope, blocks[near, :, near], slope)

    def followed(self, cells: Cells, starts: NDArray[np.int64], T: FloatArray) -> FloatArray:
        """Shift (C, p) of the masses' scores by the arm's constants, while φ follows that of D.

        `T` (C, 1 + f, p) is how `Cells.b` shifts with them.
        """
        shift = _onto(self.knots, cells.middle, T[:, 1:])
        score = shift.reshape(-1, T.shape[2]) - self.by_mass.T @ np.add.reduceat(T[:, 0], starts)
        phi = between(self.knots, (self.covariance @ score).reshape(shift.shape), cells.middle)
        return np.asarray(T[:, 0] - np.einsum("cf,cfp->cp", cells.M[:, 0, 1:], phi))


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
    first, last = float(cells.start[0]), float(cells.end[-1])
    spaces = min(MOST_KNOTS, max(1, round((last - first) / SPACING)))
    knots, M, t = np.linspace(first, last, spaces + 1), cells.M, cells.middle
    count, f = knots.size, M.shape[1] - 1
    A = np.maximum(np.add.reduceat(cells.A, starts), 1e-300)
    G, N = np.zeros((starts.size, count, f)), np.zeros((count, count, f, f))
    group = np.searchsorted(starts, np.arange(t.size), side="right") - 1
    for two, own, hats in _intervals(knots, t):
        N[two, two] += np.einsum("ac,bc,cfg->abfg", hats, hats, M[own, 1:, 1:])
        found, runs = np.unique(group[own], return_index=True)
        G[found, two] += np.add.reduceat(hats.T[:, :, None] * M[own, :1, 1:], runs)
    size = count * f
    G, N = G.reshape(starts.size, size), N.swapaxes(1, 2).reshape(size, size)
    by_mass = G / A[:, None]
    score = _onto(knots, t, cells.b[:, 1:]).ravel() - by_mass.T @ np.add.reduceat(cells.B, starts)
    scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
    scaled = (N - by_mass.T @ G) / np.outer(scale, scale) + _RIDGE * np.eye(scale.size)
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    phi = inverse @ score
    chance = scale.size + SURE * np.sqrt(2 * scale.size)
    if not score @ phi > variance * chance:
        phi, inverse = 0 * phi, 0 * inverse
    return Drift(knots, phi.reshape(count, f), inverse, by_mass)


def variances(J: FloatArray, covariance: FloatArray) -> FloatArray:
    """Variances (N,) of what has the derivatives J (N, p) by p parameters."""
    return np.einsum("nx,xy,ny->n", J, covariance, J)


def between(knots: FloatArray, values: FloatArray, t: FloatArray) -> FloatArray:
    """Values (C, ...) at times `t` (C,) by linear interpolation of (H, ...) at the knots (H,)."""
    found = np.empty((t.size, *values.shape[1:]))
    for two, own, hats in _intervals(knots, t):
        found[own] = np.tensordot(hats.T, values[two], axes=1)
    return found


def _onto(knots: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Sums (H, ...) of values (C, ...) at the times `t` (C,), each times its knot's hat."""
    sums = np.zeros((knots.size, *values.shape[1:]))
    for two, own, hats in _intervals(knots, t):
        sums[two] += np.tensordot(hats, values[own], axes=1)
    return sums


def _intervals(knots: FloatArray, t: FloatArray) -> Iterator[tuple[slice, slice, FloatArray]]:
    """Of each two neighbouring knots their places, those of the times between, and hats (2, c).

    The times `t` (C,) increase. Those before the first knot or behind the last one are between the
    two next to it.
    """
    edges = np.searchsorted(t, knots)
    edges[[0, -1]] = 0, t.size
    for first, (start, end) in enumerate(pairwise(edges.tolist())):
        if start < end:
            late = (t[start:end] - knots[first]) / (knots[first + 1] - knots[first])
            yield slice(first, first + 2), slice(start, end), np.stack([1 - late, late])
