"""Noise levels: sixth differences, encoders' steps, and the restricted likelihood's derivatives by
dense algebra.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from algid.arm import FloatArray
from algid.estimators.noise import (
    VarianceScore,
    first_guess,
    newton_step,
    quantum,
    variance_score,
)
from algid.estimators.whitening import Linearised, NoiseLevels, linearise
from algid.model import Model
from algid.signals.differences import Stencil
from algid.signals.segments import Segment

from .conftest import DT, Bench
from .test_whitening import dense, lower, moving_sum

ANGLES = 60
LEVELS = NoiseLevels(np.array([1.2e-3, 0.8e-3]), np.array([0.9e-2, 1.3e-2]))


def test_sixth_differences_leave_nothing_of_a_quintic_and_all_of_white_noise() -> None:
    """Their variance is C(12, 6) σ².

    The median of N correlated ones scatters by less than 4 / √N of it.
    """
    t = np.linspace(-1, 1, 20_001)
    smooth = np.stack([3 * t**5 - t**2, 40 + t**4])
    noise = np.random.default_rng(0).standard_normal((4, t.size))
    found = first_guess(smooth + 1e-3 * noise[:2], smooth + 2e-2 * noise[2:])
    np.testing.assert_allclose(found.theta, 1e-3, rtol=4 / np.sqrt(t.size))
    np.testing.assert_allclose(found.tau, 2e-2, rtol=4 / np.sqrt(t.size))
    exact = first_guess(smooth, np.zeros_like(smooth))
    # rounding is less than the least that floating point can weigh
    np.testing.assert_allclose(exact.theta, 1e-12 * np.abs(smooth).max(axis=1), rtol=1e-9)
    assert np.all(exact.tau > 0)


@pytest.mark.parametrize("step", [2 * np.pi / 4096, 1e-3, 7.3])
def test_the_step_of_an_encoder_is_found_and_no_step_where_there_is_none(step: float) -> None:
    rng = np.random.default_rng(2)
    swing = 300 * step * np.sin(np.arange(2000) / 90)
    coarse = np.round(swing / step) * step
    rough = coarse * (1 + 1e-12 * rng.standard_normal(2000))  # as floating point leaves it
    found = quantum(
        np.stack([coarse, rough, swing, swing + 0.1 * step * rng.standard_normal(2000)])
    )
    np.testing.assert_allclose(found, [step, step, 0, 0], rtol=1e-9)
    few = np.repeat(np.arange(8.0), 50)  # seven changes of value are too few to tell
    assert quantum(np.stack([few, np.zeros(400)])).tolist() == [0.0, 0.0]
    # 20 steps of another size beside five that could tell
    leaps = np.cumsum([1.0] * 5 + [1000.0] * 20)
    assert quantum(leaps[None]).tolist() == [0.0]


def _parts(linear: Linearised) -> tuple[list[FloatArray], FloatArray]:
    """V_i, the four components of the covariance of e / σ_τ, and Y with e as the last column,
    dense and unwhitened.
    """
    H = dense(linear.H, linear.first, ANGLES)
    weights = moving_sum(linear.taps, linear.H.shape[-1])
    parts: list[FloatArray] = [H[:, joint::2] @ H[:, joint::2].T for joint in range(2)]
    parts += [np.kron(weights @ weights.T, np.diag(np.eye(2)[joint])) for joint in range(2)]
    return parts, lower(linear.factor) @ linear.columns.T


@pytest.fixture(scope="module", params=[False, True], ids=["foh", "zoh"])
def linear(request: pytest.FixtureRequest, bench: Bench) -> Linearised:
    log = bench.log(sigma=1e-3)
    piece = Segment(0.0, DT, log.theta[:, 900 : 900 + ANGLES], log.tau[:, 900 : 900 + ANGLES])
    theta0 = bench.bare.theta[:, 900 : 900 + ANGLES]
    return linearise(
        Model(), bench.arm.constants(), theta0, piece, Stencil(DT, held=request.param), LEVELS
    )


def test_the_score_is_that_of_dense_algebra(linear: Linearised) -> None:
    parts, columns = _parts(linear)
    V = sum(parts[1:], parts[0])
    inverse = np.linalg.inv(V)
    Y, e = columns[:, :-1], columns[:, -1]
    lam = inverse @ e
    found, whitened, change = variance_score(linear, 0)
    rounding = np.linalg.cond(V) * np.finfo(float).eps
    np.testing.assert_allclose(
        found.power, [lam @ part @ lam for part in parts], rtol=1e3 * rounding
    )
    average = [[0.5 * lam @ one @ inverse @ other @ lam for one in parts] for other in parts]
    np.testing.assert_allclose(found.average, average, atol=1e3 * rounding * np.abs(average).max())
    for one, part in zip(found.absorbed, parts, strict=True):
        expected = Y.T @ inverse @ part @ inverse @ Y
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        np.testing.assert_allclose(one / scale, expected / scale, atol=1e3 * rounding)
    # how innovations and angles follow from each log σ_i²
    factor, H = lower(linear.factor), dense(linear.H, linear.first, ANGLES)
    by_noise = np.linalg.solve(factor, np.transpose([part @ lam for part in parts])).T
    scale = np.abs(by_noise).max()
    np.testing.assert_allclose(whitened, by_noise, atol=1e3 * rounding * scale)
    angles = np.array([-H.T @ inverse @ part @ lam for part in parts])
    for joint in range(2):
        angles[joint, joint::2] += (H.T @ lam)[joint::2]
    found_angles = change.swapaxes(1, 2).reshape(4, -1)
    np.testing.assert_allclose(found_angles, angles, atol=1e3 * rounding * np.abs(angles).max())
    traces = np.array([variance_score(linear, seed)[0].trace for seed in range(30)])
    expected = np.array([np.trace(inverse @ part) for part in parts])
    assert np.all(
        np.abs(traces.mean(axis=0) - expected)
        < 4.5 * traces.std(axis=0, ddof=1) / np.sqrt(30) + 1e-9
    )
    assert traces.mean(axis=0).sum() == pytest.approx(len(V), rel=0.03)  # Σ V_i = V


@pytest.mark.parametrize("start", [(1e-6, 1.0), (1.0, 1e-6), (30.0, 0.03), (1e-6, 30.0)])
def test_a_level_that_starts_far_off_comes_to_its_own_in_ten_steps(
    start: tuple[float, float],
) -> None:
    """Of rows that white noise of the angles reaches more and more, and that of the torques alike.

    A thousand of 2000 tell a level to 2 %.
    """
    drawn = np.random.default_rng(1).standard_normal((2, 2000))
    reach = np.stack([np.geomspace(1, 1e4, 2000), np.ones(2000)])[:, None]
    e = np.sqrt(np.sum(np.square(LEVELS)[..., None] * reach, axis=0)) * drawn
    noise = NoiseLevels(start[0] * LEVELS.theta, start[1] * LEVELS.tau)
    for _ in range(10):
        parts = np.zeros((2, 2, 2, 2000))  # kind of noise and joint, and rows of each joint
        parts[:, [0, 1], [0, 1]] = np.square(noise)[..., None] * reach
        own, V = parts.reshape(4, -1), parts.sum(axis=(0, 1)).ravel()
        lam = e.ravel() / V
        average = 0.5 * (own * lam**2 / V) @ own.T
        score = VarianceScore(own @ lam**2, own @ (1 / V), average, np.zeros((4, 1, 1)))
        noise = newton_step(noise, score, np.eye(1))
    np.testing.assert_allclose(noise, LEVELS, rtol=0.1)


def _loop(noise: float, count: int = 6000) -> tuple[FloatArray, FloatArray]:
    """A smooth motion's angles with white noise of 1e-3 rad, and torques that a PD law makes of
    them, with `noise`.
    """
    rng = np.random.default_rng(4)
    t = 1e-3 * np.arange(count)
    theta = np.stack([np.sin(5 * t), np.cos(3 * t)]) + 1e-3 * rng.standard_normal((2, count))
    slope = lfilter([500.0, -500.0], [1.0, -0.5], theta - theta[:, :1])
    mixed = np.array([[1.0, 0.3], [0.2, 1.0]])
    tau = -mixed @ (3 * theta + 0.2 * slope) + noise * rng.standard_normal((2, count))
    return theta, tau


@pytest.mark.parametrize("noise", [1e-3, 1e-2, 1.0])
def test_torque_that_a_controller_makes_of_the_angles_noise_is_no_noise(noise: float) -> None:
    """It is 0.1 N m here, a hundred times the least sensor's."""
    found = first_guess(*_loop(noise))
    np.testing.assert_allclose(found.tau, noise, rtol=0.06)
    np.testing.assert_allclose(found.theta, 1e-3, rtol=0.06)
