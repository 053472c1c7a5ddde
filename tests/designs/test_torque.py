"""Open-loop plans against the simulator, which shares nothing with the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.designs.campaign import Campaign, Design, plan
from algid.designs.swing import step_for, swing
from algid.designs.torque import TorqueProblem
from algid.model import Model, acceleration
from algid.synth.excitation import SampledTorque
from algid.synth.simulator import simulate
from tests.designs.test_campaign import campaign

DURATION = 3.0


def open_loop() -> Campaign:
    asked = campaign()
    limits = replace(asked.limits, height=-np.inf, acceleration=np.full(2, np.inf))
    return replace(asked, drive="torque", duration=DURATION, limits=limits)


@pytest.fixture(scope="module")
def design() -> Design:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("algid.designs.torque.GENERATIONS", 4)
        patch.setattr("algid.designs.torque.POPULATION", 8)
        return plan(open_loop())


def test_swings_are_those_of_the_simulator() -> None:
    belief = campaign().belief
    C = np.array([belief.shared.coefficients(arm, True) for arm in belief.draws(3, 1)]).T
    step = step_for(Model(), C, 1.0)
    half = 0.5 * step * np.arange(2 * round(1.0 / step) + 1)
    wave = np.stack([np.sin(6 * half), 0.3 * np.cos(9 * half)])
    swings = swing(
        Model(), C, np.repeat(wave.T[:, :, None], 3, axis=2), step, np.array([-np.pi / 2, 0.0])
    )
    for place in range(3):
        exact = simulate(
            C[:, place], lambda t: np.stack([np.sin(6 * t), 0.3 * np.cos(9 * t)]), swings.t
        )
        # fourth order: a product of step and fastest rate of 2 leaves 1e-4 of the swing
        np.testing.assert_allclose(swings.theta[:, :, place].T, exact.theta, atol=1e-3)


def test_swings_that_are_lost_end_early_and_are_the_same_until_then() -> None:
    C = campaign().belief.load(False).c[:, None]
    step = step_for(Model(), C, 1.0)
    torque = np.full((2 * round(1.0 / step) + 1, 2, 1), 0.8)
    whole = swing(Model(), C, torque, step, np.array([-np.pi / 2, 0.0]))
    asked: list[float] = []

    def lost(states: FloatArray) -> bool:
        asked.append(float(states[0, 0]))
        return len(asked) == 3

    ended = swing(Model(), C, torque, step, np.array([-np.pi / 2, 0.0]), lost)
    count = ended.t.size
    assert 2 < count < whole.t.size / 2
    np.testing.assert_array_equal(asked, whole.theta[: count : (count - 1) // 2, 0, 0])
    for name in ("t", "theta", "omega", "alpha"):
        np.testing.assert_array_equal(getattr(ended, name), getattr(whole, name)[:count])


def test_a_swing_with_all_linear_terms_obeys_the_models_own_accelerations() -> None:
    model = Model(("coulomb", "offset", "rotor", "stribeck", "asymmetry"))
    value = {
        "k1": 0.05,
        "k2": 1.0,
        "k3": 0.03,
        "k4": 4.0,
        "k5": 0.2,
        "k6": 0.3,
        "k7": 0.2,
        "f1": 0.4,
        "f2": 0.2,
    }
    value |= {"o1": 0.3, "o2": -0.2, "j2": 0.01, "s1": 0.2, "s2": 0.1, "a1": 0.05, "a2": -0.04}
    c = np.array([value[name] for name in model.names])
    torque = np.zeros((2 * 200 + 1, 2, 2))
    torque[:, :, 0] = 3.0, 1.0
    swings = swing(model, np.stack([c, 1.1 * c], axis=1), torque, 1e-3, np.array([-1.0, 0.4]))
    for column, factor in enumerate((1.0, 1.1)):
        motion = swings.motion(column)
        tau = np.repeat(torque[0, :, column][:, None], motion.theta.shape[1], axis=1)
        expected = acceleration(model, factor * c, motion.theta, motion.omega, tau)
        np.testing.assert_allclose(motion.alpha, expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.slow
def test_a_drive_far_stronger_than_its_arm_is_planned_for_as_well() -> None:
    low, high = np.array([-np.pi / 2, 0.0]) - 1.5, np.array([-np.pi / 2, 0.0]) + 1.5
    asked = open_loop()
    limits = replace(
        asked.limits, low=low, high=high, speed=np.full(2, 9.0), torque=np.array([190.0, 95.0])
    )
    strong = plan(replace(asked, duration=3.0, limits=limits))
    assert strong.open_parameters == []
    # in percent: 100,000 with amplitudes in shares of the drive's limit
    assert 100 * strong.largest < 5
    assert max(used for _, used in strong.binding) <= 0.95 * (1 + 1e-9)


def test_how_far_a_drive_is_stronger_than_its_arm_makes_no_difference() -> None:
    asked, start = open_loop(), np.array([-np.pi / 2, 0.0])
    figures = []
    for factor in (1e2, 1e4):
        limits = replace(asked.limits, torque=factor * asked.limits.torque)
        problem = TorqueProblem(asked.experiment, asked.belief, limits, asked.asked, 2.0, start, 0)
        rng = np.random.default_rng(0)
        figures.append(problem.figures(np.array([problem.random(rng) for _ in range(3)])))
    np.testing.assert_allclose(figures[0], figures[1], rtol=1e-12)


def test_no_more_torque_is_searched_for_than_limits_or_arms_ask_for() -> None:
    asked, start = open_loop(), np.array([-np.pi / 2, 0.0])

    def peak(torque: tuple[float, float], speed: float) -> FloatArray:
        limits = replace(asked.limits, torque=np.array(torque), speed=np.full(2, speed))
        problem = TorqueProblem(asked.experiment, asked.belief, limits, asked.asked, 2.0, start, 0)
        x = np.zeros(problem.size)
        x[:: problem.size // 2] = (
            1.0  # the slowest sine of each joint, whose window is one at a quarter of the time
        )
        return np.abs(problem.torques(x, np.array([0.5]))[:, 0])

    np.testing.assert_allclose(peak((1.9, 0.95), 3.0), [1.9, 0.95], rtol=1e-12)
    slow, fast = peak((1e3, 1e3), 1e-6), peak((1e3, 1e3), 3.0)
    # what holds the heaviest of the arms searched with outstretched, and the more the faster
    k = asked.belief.shared.coefficients(asked.belief.mean, True)
    assert np.all(slow >= np.array([k[3] + k[1], k[1]]))
    assert np.all(slow < 2 * np.array([k[3] + k[1], k[1]]))
    assert np.all(fast > slow + 3.0 * k[5:7])
    np.testing.assert_allclose(peak((np.float64(0.5), 1e3), 3.0), [0.5, fast[1]], rtol=1e-12)


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
    assert np.all(
        np.abs(design.motion.omega[:, -1]) <= 0.1 * np.abs(design.motion.omega).max(axis=1)
    )
