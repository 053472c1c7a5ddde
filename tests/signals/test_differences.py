import numpy as np
import pytest

from algid.estimators.whitening import covariance_factor, smeared, whiten
from algid.signals.differences import POINTS, Stencil


@pytest.mark.parametrize("shift", [0.0, 0.5e-3, 3.3e-3, -1.2e-3])
def test_polynomials_come_out_exactly(shift: float) -> None:
    stencil = Stencil(1e-3, shift)
    t = np.arange(40) * 1e-3
    coefficients = np.random.default_rng(0).standard_normal(POINTS)
    polynomial = np.polynomial.Polynomial(coefficients, domain=[0, 0.04], window=[-1, 1])
    value, slope, bend = stencil.differences(np.stack([polynomial(t), polynomial(t)]))
    at = t[stencil.torques(t.size)] + shift
    assert np.allclose(value[0], polynomial(at), atol=1e-12)  # rounding alone
    assert np.allclose(slope[0], polynomial.deriv(1)(at), atol=1e-8)
    assert np.allclose(bend[1], polynomial.deriv(2)(at), atol=1e-4)


def test_a_held_torque_moves_an_inertia_like_the_smooth_one_to_fourth_order() -> None:
    """θ̈ = u, u held: the samples in closed form, their second derivative half a sample after each
    stamp.
    """
    errors = []
    for dt in (0.04, 0.02, 0.01):
        tau = np.sin(5 * dt * np.arange(round(2 / dt)))
        omega = np.concatenate([[0.0], np.cumsum(tau)]) * dt
        theta = np.concatenate([[0.0], np.cumsum(omega[:-1] * dt + tau * dt**2 / 2)])[:-1]
        stencil = Stencil(dt, 0.5 * dt, held=True)
        alpha = stencil.differences(np.stack([theta, theta]))[2, 0]
        errors.append(np.abs(stencil.moving(tau)[stencil.torques(tau.size)] - alpha).max())
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.allclose(slopes, 4, atol=0.1)


@pytest.mark.parametrize("held", [False, True])
def test_a_low_pass_is_undone_to_sixth_order(held: bool) -> None:
    """A sine that has gone through a one-pole low-pass, in closed form, is the sine again."""
    hertz, lag, errors = 8.0, 4e-3, []
    for dt in (2e-3, 1e-3):
        t = np.arange(0, 1, dt)
        turn = 2j * np.pi * hertz
        logged = np.imag(np.exp(turn * t) / (1 + turn * lag))
        plain = Stencil(dt, held=held).moving(np.imag(np.exp(turn * t)))
        moving = Stencil(dt, held=held, lag=lag).moving(logged)
        errors.append(np.abs(moving - plain)[8:-8].max())
    assert errors[0] < 1e-6
    assert np.log2(errors[0] / errors[1]) > 5.8


def test_noise_behind_an_undone_low_pass_is_whitened() -> None:
    stencil = Stencil(1e-3, held=True, lag=4e-3)
    rng = np.random.default_rng(3)
    H = np.zeros((2, 2, POINTS, 20000))
    factor = covariance_factor(H, stencil.taps)
    x, y = rng.standard_normal((2, 2, 20000))
    back = smeared(y, stencil.taps[::-1])
    np.testing.assert_allclose(np.sum(y * smeared(x, stencil.taps)), np.sum(x * back))
    white = whiten(factor, smeared(x, stencil.taps)[None]).reshape(-1, 2)
    inner = white[200:-200]
    # 4 σ of a variance and of a correlation of 39200 draws
    assert abs(inner.var() - 1) < 4 * np.sqrt(2 / inner.size)
    assert abs(np.mean(inner[1:] * inner[:-1])) < 4 / np.sqrt(inner.size)
