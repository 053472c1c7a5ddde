"""Intervals of a coarse log against SciPy's integrator, differences, and motions that are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from algid.arm import Arm, FloatArray, forward_dynamics
from algid.estimators.shooting import Driving, Shot, advanced, integrate, linearise
from algid.estimators.whitening import NoiseLevels, forward
from algid.model import Model
from algid.signals.between import between
from algid.signals.differences import Stencil
from algid.signals.segments import Segment
from algid.synth.excitation import SampledTorque, wide_multi_sine
from algid.synth.simulator import simulate

ARM = Arm(1.0, 0.6, 0.15, 0.12, 0.3, 0.25, 0.01, 0.004, 0.1, 0.08)
K = ARM.constants()
RATE = 60.0
NOISE = NoiseLevels(np.array([1e-3, 2e-3]), np.array([1e-2, 2e-2]))
MODEL = Model(("coulomb",), coulomb_speed=2.0)
C = np.append(K, [0.05, 0.03])


@cache
def moved(held: bool) -> Segment:
    """Three seconds of motion that turns up to a radian a sample, without noise."""
    t = np.arange(181) / RATE
    wide = wide_multi_sine(ARM, 3)
    torque = SampledTorque(t, wide(t), "zoh") if held else wide
    motion = simulate(K, torque, t)
    return Segment(0.0, 1 / RATE, motion.theta, wide(t))


def shot(
    piece: Segment,
    theta: FloatArray,
    c: FloatArray = K,
    *,
    held: bool = True,
    shift: float | None = None,
    model: Model | None = None,
) -> Shot:
    """Linearised at a trajectory, its noise of one N m, so that columns are in N m."""
    dt = piece.dt
    stencil = Stencil(dt, 0.5 * dt * held if shift is None else shift, held=held)
    noise = NoiseLevels(np.ones(2), np.ones(2))
    return linearise(model or Model(), c, theta, piece, stencil, noise, delay=True)


def columns(found: Shot) -> FloatArray:
    """Its columns before whitening: (m, 2, n)."""
    return np.stack([_raw(found, row) for row in found.columns])


def _raw(found: Shot, row: FloatArray) -> FloatArray:
    """L of a whitened row, by products with the band."""
    width = found.factor.shape[0]
    out = np.zeros_like(row)
    for above in range(width):
        band = found.factor[width - 1 - above, above:]
        out[above:] += band * row[: row.size - above]
    return out.reshape(-1, 2).T


@pytest.mark.parametrize("held", [True, False])
def test_a_motion_of_large_steps_leaves_no_residual_at_the_truth(held: bool) -> None:
    piece = moved(held)
    assert np.abs(np.diff(piece.theta, axis=1)).max() > 0.6
    found = shot(piece, piece.theta, held=held)
    size = np.sqrt(np.mean(piece.tau**2))
    # steps of 0.2 rad err by 1e-4; so do twelve samples of an even torque of 8 Hz at 60 Hz
    assert np.abs(found.residual).max() < 3e-4 * size
    wrong = shot(piece, piece.theta, held=not held)
    assert np.abs(wrong.residual).max() > 0.01 * size


def test_intervals_end_where_another_integrator_does() -> None:
    x = np.array([[0.3, -1.0], [0.5, 2.0], [20.0, -9.0], [-14.0, 30.0]])
    tau = np.array([[2.0, -1.0], [0.5, 0.7]])
    dt = 0.02
    ends = []
    for steps in (4, 8, 16):
        u = np.broadcast_to(tau, (steps, 3, 2, 2))
        ends.append(advanced(Model(), K, x, u, dt))
    for place in range(2):

        def rate(_: float, y: FloatArray, place: int = place) -> FloatArray:
            alpha = forward_dynamics(K, y[:2, None], y[2:, None], tau[:, place, None])
            return np.concatenate([y[2:], alpha[:, 0]])

        exact = solve_ivp(rate, (0, dt), x[:, place], rtol=1e-12, atol=1e-12).y[:, -1]
        errors = [np.abs(end[:, place] - exact).max() for end in ends]
        slopes = np.log2(np.array(errors[:-1]) / errors[1:])
        assert np.all(slopes > 3.6)  # fourth order
        assert errors[-1] < 1e-5


def test_the_variational_equations_are_the_derivatives() -> None:
    x = np.array([[0.3, -1.0], [0.5, 2.0], [2.0, -9.0], [-4.0, 3.0]])
    tau = np.random.default_rng(0).standard_normal((2, 6))
    steps, dt = 6, 0.02
    smooth = between(0.0, steps, held=False, points=2)

    def end(x: FloatArray, c: FloatArray, tau: FloatArray) -> FloatArray:
        u = smooth.at_stages(tau, 1, 2)
        drive = Driving(u, smooth, np.empty((steps, 3, 2, 0, 2)))
        return integrate(MODEL, c, x, drive, dt)[0]

    drive = Driving(smooth.at_stages(tau, 1, 2), smooth, np.empty((steps, 3, 2, 0, 2)))
    _, X = integrate(MODEL, C, x, drive, dt)

    def slope(change: float, **moved: FloatArray) -> FloatArray:
        at = {"x": x, "c": C, "tau": tau}
        up = {name: at[name] + change * moved.get(name, 0.0) for name in at}
        down = {name: at[name] - change * moved.get(name, 0.0) for name in at}
        return (end(**up) - end(**down)) / (2 * change)

    for row in range(4):
        step = np.zeros_like(x)
        step[row] = 1.0
        np.testing.assert_allclose(X[:, row], slope(1e-6, x=step), atol=1e-6)
    for place in range(2):
        for joint in range(2):
            step = np.zeros_like(tau)
            step[joint, 1 + place] = 1.0  # the first interval's own sample
            expected = slope(1e-5, tau=step)[:, 0]
            np.testing.assert_allclose(X[:, 4 + 2 * place + joint, 0], expected, atol=1e-6)
    for place in range(C.size):
        step = np.eye(C.size)[place]
        expected = slope(1e-6 * C[place], c=step)
        np.testing.assert_allclose(X[:, 8 + place], expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("late", [0.0, 0.3])
def test_the_columns_are_the_derivatives_of_the_residual(held: bool, late: float) -> None:
    """Of angles, torques, coefficients and the delay, by central differences."""
    piece = moved(held)
    dt = piece.dt
    shift = (0.5 * held + late) * dt
    at = shot(piece, piece.theta, C, held=held, shift=shift, model=MODEL)
    Y = columns(at)[:-1]

    def residual(
        theta: FloatArray, c: FloatArray = C, tau: FloatArray = piece.tau, more: float = 0.0
    ) -> FloatArray:
        moved_piece = replace(piece, theta=theta, tau=tau)
        return shot(moved_piece, theta, c, held=held, shift=shift + more, model=MODEL).residual

    for place in range(C.size):
        step = 1e-5 * abs(C[place]) * np.eye(C.size)[place]
        slope = (residual(piece.theta, C + step) - residual(piece.theta, C - step)) / 2e-5
        # e = Y δc of the truth beyond the coefficients: less with larger ones. W changes with them
        # too, by a share of the residual that stays small here
        size = np.abs(Y[place]).max() * abs(C[place])
        assert np.abs(slope + Y[place] * abs(C[place])).max() < 0.2 * size
        assert np.corrcoef(slope.ravel(), -Y[place].ravel())[0, 1] > 0.99
    rng = np.random.default_rng(1)
    exact = moved(held)
    still = shot(exact, exact.theta, held=held)  # at the truth, where the residual is nothing
    x = 1e-6 * rng.standard_normal(exact.theta.shape)
    up, down = (
        shot(replace(exact, theta=exact.theta + s * x), exact.theta + s * x, held=held).residual
        for s in (1, -1)
    )
    along = forward(still.H, x, still.first)
    np.testing.assert_allclose((up - down) / 2, -along, atol=2e-2 * np.abs(along).max())
    eta = 1e-4 * rng.standard_normal(exact.tau.shape)
    up, down = (
        shot(replace(exact, tau=exact.tau + s * eta), exact.theta, held=held).residual
        for s in (1, -1)
    )
    spread = still.smeared(eta)
    if held:  # of an even torque's noise F takes straight lines
        np.testing.assert_allclose((up - down) / 2, spread, atol=2e-2 * np.abs(spread).max())
    else:
        assert np.corrcoef(((up - down) / 2).ravel(), spread.ravel())[0, 1] > 0.98


def test_the_share_of_each_torque_adds_up_to_one() -> None:
    piece = moved(True)
    found = shot(piece, piece.theta)
    total = found.F.sum(axis=2)
    expected = np.broadcast_to(np.eye(2)[:, :, None], total.shape)
    np.testing.assert_allclose(total, expected, atol=1e-9)


def test_smearing_backwards_is_the_transpose() -> None:
    piece = moved(False)
    found = shot(piece, piece.theta, held=False)
    rng = np.random.default_rng(2)
    a = rng.standard_normal((2, len(piece)))
    b = rng.standard_normal(found.residual.shape)
    assert np.sum(found.smeared(a) * b) == pytest.approx(np.sum(a * found.smeared_back(b)))


def test_the_covariance_is_that_of_drawn_noise() -> None:
    """Of 400 draws of angles and torques: whitened residuals have unit variance."""
    piece = moved(True)
    rng = np.random.default_rng(3)
    stencil = Stencil(piece.dt, 0.5 * piece.dt, held=True)
    total, count = 0.0, 0
    for _ in range(40):
        noisy = replace(
            piece,
            theta=piece.theta + NOISE.theta[:, None] * rng.standard_normal(piece.theta.shape),
            tau=piece.tau + NOISE.tau[:, None] * rng.standard_normal(piece.tau.shape),
        )
        w = linearise(Model(), K, piece.theta, noisy, stencil, NOISE).columns[-1]
        total, count = total + float(w @ w), count + w.size
    assert total / count == pytest.approx(1.0, abs=4 * np.sqrt(2 / count))


def test_coefficients_far_off_are_refused_and_not_followed() -> None:
    piece = moved(True)
    with pytest.raises(np.linalg.LinAlgError):
        shot(piece, piece.theta, 1e-9 * K)


def test_a_piece_shorter_than_its_torque_needs_is_refused() -> None:
    piece = moved(True)
    short = Segment(0.0, piece.dt, piece.theta[:, :13], piece.tau[:, :13])
    with pytest.raises(np.linalg.LinAlgError, match="shorter than"):
        shot(short, short.theta)


def test_narrow_dry_friction_is_followed_through_rest() -> None:
    """Its rate of 2,000 / s would make steps of a few milliseconds unstable."""
    model, c, dt = Model(("coulomb",), coulomb_speed=0.03), np.append(K, [0.6, 0.1]), 0.01
    tau = wide_multi_sine(ARM, 3)(np.arange(101) * dt)
    x, states = np.array([[-1.5], [0.0], [0.0], [0.0]]), []
    for sample in range(101):
        states.append(x[:, 0])
        u = np.broadcast_to(tau[:, sample, None], (400, 3, 2, 1))
        x = advanced(model, c, x, u, dt)
    theta = np.array(states).T[:2]
    assert np.sum(np.diff(np.sign(np.array(states)[:, 2:]), axis=0) != 0) > 10
    piece = Segment(0.0, dt, theta, tau)
    found = shot(piece, theta, c, model=model)
    # where a joint passes rest within a step, the step's error is a share of friction
    assert np.sqrt(np.mean(found.residual**2)) < 5e-3 * np.sqrt(np.mean(tau**2))
