"""Fisher's information by hand: torques written out, derivatives by differences, covariances as
whole matrices.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.designs.information import Experiment, Information, Sensitivities
from algid.designs.position import Fourier, middles
from algid.estimators.parametrisation import Shared
from algid.estimators.whitening import NoiseLevels
from algid.model import Model, Motion
from algid.signals.differences import POINTS, Stencil

RATE = 40.0
FAMILY = Fourier(1.5)
SHARED = Shared(Model(("coulomb",), coulomb_speed=0.5), payload=True, lengths={"l1": 0.4})
# k1 … k7, f1, f2, m_p, l2
BETA = np.array([0.05, 1.0, 0.03, 4.0, 0.2, 0.3, 0.2, 0.25, 0.15, 0.5, 0.3])


def motion(seed: int = 1) -> Motion:
    x = 0.5 * FAMILY.random(np.random.default_rng(seed), np.array([-0.8, 0.4]))
    return FAMILY.motion(x, FAMILY.basis(middles(FAMILY.duration, RATE)))


def torque_by_hand(
    beta: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, loaded: bool
) -> FloatArray:
    """The torque of two links with Coulomb friction and a point mass at the tip, from Lagrange's
    equations.
    """
    k1, k2, k3, k4, k5, k6, k7, f1, f2, m, l2 = beta
    g, l1, m = 9.81, 0.4, m * loaded
    inner, outer, mixed = k5 + m * l1**2, k3 + m * l2**2, k1 + m * l1 * l2
    both = q[0] + q[1]
    weight2 = (k2 + m * g * l2) * np.cos(both)
    spin = v[0] + v[1]
    # d/dt of the momenta of the angle in space (joint 2) and of joint 1, less the kinetic energy's
    # slope
    second = (
        outer * (a[0] + a[1]) + mixed * (np.cos(q[1]) * a[0] + np.sin(q[1]) * v[0] ** 2) + weight2
    )
    turned = mixed * (np.cos(q[1]) * (a[0] + a[1]) - np.sin(q[1]) * spin**2)
    first = inner * a[0] + turned + (k4 + m * g * l1) * np.cos(q[0])
    friction = np.stack(
        [k6 * v[0] + f1 * np.tanh(v[0] / 0.5), k7 * v[1] + f2 * np.tanh(v[1] / 0.5)]
    )
    return np.stack([first + second, second]) + friction


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
            lambda b, loaded=loaded: torque_by_hand(b, one.theta, one.omega, one.alpha, loaded),
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
                    pair.append(torque_by_hand(BETA, moved[0], moved[1], moved[2], loaded))
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
