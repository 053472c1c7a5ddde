"""The likelihood of coarse logs against the Cramér-Rao bound of other code."""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators import refined
from algid.estimators.coarse_likelihood import FAR, turns_far
from algid.estimators.weak import WeakSettings
from algid.model import Model
from algid.signals.segments import Segment, segments
from algid.signals.shift import TorqueShift
from pipelines.accuracy_hold import SIGMA_TAU, SIGMA_THETA, scene


def _turning(step: float, count: int = 2000) -> Segment:
    theta = step * np.arange(count) * np.array([[0.5], [1.0]])
    return Segment(0.0, 0.01, theta, np.zeros((2, count)))


def test_an_arm_turns_far_by_the_angle_between_its_samples() -> None:
    assert not turns_far([_turning(0.9 * FAR)])
    assert turns_far([_turning(1.1 * FAR)])
    assert turns_far([_turning(0.1), _turning(1.1 * FAR)])
    assert not turns_far([])


def test_a_glitch_is_no_motion() -> None:
    calm = _turning(0.1)
    theta = calm.theta.copy()
    theta[0, 700:] += 2 * np.pi
    assert not turns_far([Segment(0.0, 0.01, theta, calm.tau)])


@pytest.mark.parametrize("held", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_errors_and_deviations_at_fifty_hertz_are_those_of_the_bound(held: bool) -> None:
    """Where the arm turns 1.4 rad a sample, which no stencil follows."""
    here = scene("50", held, 300)
    settings = WeakSettings(model=Model(gravity=here.arm.g), shift=TorqueShift(held))
    pieces = list(segments([here.log(np.random.default_rng([held, 5]))]))
    fit = refined.fit([lambda: pieces], settings=settings, coarse=True)
    assert (fit.estimator, fit.converged, fit.notes) == ("refined", True, ())
    z = (fit.values - here.arm.constants()) / here.bound
    # seven correlated values: χ² of 7 exceeds 24 in one of a thousand
    assert np.sqrt(np.mean(z**2)) < 1.85
    # the noise levels, known to some 20 %, are in the deviations
    np.testing.assert_allclose(fit.std, here.bound, rtol=0.35)
    assert fit.noise is not None
    np.testing.assert_allclose(fit.noise[0].theta, SIGMA_THETA, rtol=0.1)
    np.testing.assert_allclose(fit.noise[0].tau, SIGMA_TAU, rtol=0.6)
    by_differences = refined.fit([lambda: pieces], settings=settings)
    off = (by_differences.values - here.arm.constants()) / here.bound
    assert np.sqrt(np.mean(off**2)) > 5
