"""Wrong conventions are told from the motion of a simulated arm, and right logs are never accused.

That what is named mends a log is held where logs are read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from algid.arm import FloatArray, forward_dynamics
from algid.estimators.convention_search import (
    _TURNS,
    Judgement,
    Recorded,
    Trials,
    _families,
    judge_together,
)
from algid.estimators.conventions import AS_READ, Convention
from algid.model import Model, Motion, torque
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines.accuracy_scenes import random_arm
from pipelines.conventions import SPOILS
from tests.estimators.conftest import DT, Bench

Pair = tuple[FloatArray, FloatArray]


def measured(motion: SimulatedMotion, coulomb: float = 0.02, seed: int = 0) -> Pair:
    """Angles and torques with the sensors' noise, and Coulomb friction that the motors overcome,
    in N m.
    """
    rng = np.random.default_rng(seed)
    theta = motion.theta + 3e-4 * rng.standard_normal(motion.theta.shape)
    tau = (
        motion.tau
        + coulomb * np.tanh(motion.omega / 0.02)
        + 1e-2 * rng.standard_normal(motion.tau.shape)
    )
    return theta, tau


def judged(theta: FloatArray, tau: FloatArray) -> Judgement:
    return judge_together([Recorded(theta, tau, DT)])


def spoiled(name: str, theta: FloatArray, tau: FloatArray) -> Pair:
    a, b, s, t = SPOILS[name](*theta, *tau)
    return np.stack([a, b]), np.stack([s, t])


@pytest.mark.parametrize("signs", [(1, 1), (1, -1)])
def test_an_arm_without_weight_tells_its_signs(bench: Bench, signs: tuple[int, int]) -> None:
    k = bench.arm.constants() * np.array([1, 0, 1, 0, 1, 1, 1])
    theta, tau = measured(simulate(k, wide_multi_sine(bench.arm, 3), np.arange(4001) * DT))
    mistake = Convention(torque_signs=signs)
    found = judge_together([Recorded(theta, mistake.drive @ tau, DT)], gravity=False)
    assert found.alone
    assert found.best.convention == mistake


def wrongs(motion: SimulatedMotion) -> dict[str, Callable[[], Pair]]:
    """What real arms and sensors do to a log whose convention is right."""
    theta, tau = measured(motion, 0.0)
    size = np.abs(tau).max(axis=1, keepdims=True)
    rng = np.random.default_rng(3)
    sign = np.tanh(motion.omega / 0.02)
    return {
        "nothing": lambda: (theta, tau),
        "gains": lambda: (theta, tau * np.array([[1.2], [0.8]])),
        "late": lambda: (theta[:, :-20], tau[:, 20:]),
        "held": lambda: (theta, np.repeat(tau[:, ::10], 10, axis=1)[:, : theta.shape[1]]),
        "Coulomb": lambda: (theta, tau + 0.3 * size * sign),
        "load": lambda: (theta, tau + 0.2 * np.abs(tau) * sign),
        "ripple": lambda: (theta, tau + 0.1 * size * np.sin(20 * motion.theta)),
        "offset": lambda: (theta, tau + 0.2 * size),
        "noise": lambda: (theta, tau + 0.3 * size * rng.standard_normal(tau.shape)),
        "nothing but noise": lambda: (theta, size * rng.standard_normal(tau.shape)),
    }


@pytest.mark.parametrize("wrong", sorted(wrongs(SimulatedMotion(*np.zeros((4, 2, 4))))))
def test_errors_of_arm_and_sensors_accuse_no_convention(bench: Bench, wrong: str) -> None:
    found = judged(*wrongs(bench.bare)[wrong]())
    assert found.alone or wrong != "nothing"
    assert not found.alone or found.best.convention == AS_READ


def test_a_rest_that_friction_holds_accuses_no_zero(bench: Bench) -> None:
    """What the torque is there is not the weight: the stretch says nothing."""
    theta, tau = measured(bench.bare)
    noise = np.random.default_rng(3).standard_normal((2, *theta.shape))
    still = theta[:, :1] + 3e-4 * noise[0]
    held = np.array([[0.5], [-0.3]]) + 1e-2 * noise[1]
    found = judge_together([Recorded(still, held, DT), Recorded(theta, tau, DT)])
    assert found.alone
    assert found.best.convention == AS_READ


def test_links_that_are_bent_by_less_than_45_degrees_accuse_no_zero(bench: Bench) -> None:
    """By 42° each, unlike ways: of all zeros one beyond 45° comes nearest."""
    k, motion = bench.arm.constants(), bench.bare
    alpha = forward_dynamics(k, motion.theta, motion.omega, motion.tau)
    c = np.append(k, k[[0, 1, 3]] * [0.9, 0.9, -0.9])
    tau = torque(Model(("phases",)), c, Motion(motion.theta, motion.omega, alpha))
    assert not judged(*measured(replace(motion, tau=tau))).alone


@pytest.mark.parametrize("off", [-0.01, 0.01])
def test_a_balanced_second_link_has_either_sign(off: float) -> None:
    """Its centre of mass is within 1 % of l2 of its axis: half a turn of θ2 changes next to nothing
    but the signs of k1 and k2.
    """
    arm = random_arm(21)[0]
    arm = replace(arm, lc2=off * arm.l2)
    motion = simulate(arm.constants(), wide_multi_sine(arm, 3), np.arange(4001) * DT)
    for mistake in (AS_READ, Convention(torque_signs=(-1, -1)), Convention(signs=(1, -1))):
        theta, tau = measured(motion)
        found = judged(mistake.angles(theta), mistake.drive @ tau)
        assert found.best.balanced
        assert found.alone
        assert found.best.convention == mistake


def test_a_light_second_link_is_not_balanced() -> None:
    """With 2 % of the first one's mass it still tells where θ2 is zero."""
    arm = random_arm(21)[0]
    share = 0.02 * arm.m1 / arm.m2
    light = replace(arm, m2=share * arm.m2, I2=share * arm.I2, b2=share * arm.b2)
    motion = simulate(light.constants(), wide_multi_sine(light, 3), np.arange(4001) * DT)
    theta, tau = measured(motion, coulomb=0.0)
    found = judged(theta + np.array([[0.0], [np.pi]]), tau)
    assert not found.as_read.balanced
    assert "k2 > 0" in found.as_read.broken


@pytest.mark.parametrize("passive", [1, 2])
@pytest.mark.parametrize(
    "mistake", ["nothing", "both torques", "θ2", "zero hanging", "θ2 absolute"]
)
def test_an_arm_with_one_motor_tells_its_convention(
    bench: Bench, passive: int, mistake: str
) -> None:
    """Of the joint without one no torque is known, and its equation holds nevertheless."""
    k, wide = bench.arm.constants(), wide_multi_sine(bench.arm, 3)
    motors = np.array([[float(passive != 1)], [float(passive != 2)]])
    motion = simulate(k, lambda times: wide(times) * motors, np.arange(4001) * DT)
    theta, tau = measured(motion, coulomb=0.0)
    read = spoiled(mistake, theta, tau * motors)
    found = judge_together([Recorded(*read, DT, passive)])
    assert found.alone
    assert (found.best.convention == AS_READ) == (mistake == "nothing")
    np.testing.assert_allclose(
        list(found.best.constants.values())[:5], k[:5], rtol=0.02, atol=0.02 * k[:5].max()
    )


@pytest.mark.parametrize("row", ["nothing", "τ1", "θ2 absolute", "zero hanging", "noise"])
def test_no_convention_that_is_passed_over_comes_nearer(bench: Bench, row: str) -> None:
    """Every convention with its zeros by quarter turns, against those that bounds leave."""
    theta, tau = measured(bench.bare)
    if row == "noise":
        tau = np.random.default_rng(2).standard_normal(tau.shape)
    else:
        theta, tau = spoiled(row, theta, tau)
    log = Recorded(theta, tau, DT)
    trials = Trials([log], True)
    looked_at = trials.unscaled()
    every = [trials.under(one, *_TURNS) for families in _families(log) for one in families]
    best = min((one.score for one in looked_at if not one.broken), default=np.inf)
    seen = {one.convention for one in looked_at}
    for one in (one for own in every for one in own if not one.broken):
        assert one.convention in seen or one.score > best + trials.apart


@pytest.mark.parametrize(("dt", "pulls"), [(1e-3, 1.0), (1.0, 1.0), (0.01, 0.0)])
def test_logs_that_cannot_tell(dt: float, pulls: float) -> None:
    theta, tau = np.random.default_rng(0).standard_normal((2, 2, 900))
    assert judge_together([Recorded(theta, pulls * tau, dt)]) is None
