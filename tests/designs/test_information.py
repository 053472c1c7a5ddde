"""What a motion tells, against a bound that shares nothing with it, and its derivatives against
differences.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray, inverse_dynamics
from algid.designs.belief import Belief, Objective
from algid.designs.information import Experiment, Information, Sensitivities
from algid.designs.limits import Limits, usage
from algid.designs.prior import PriorKnowledge, prior_of
from algid.designs.search import Fourier, middles
from algid.estimators.whitening import NoiseLevels
from algid.model import Motion
from pipelines.cramer_rao import Truth, joint_bound

NOISE = NoiseLevels(np.full(2, 1e-3), np.full(2, 1e-2))
FAMILY = Fourier(4.0)


def belief_of(case: str) -> Belief:
    return prior_of(case, None, PriorKnowledge()).belief


def experiment(belief: Belief, rate: float = 500.0) -> Experiment:
    return Experiment(belief.shared, (1, 1), NOISE, rate)


def motion_at(x: FloatArray, t: FloatArray) -> Motion:
    return FAMILY.motion(x, FAMILY.basis(t))


def drawn(seed: int) -> FloatArray:
    coefficients = np.random.default_rng(seed).standard_normal(FAMILY.size - 2)
    return np.array([-np.pi / 2, 0.3, *coefficients])


@pytest.mark.parametrize("case", ["case1", "case2"])
def test_error_bars_are_those_of_an_independent_bound(case: str) -> None:
    belief = belief_of(case)
    x, rate = drawn(1), 500.0
    t = np.arange(round(FAMILY.duration * rate) + 1) / rate
    motion = motion_at(x, t)

    def truth(loaded: bool) -> Truth:
        k = belief.shared.coefficients(belief.mean, loaded)
        return Truth(
            t,
            motion.theta,
            motion.omega,
            inverse_dynamics(k, motion.theta, motion.omega, motion.alpha),
        )

    expected = joint_bound(truth(False), truth(True), belief.mean, 9.81, 1e-3, 1e-2)
    asked = Objective(np.abs(belief.mean), *(np.ones(belief.mean.size, bool),) * 2)
    for coarse in (50.0, 100.0):
        slopes = Sensitivities(
            belief.shared.model, motion_at(x, middles(FAMILY.duration, coarse)), coarse
        )
        std = np.sqrt(
            np.diag(asked.covariance(Information(experiment(belief), belief.mean, slopes).S))
        )
        # the other bound has no initial state and treats the ends otherwise: a few samples in two
        # thousand
        np.testing.assert_allclose(std, expected, rtol=0.02)


def test_each_run_counts_by_itself_and_each_part_of_a_motion_too() -> None:
    belief, x = belief_of("case1"), drawn(1)
    slopes = Sensitivities(belief.shared.model, motion_at(x, middles(FAMILY.duration, 50.0)), 50.0)
    bare, burdened, both = (
        Information(Experiment(belief.shared, runs, NOISE, 500.0), belief.mean, slopes)
        for runs in ((1, 0), (0, 1), (3, 1))
    )
    np.testing.assert_allclose(both.S, 3 * bare.S + burdened.S, rtol=1e-9)
    parts = both.parts(40)
    np.testing.assert_allclose(parts.sum(axis=0), both.S, rtol=1e-9)
    assert len(parts) == 5
    assert np.all(np.trace(parts / np.diag(both.S), axis1=1, axis2=2) > 0)


def test_a_delay_is_told_by_how_steep_the_torque_is() -> None:
    belief, rate = belief_of("case1"), 500.0
    shared = replace(belief.shared, delay=True)
    beta = np.insert(belief.mean, len(shared.model.names), 0.0)
    t = middles(FAMILY.duration, rate)
    motion = motion_at(drawn(1), t)
    exact = NoiseLevels(np.full(2, 1e-12), NOISE.tau)
    slopes = Sensitivities(shared.model, motion, rate)
    found = Information(Experiment(shared, (1, 0), exact, rate), beta, slopes).S
    k = shared.coefficients(beta, False)[: len(shared.model.names)]
    tau = inverse_dynamics(k, motion.theta, motion.omega, motion.alpha)
    steep = (tau[:, 2:] - tau[:, :-2]) * rate / 2
    place = shared.names.index("delay")
    expected = np.sum((steep / NOISE.tau[:, None]) ** 2)
    assert found[place, place] == pytest.approx(expected, rel=0.01)


def test_gradient_by_the_motion_is_that_of_differences() -> None:
    belief, rate = belief_of("case1"), 50.0
    asked = Objective(np.abs(belief.mean), *(np.ones(belief.mean.size, bool),) * 2)
    basis = FAMILY.basis(middles(FAMILY.duration, rate))

    def figure(x: FloatArray) -> float:
        slopes = Sensitivities(belief.shared.model, FAMILY.motion(x, basis), rate)
        return asked.figure(Information(experiment(belief), belief.mean, slopes).S, 8.0)[0]

    x = drawn(2)
    information = Information(
        experiment(belief),
        belief.mean,
        Sensitivities(belief.shared.model, FAMILY.motion(x, basis), rate),
    )
    _, A = asked.figure(information.S, 8.0)
    gradient = FAMILY.gradient(information.gradient(A), basis)
    for place in range(0, x.size, 5):
        step = np.zeros_like(x)
        step[place] = 1e-4
        slope = (figure(x + step) - figure(x - step)) / 2e-4
        assert gradient[place] == pytest.approx(slope, rel=1e-4, abs=1e-6)


def limits_for(belief: Belief) -> Limits:
    allowed = {"range": [1.2, 1.3], "speed": [3.0, 2.0], "acceleration": [30.0, np.inf]}
    allowed["torque"] = [2.0, 1.0]
    arrays = {name: np.array(limit) for name, limit in allowed.items()}
    return Limits(np.array([-1.6, 0.1]), arrays, height=-0.28, lengths=belief.mean[-2:])


def test_usage_derivatives_are_those_of_differences() -> None:
    belief, limits, rate = belief_of("case1"), limits_for(belief_of("case1")), 50.0
    loads = [belief.load(loaded) for loaded in (False, True)]
    basis = FAMILY.basis(middles(FAMILY.duration, rate))
    x = drawn(4)

    def used(x: FloatArray) -> FloatArray:
        return usage(
            limits, Sensitivities(belief.shared.model, FAMILY.motion(x, basis), rate), loads
        ).u

    found = usage(limits, Sensitivities(belief.shared.model, FAMILY.motion(x, basis), rate), loads)
    share = np.random.default_rng(0).uniform(size=found.u.shape)
    gradient = FAMILY.gradient(found.by_motion * share[:, None], basis)
    for place in (0, 1, 5, 20):
        step = np.zeros_like(x)
        step[place] = 1e-5
        slope = np.sum(share * (used(x + step) - used(x - step)), axis=1) / 2e-5
        np.testing.assert_allclose(
            gradient[:, place], slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max()
        )
