"""The banded dual form against the dense textbook problem: angles and parameters eliminated
together.
"""

import numpy as np
import pytest

from algid.estimators.whitening import (
    NoiseLevels,
    adjoint,
    covariance_factor,
    forward,
    linearise,
)
from algid.model import Model
from algid.signals.differences import HELD, POINTS, Stencil
from algid.signals.segments import Segment

from .conftest import Bench

NOISE = NoiseLevels(np.array([1e-3, 2e-3]), np.array([1e-2, 2e-2]))


def dense(H: np.ndarray, first: int, length: int) -> np.ndarray:
    """The matrix (2 n, 2 length) of a band (2, 2, POINTS, n), joint by joint within a sample."""
    n = H.shape[-1]
    matrix = np.zeros((n, 2, length, 2))
    for row in range(n):
        for point in range(POINTS):
            matrix[row, :, first + row + point] += H[:, :, point, row]
    return matrix.reshape(2 * n, 2 * length)


@pytest.mark.parametrize("taps", [np.ones(1), HELD], ids=["white", "held"])
def test_products_and_factor_agree_with_dense_algebra(taps: np.ndarray) -> None:
    """A held torque's noise is that of neighbouring samples, by F of three weights a row."""
    rng = np.random.default_rng(0)
    H = rng.standard_normal((2, 2, POINTS, 20))
    whole = dense(H, 2, 30)
    x, y = rng.standard_normal((2, 30)), rng.standard_normal((2, 20))
    assert np.allclose(forward(H, x, 2).T.ravel(), whole @ x.T.ravel())
    assert np.allclose(adjoint(H, y, 2, 30).T.ravel(), whole.T @ y.T.ravel())
    F = np.kron(moving_sum(taps, 20), np.eye(2))
    L = lower(covariance_factor(H, taps))
    np.testing.assert_allclose(L @ L.T, F @ F.T + whole @ whole.T, atol=1e-12 * 40 * POINTS)


def test_information_is_the_schur_complement_of_the_normal_equations(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    piece = Segment(0.0, log.dt, log.theta[:, 1000:1120], log.tau[:, 1000:1120])
    k, theta0 = bench.arm.constants(), bench.bare.theta[:, 1000:1120]
    linear = linearise(Model(), k, theta0, piece, Stencil(log.dt), NOISE)
    S = linear.columns[:-1] @ linear.columns[:-1].T
    g = linear.columns[:-1] @ linear.columns[-1]
    # Dense: angles' changes x (in σ_θ) and dk from [I 0; H Y] [x; dk] = [θ_m − θ0; τ_m − f], all
    # in σ.
    H = dense(linear.H, linear.first, 120)
    unwhitened = lower(linear.factor) @ linear.columns.T
    Y = unwhitened[:, :-1]
    normal = np.block([[np.eye(240) + H.T @ H, H.T @ Y], [Y.T @ H, Y.T @ Y]])
    schur = normal[240:, 240:] - normal[240:, :240] @ np.linalg.solve(
        normal[:240, :240], normal[:240, 240:]
    )
    assert np.allclose(S, schur, rtol=1e-6)
    # linearise() takes the angles' change out of its residual; the dense problem has it as rows of
    # its own.
    moved = ((piece.theta - theta0) / NOISE.theta[:, None]).T.ravel()
    residual = np.concatenate([moved, unwhitened[:, -1] + H @ moved])
    right = np.concatenate([np.eye(240), H]).T @ residual
    both = np.concatenate([right, np.concatenate([np.zeros((240, 7)), Y]).T @ residual])
    together = np.linalg.solve(normal, both)
    assert np.allclose(together[240:], np.linalg.solve(S, g), rtol=1e-5)


def moving_sum(taps: np.ndarray, n: int) -> np.ndarray:
    """The matrix (n, n + taps - 1) that weighs neighbours."""
    return np.sum([np.eye(n, n + taps.size - 1, place) * tap for place, tap in enumerate(taps)], 0)


def lower(factor: np.ndarray) -> np.ndarray:
    """The matrix of a banded factor."""
    return np.asarray(
        sum(np.diag(factor[-1 - below, below:], -below) for below in range(2 * POINTS))
    )
