"""What a likelihood's residual shows, on sound logs and on others."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import forward_dynamics, inverse_dynamics
from algid.estimators.misfit import shapes
from algid.identification.identify import identify
from algid.model import RIGID, Model, Motion
from algid.physics.signals import WIDTHS
from algid.settings import Settings
from algid.synth.simulator import HANGING
from pipelines import conventions, planar
from pipelines import misfit as scenes
from pipelines.accuracy_scenes import case_of, logged, waves
from tests.intervals import distances


def test_a_joint_without_a_motor_has_no_torque_that_its_faults_could_follow() -> None:
    """Its terms cancel: rounding is left of them, whose sign a dead band would follow."""
    k, t = case_of("case1").arm.constants(), np.arange(200) / 100
    theta, omega = np.stack([np.sin(t), np.cos(3 * t)]), np.stack([np.cos(t), -3 * np.sin(3 * t)])
    alpha = forward_dynamics(k, theta, omega, np.stack([5 * np.cos(t), 0 * t]))
    made = shapes(Model(), k, Motion(theta, omega, alpha), 0.01)
    driven, idle = made[len(WIDTHS) :].reshape(2, -1, t.size)[:, :6]
    # gears, saturation and a dead band follow the torque
    assert driven.any()
    assert not idle.any()


def test_a_spring_near_the_hanging_arm_is_no_weight_beyond_its_interval() -> None:
    """Least squares beside a spring's column did not move, and k4 was 5 and 7 σ off."""
    for case, share in (("case1", 0.01), ("case2", 0.03)):
        rng, k = np.random.default_rng(3), case_of(case).arm.constants()
        f, phase, t = rng.uniform(0.3, 2, (2, 4)), rng.uniform(0, 6, (2, 4)), np.arange(2500) / 250
        theta, omega, alpha = waves(t, f, 0.25 / np.sqrt(f), phase)
        theta += HANGING[:, None]
        tau = inverse_dynamics(k, theta, omega, alpha)
        size = np.sqrt(np.mean(tau**2, axis=1, keepdims=True))
        bent = theta - theta.mean(axis=1, keepdims=True)
        pulled = tau + share * size * bent / bent.std(axis=1, keepdims=True)
        result = identify(logged(t, theta, pulled, rng, (3e-4, 0.01 * size)), report=False)
        assert "REFUTED" in {notice.code for notice in result.notices}
        assert np.abs(distances(result, k[:5], RIGID)).max() < 4


@pytest.mark.slow
def test_gears_that_rub_by_all_torque_leave_no_good_result_whose_intervals_fail() -> None:
    """The noise's level took a tenfold error for noise: k1 … k5 were 20 σ off, and Good."""
    log = scenes.log_of("case1", "gears that rub by the motor's torque", 0.03, 1)
    result = identify(log, report=False)
    true = case_of("case1").arm.constants()
    assert result.verdict.grade == "reservations"
    assert "REFUTED:motion" in {notice.key for notice in result.notices}
    assert np.abs(distances(result, true[:5], RIGID)).max() < 4


@pytest.mark.slow
def test_a_model_that_was_asked_for_and_does_not_hold_says_so() -> None:
    log = scenes.log_of("case1", "drag by the square of speed", 0.03, 1)
    result = identify(log, settings=Settings(model="coulomb"), report=False)
    assert result.estimator == "weak"
    assert "REFUTED" in [notice.code for notice in result.notices]


def test_the_likelihood_adds_a_term_that_the_weak_form_s_noise_hid() -> None:
    """Phases of a hundredth of a degree: nothing to windows, six deviations to the likelihood."""
    result = planar.drawn("case2", planar.Row(small=3.0), 7026)
    assert result.estimator == "refined"
    (trial,) = (one for one in result.fit.terms if one.term == "phases")
    assert trial.kept
    assert "likelihood" in trial.why
    true = planar.truth(*planar.scene("case2", planar.ROWS[-1]))
    sines = ("k1s", "k2s", "k4s")
    assert np.abs(distances(result, [true[name] for name in sines], sines)).max() < 4


@pytest.mark.slow
def test_exchanged_logs_fail_where_the_likelihood_is_refuted_too() -> None:
    """Friction grows with the motion's torque, so that the likelihood of both logs is refuted."""
    seen = conventions.exchanged("case2", 1)
    assert seen["passes"] == [True]
    assert seen["told"][0].startswith("failed")
