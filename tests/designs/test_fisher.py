"""Fisher's information by hand: derivatives by differences, covariances as whole matrices."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.designs.information import Experiment, Information, Sensitivities
from algid.designs.search import Fourier, middles
from algid.estimators.parametrisation import Shared
from algid.estimators.whitening import NoiseLevels
from algid.model import Model, Motion, torque
from algid.signals.differences import POINTS, Stencil

RATE = 40.0
FAMILY = Fourier(1.5)
SHARED = Shared(Model(("coulomb",), coulomb_speed=0.5), payload=True, lengths={"l1": 0.4})
# k1 … k7, f1, f2, m_p, l2
BETA = np.array([0.05, 1.0, 0.03, 4.0, 0.2, 0.3, 0.2, 0.25, 0.15, 0.5, 0.3])


def motion(seed: int = 1) -> Motion:
    x = 0.5 * FAMILY.random(np.random.default_rng(seed), np.array([-0.8, 0.4]))
    return FAMILY.motion(x, FAMILY.basis(middles(FAMILY.duration, RATE)))


def torque_of(beta: FloatArray, *moving: FloatArray, loaded: bool) -> FloatArray:
    """What `tests/estimators/test_model.py` and `test_parametrisation.py` hold against SymPy."""
    return torque(SHARED.model, SHARED.coefficients(beta, loaded), Motion(*moving))


def slopes_by(function: object, beta: FloatArray, step: float = 1e-6) -> FloatArray:
    """Central differences (2 N, Q) by each parameter."""
    columns = []
    for place in range(beta.size):
        moved = step * np.eye(beta.size)[place] * max(1.0, abs(beta[place]))
        ahead, behind = (
            function(beta + sign * moved).ravel()  # type: ignore[operator]
            for sign in (1, -1)
        )
        columns.append((ahead - behind) / (2 * moved[place]))
    return np.stack(columns, axis=1)


def by_hand(noise: NoiseLevels, runs: tuple[int, int], one: Motion, rate: float) -> FloatArray:
    """Σ Jᵀ V⁻¹ J of all runs, V = Σ_τ + G Σ_θ Gᵀ as a whole matrix."""
    n, weights = one.theta.shape[1], Stencil(1 / RATE).weights
    total = np.zeros((BETA.size, BETA.size))
    for loaded in (False, True):
        J = slopes_by(
            lambda b, loaded=loaded: torque_of(b, one.theta, one.omega, one.alpha, loaded=loaded),
            BETA,
        )
        G = np.zeros((2 * n, 2 * (n + POINTS - 1)))
        signals = [one.theta, one.omega, one.alpha]
        for order in range(3):
            for joint in range(2):
                pair = []
                for step in (1e-6, -1e-6):
                    moved = [signal.copy() for signal in signals]
                    moved[order][joint] += step
                    pair.append(torque_of(BETA, *moved, loaded=loaded))
                slope = (pair[0] - pair[1]) / 2e-6
                for sample in range(n):
                    for row in range(2):
                        place = joint * (n + POINTS - 1) + sample
                        G[row * n + sample, place : place + POINTS] += (
                            slope[row, sample] * weights[order]
                        )
        V = (
            np.diag(np.repeat(noise.tau**2, n))
            + (G * np.repeat(noise.theta**2, n + POINTS - 1)) @ G.T
        )
        total += runs[loaded] * (rate / RATE) * J.T @ np.linalg.solve(V, J)
    return total


@pytest.mark.parametrize("runs", [(1, 1), (3, 1), (0, 2)])
@pytest.mark.parametrize("sigma", [1e-12, 1e-3])
def test_information_is_that_of_the_whole_covariance(sigma: float, runs: tuple[int, int]) -> None:
    noise = NoiseLevels(np.array([sigma, 2 * sigma]), np.array([0.02, 0.05]))
    one = motion()
    experiment = Experiment(SHARED, runs, noise, 1000.0)
    assert experiment.kinds == tuple(loaded for loaded in (False, True) if runs[loaded])
    S = Information(experiment, BETA, Sensitivities(SHARED.model, one, RATE)).S
    expected = by_hand(noise, runs, one, 1000.0)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        S / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=0, atol=1e-6
    )
    np.testing.assert_allclose(S, S.T, rtol=1e-9, atol=1e-9 * np.abs(S).max())
