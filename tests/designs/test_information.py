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
from algid.designs.position import Fourier, middles
from algid.designs.prior import PriorKnowledge, prior_of
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
    return FAMILY.random(np.random.default_rng(seed), np.array([-np.pi / 2, 0.3]))


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


def test_parts_of_the_motion_add_up() -> None:
    belief, rate = belief_of("case1"), 50.0
    slopes = Sensitivities(
        belief.shared.model, motion_at(drawn(3), middles(FAMILY.duration, rate)), rate
    )
    information = Information(experiment(belief), belief.mean, slopes)
    np.testing.assert_allclose(
        information.parts(60).sum(axis=0), information.S, rtol=1e-9, atol=1e-9 * information.S.max()
    )


def limits_for(belief: Belief) -> Limits:
    return Limits(
        low=np.array([-2.8, -1.2]),
        high=np.array([-0.4, 1.4]),
        speed=np.array([3.0, 2.0]),
        acceleration=np.array([30.0, np.inf]),
        torque=np.array([2.0, 1.0]),
        height=-0.28,
        lengths=belief.mean[-2:],
    )


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
    assert found.by_motion is not None
    share = np.random.default_rng(0).uniform(size=found.u.shape)
    gradient = FAMILY.gradient(found.by_motion * share[:, None], basis)
    for place in (0, 1, 5, 20):
        step = np.zeros_like(x)
        step[place] = 1e-5
        slope = np.sum(share * (used(x + step) - used(x - step)), axis=1) / 2e-5
        np.testing.assert_allclose(
            gradient[:, place], slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max()
        )


def test_no_arm_of_a_box_asks_for_more_torque_than_the_largest_told() -> None:
    belief = belief_of("case2")
    motion = motion_at(drawn(5), middles(FAMILY.duration, 50.0))
    Y = Sensitivities(belief.shared.model, motion, 50.0).Y
    corners = np.array(np.meshgrid(*[[-1, 1]] * belief.spread.shape[1])).reshape(
        belief.spread.shape[1], -1
    )
    for loaded in (False, True):
        load = belief.load(loaded)
        torque, more, _ = load.largest(Y)
        arms = [
            belief.shared.coefficients(belief.mean + belief.spread @ u, loaded) for u in corners.T
        ]
        worst = np.max([np.abs(np.einsum("aqn,q->an", Y, c)) for c in arms], axis=0)
        # reached at a corner, so that the bound is no larger than it must be; its corners are
        # rounded by 1e-6
        np.testing.assert_allclose(np.abs(torque) + more, worst, rtol=0, atol=1e-5 * worst.max())


@pytest.mark.parametrize("box", [True, False])
def test_an_arm_that_asks_for_no_torque_has_no_largest_torque_and_no_slope(box: bool) -> None:
    belief = replace(belief_of("case1"), box=box)
    # at rest in a horizontal plane
    torque, more, slope = belief.load(False).largest(np.zeros((2, 7, 3)))
    np.testing.assert_array_equal(torque, 0.0)
    assert np.all(more < 1e-90)
    np.testing.assert_array_equal(slope, 0.0)
