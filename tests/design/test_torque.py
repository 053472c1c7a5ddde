"""Open-loop plans against the simulator, which shares nothing with the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.design.campaign import Design, plan
from algid.design.swing import step_for, swing
from algid.model import Model
from algid.synth.excitation import SampledTorque
from algid.synth.simulator import simulate
from tests.design.test_campaign import campaign

DURATION = 3.0


@pytest.fixture(scope="module")
def design() -> Design:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("algid.design.torque.GENERATIONS", 4)
        patch.setattr("algid.design.torque.POPULATION", 8)
        asked = campaign()
        limits = replace(asked.limits, height=-np.inf, acceleration=np.full(2, np.inf))
        return plan(replace(asked, drive="torque", duration=DURATION, limits=limits))


def test_swings_are_those_of_the_simulator() -> None:
    belief = campaign().belief
    C = np.array([belief.shared.coefficients(arm, True) for arm in belief.draws(3, 1)]).T
    step = step_for(Model(), C, 1.0)
    half = 0.5 * step * np.arange(2 * round(1.0 / step) + 1)
    wave = np.stack([np.sin(6 * half), 0.3 * np.cos(9 * half)])
    swings = swing(Model(), C, np.repeat(wave.T[:, :, None], 3, axis=2), step, np.array([-np.pi / 2, 0.0]))
    for place in range(3):
        exact = simulate(C[:, place], lambda t: np.stack([np.sin(6 * t), 0.3 * np.cos(9 * t)]), swings.t)
        # fourth order: a product of step and fastest rate of 2 leaves 1e-4 of the swing
        np.testing.assert_allclose(swings.theta[:, :, place].T, exact.theta, atol=1e-3)


@pytest.mark.slow
def test_no_limit_breaks_for_arms_that_the_search_has_not_seen(design: Design) -> None:
    limits, belief = design.campaign.limits, design.campaign.belief
    torque = SampledTorque(design.t, design.torque[False], "foh")
    assert np.all(np.abs(torque.tau) <= limits.torque[:, None])
    every = design.t[::50]
    for arm in belief.draws(6, seed=987):
        for loaded in (False, True):
            drive = SampledTorque(every, torque(every), "foh")
            moved = simulate(belief.shared.coefficients(arm, loaded), drive, every)
            assert np.all(moved.theta >= limits.low[:, None])
            assert np.all(moved.theta <= limits.high[:, None])
            assert np.all(np.abs(moved.omega) <= limits.speed[:, None])


def test_the_plan_is_what_the_believed_arm_does(design: Design) -> None:
    belief = design.campaign.belief
    for loaded in (False, True):
        exact = simulate(
            belief.shared.coefficients(belief.mean, loaded),
            SampledTorque(design.t[::10], design.torque[loaded][:, ::10], "foh"),
            design.t[::10],
        )
        np.testing.assert_allclose(design.motions[loaded].theta[:, ::10], exact.theta, atol=3e-3)
    assert np.ptp(design.motion.theta, axis=1).min() > 0.02
    assert np.all(np.abs(design.motion.omega[:, -1]) <= 0.1 * np.abs(design.motion.omega).max(axis=1))
