"""The width of dry friction's step: found by the likelihood, and part of the error bars."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import refined
from algid.estimators.problem import WeakSettings
from algid.estimators.refined import likeliest_widths
from algid.model import Model
from algid.signals.segments import Segment
from pipelines.accuracy_scenes import random_arm, waves
from pipelines.simulator import WIDTH, Controller, Plan, controlled, inertias
from tests.estimators.conftest import problem_of

SEED = 415  # an arm that nothing was tuned on


def rubbing() -> tuple[Segment, FloatArray]:
    """Three seconds behind a PD controller, friction of a tenth of the weight; k1 … k7, f1, f2."""
    k, count, rng = random_arm(SEED)[0].constants(), 3001, np.random.default_rng(SEED)
    fine = np.arange(2 * count - 1) / 2000.0
    turns = np.array([[0.5, 1.3], [0.7, 1.9]])
    theta, omega, _ = waves(fine, turns, np.full((2, 2), 0.4), np.zeros((2, 2)))
    theta[0] -= np.pi / 2
    inertia, friction = inertias(k), 0.1 * np.array([k[3] + k[1], k[1]])
    plan = Plan(theta, omega, np.zeros_like(theta))
    law = Controller(600 * inertia, 35 * inertia)
    angles, torques, _ = controlled(k, plan, law, friction, 1000.0, rng)
    noise = rng.standard_normal((2, 2, count))
    log = Segment(0.0, 1e-3, angles + 1e-3 * noise[0], torques + 1e-2 * noise[1])
    return log, np.append(k, friction)


def test_the_width_that_starts_the_fit_does_not_stay_in_it() -> None:
    """What the weak form takes for it is several times the true one: friction was 5 σ off."""
    log, truth = rubbing()
    found = []
    for start in (0.02, 0.2):
        model = Model(("coulomb",), coulomb_speed=start)
        settings = WeakSettings(model=model, bandwidth=60.0)
        found.append(refined.fit(problem_of(log, settings=settings)))
    for fit in found:
        assert (fit.estimator, fit.converged) == ("refined", True)
        # three seconds with a dozen reversals tell it to a factor of two
        assert 0.5 * WIDTH < fit.shared.model.coulomb_speed < 2 * WIDTH
        assert np.abs((fit.values - truth) / fit.std).max() < 3.6
    near, far = found
    # and as near as a change that counts as none
    assert near.shared.model.coulomb_speed == pytest.approx(
        far.shared.model.coulomb_speed, rel=0.05
    )
    assert np.all(np.abs(near.values - far.values) < 0.2 * near.std)


@pytest.mark.parametrize("start", [0.006, 0.03, 0.4])
def test_the_parabola_through_the_lowest_values_has_the_widths_variance(start: float) -> None:
    """D = (log ω - log 0.03)² / 0.2² has a deviation of 0.2; β grows by (3, -1) a unit."""

    def profile(widths: FloatArray) -> tuple[float, FloatArray]:
        (x,) = np.log(widths / 0.03)
        return float((x / 0.2) ** 2), np.array([3.0, -1.0]) * x

    (width,), added = likeliest_widths(profile, np.array([start]), np.array([[0.004, 1.0]]))
    assert width == pytest.approx(0.03)
    np.testing.assert_allclose(added, 0.2**2 * np.outer([3, -1], [3, -1]))


def test_two_widths_that_go_together_have_their_common_covariance() -> None:
    """D = dᵀ C⁻¹ d, with d the distance of the logarithms from those of (0.1, 0.3)."""
    C, at = np.array([[0.04, 0.03], [0.03, 0.09]]), np.array([0.1, 0.3])
    B = np.array([[3.0, -1.0], [0.5, 2.0], [0.0, 1.0]])

    def profile(widths: FloatArray) -> tuple[float, FloatArray]:
        d = np.log(widths / at)
        return float(d @ np.linalg.inv(C) @ d), B @ d

    ends = np.array([[0.004, 1.0], [0.04, 2.8]])
    widths, added = likeliest_widths(profile, np.array([0.02, 1.1]), ends)
    np.testing.assert_allclose(widths, at)
    np.testing.assert_allclose(added, B @ C @ B.T, atol=1e-12)


def test_a_width_at_its_end_leaves_the_other_one_its_variance() -> None:
    """The second falls for ever; the first has a deviation of 0.2 about 0.1."""

    def profile(widths: FloatArray) -> tuple[float, FloatArray]:
        x, y = np.log(widths / 0.1)
        return float((x / 0.2) ** 2 - y), np.array([x, y])

    widths, added = likeliest_widths(
        profile, np.array([0.1, 1.0]), np.array([[0.004, 1.0], [0.04, 2.8]])
    )
    assert widths[0] == pytest.approx(0.1)
    assert 1.9 < widths[1] <= 2.8
    np.testing.assert_allclose(added, np.diag([0.04, 0.0]), atol=1e-12)


def test_friction_that_is_not_there_leaves_its_width_open_and_nothing_else() -> None:
    log, truth = rubbing()
    still = replace(log, theta=log.theta[:, :400], tau=log.tau[:, :400])
    model = Model(("coulomb",), coulomb_speed=0.2)
    settings = WeakSettings(model=model, bandwidth=60.0)
    fit = refined.fit(problem_of(still, settings=settings))
    assert np.all(np.isfinite(fit.covariance))
    assert fit.covariance.shape == (truth.size, truth.size)
