"""Friction that changes during a log: against least squares over all rows at once."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.tracks.cells import CELL, Cells
from algid.tracks.drift import drift_of

COUNT, ROWS = 600, 8
STARTS = np.array([0, 180, 400])
MASSES = np.repeat([0.3, 1.0, 0.2], [180, 220, 200])
MIDDLE = CELL * (np.arange(COUNT) + 0.5)


def rows(change: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Y (C, ROWS, 3), columns of the payload and of two frictions, and e (C, ROWS).

    Friction is up by `change` (C, 2).
    """
    Y = rng.standard_normal((COUNT, ROWS, 3))
    truth = np.column_stack([MASSES, change])
    return Y, np.einsum("crq,cq->cr", Y, truth) + rng.standard_normal((COUNT, ROWS))


def summed(Y: FloatArray, e: FloatArray) -> Cells:
    """Cells whose columns are the payload's and the two frictions'."""
    return Cells(
        MIDDLE - CELL / 2,
        MIDDLE + CELL / 2,
        np.einsum("crz,crq->czq", Y, Y),
        np.einsum("crz,cr->cz", Y, e),
        np.sum(e * e, axis=1),
        np.sum(e * e, axis=1),
        np.full(COUNT, float(ROWS)),
        np.eye(3),
    )


def rising() -> FloatArray:
    return np.stack([2 * MIDDLE / 12, 1 - 0.1 * MIDDLE], axis=1)


def test_masses_and_friction_are_those_of_least_squares_over_all_rows() -> None:
    Y, e = rows(rising(), np.random.default_rng(0))
    cells = summed(Y, e)
    found = drift_of(cells, STARTS, 1.0)
    hats = np.stack([np.interp(MIDDLE, found.knots, one) for one in np.eye(found.knots.size)])
    group = np.searchsorted(STARTS, np.arange(COUNT), side="right") - 1
    by_mass = [Y[..., 0] * (group == place)[:, None] for place in range(3)]
    by_friction = [Y[..., 1 + f] * hat[:, None] for hat in hats for f in range(2)]
    X = np.stack([*by_mass, *by_friction]).reshape(3 + 2 * len(hats), -1)
    solution = np.linalg.solve(X @ X.T, X @ e.ravel())
    covariance = np.linalg.inv(X @ X.T)
    freed = found.freed(cells)
    masses = [freed.part(*ends).mass for ends in ((0, 180), (180, 400), (400, COUNT))]
    np.testing.assert_allclose(masses, solution[:3], rtol=1e-6)
    np.testing.assert_allclose(found.phi.ravel(), solution[3:], rtol=1e-6)
    np.testing.assert_allclose(found.covariance, covariance[3:, 3:], rtol=1e-5, atol=1e-12)
    information = np.add.reduceat(cells.A, STARTS)
    np.testing.assert_allclose(
        1 / information + found.variances, np.diag(covariance)[:3], rtol=1e-6
    )
    left = e - np.einsum("crf,cf->cr", Y[..., 1:], found.at(MIDDLE))
    np.testing.assert_allclose(freed.E, np.sum(left**2, axis=1), rtol=1e-9)
    np.testing.assert_allclose(freed.b, np.einsum("crz,cr->cz", Y, left), atol=1e-9)


def test_friction_as_it_was_is_left_alone() -> None:
    """A limit of six deviations: none of 40 logs."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        found = drift_of(summed(*rows(np.zeros((COUNT, 2)), rng)), STARTS, 1.0)
        assert not found.phi.any()
