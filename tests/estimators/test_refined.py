from dataclasses import replace

import numpy as np
import pytest

from algid.arm import inverse_dynamics
from algid.estimators import log_likelihood as evidence
from algid.estimators import refined
from algid.estimators.problem import WeakSettings
from algid.model import Model
from algid.signals.differences import POINTS
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from tests.intervals import holds_95, in_axes

from .conftest import Bench, problem_of


def test_noise_levels_and_error_bars_are_honest(bench: Bench) -> None:
    logs = [(bench.log(False, 1e-3, seed), bench.log(True, 1e-3, seed)) for seed in range(5)]
    fits = [refined.fit(problem_of(bare, loaded=[burdened])) for bare, burdened in logs]
    levels = np.array([[level.theta, level.tau / 10] for fit in fits for level in fit.noise or ()])
    standard_error = levels.std(axis=0, ddof=1) / np.sqrt(levels.shape[0])
    assert np.all(np.abs(levels.mean(axis=0) - 1e-3) < 4 * standard_error)
    assert np.allclose(levels[:, 0], 1e-3, rtol=0.05)  # thousands of degrees of freedom a log
    assert all(fit.intervals == "likelihood" and fit.estimator == "refined" for fit in fits)


@pytest.mark.slow
def test_intervals_of_arm_and_payload_hold(bench: Bench) -> None:
    bare, burdened = bench.log(), bench.log(loaded=True)

    def seen(log: Segment, rng: np.random.Generator) -> Segment:
        """Every third sample, so that there are as many draws as it takes."""
        theta, tau = log.theta[:, ::3], log.tau[:, ::3]
        noise = rng.standard_normal((2, *theta.shape))
        return Segment(0.0, 3 * log.dt, theta + 1e-3 * noise[0], tau + 1e-2 * noise[1])

    ratios = []
    for seed in range(90):
        rng = np.random.default_rng(seed)
        fit = refined.fit(problem_of(seen(bare, rng), loaded=[seen(burdened, rng)]))
        known = len(bench.truth)  # what a draw may add beside them is the payload's inertia
        error = fit.values[:known] - bench.truth
        ratios.append(in_axes(error, fit.covariance[:known, :known], fit.quantile))
    holds_95(np.array(ratios))


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_what_noisy_accelerations_alone_tell_apart_settles(seed: int) -> None:
    k, t = load_case("case1").arm.constants(), 1e-3 * np.arange(10_000)
    draw = np.random.default_rng(seed)
    rate = 2 * np.pi * np.array([0.1, 0.5, 0.9, 1.3, 1.9])[:, None, None]
    size, phase = draw.uniform(0.2, 0.5, (5, 2, 1)), draw.uniform(0, 6, (5, 2, 1))
    wave = size * np.exp(1j * (rate * t + phase))
    theta, omega, alpha = (np.sum(wave * (1j * rate) ** n, axis=0).imag for n in range(3))
    noise = draw.standard_normal((2, *theta.shape))
    torque = inverse_dynamics(k, theta, omega, alpha) + 1e-2 * noise[1]
    log = Segment(0.0, 1e-3, theta + 2e-6 * noise[0], torque)  # of a fine encoder
    settings = WeakSettings(model=Model(terms=("rotor",)), estimate_delay=True)
    found = refined.fit(problem_of(log, settings=settings))
    assert (found.estimator, found.converged) == ("refined", True)
    assert found.iterations < 12  # a rotor and a delay go to and fro for ever without
    truth = np.append(k, [0.0, 0.0])
    assert np.all(np.abs(found.values - truth) < 4 * found.std)


def test_an_encoder_sets_the_floor(bench: Bench) -> None:
    step = 2 * np.pi / 4096
    log = bench.log(sigma=1e-4)
    coarse = replace(log, theta=np.round(bench.bare.theta / step) * step)
    fit = refined.fit(problem_of(coarse))
    assert np.allclose(fit.noise[0].theta, step / np.sqrt(12), rtol=0.1)


def test_coloured_residuals_get_robust_intervals(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    rng = np.random.default_rng(0)
    slow = np.cumsum(rng.standard_normal(log.tau.shape), axis=1)
    slow = 0.01 * (slow - slow.mean(axis=1, keepdims=True)) / slow.std(axis=1, keepdims=True)
    fit = refined.fit(problem_of(replace(log, tau=log.tau + slow)))
    assert fit.intervals == "sandwich"


def test_long_logs_take_one_more_pass_and_agree(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = bench.log(sigma=1e-3)
    monkeypatch.setattr(evidence, "PIECE_SAMPLES", 500)
    whole = refined.fit(problem_of(log))
    monkeypatch.setattr(evidence, "_TRAINED", 2)
    parts = refined.fit(problem_of(log))
    assert np.allclose(whole.values, parts.values, atol=0.2 * whole.std.min() + 0.2 * whole.std)
    for fit in (
        whole,
        parts,
    ):  # 4001 samples in pieces of 500, whose ends the stencil takes; white, of unit variance
        (residual,) = fit.residual
        assert residual.pairs[0] == pytest.approx(4001 - 9 * (POINTS - 1), abs=POINTS)
        assert fit.freedom == pytest.approx(residual.pairs[0], abs=9)
        assert residual.products[0, :, 0] / residual.pairs[0] == pytest.approx(
            1, abs=0.09
        )  # four standard errors
