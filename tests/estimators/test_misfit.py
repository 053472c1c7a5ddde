"""The score test of a likelihood's residual: by least squares, on sound logs and on others."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from algid.arm import FloatArray, inverse_dynamics
from algid.base.names import vector
from algid.estimators.elastic import flexed
from algid.estimators.log_likelihood import Beside
from algid.estimators.misfit import misfit, shapes
from algid.estimators.parametrisation import Shared
from algid.estimators.terms import Products
from algid.estimators.whitening import modelled
from algid.identification.identify import identify
from algid.model import RIGID, TERMS, Model, Motion, torque
from algid.settings import Settings
from algid.synth.simulator import HANGING
from pipelines import conventions, planar
from pipelines import misfit as scenes
from pipelines.accuracy_scenes import case_of, logged, waves
from tests.intervals import distances

DT = 1e-3
C = np.array([8e-4, 0.05, 2e-3, 0.42, 5.5e-3, 0.136, 0.31, 0.1, 0.05])


def motion_of(count: int = 400) -> Motion:
    rng = np.random.default_rng(5)
    return Motion(*(size * rng.standard_normal((2, count)) for size in (1.0, 3.0, 20.0)))


def told(model: Model, c: FloatArray, motion: Motion, beside: FloatArray) -> tuple[Products, float]:
    """The test of a log with white noise of unit deviation, and with the torque `beside`."""
    rng = np.random.default_rng(6)
    shared, error = Shared(model), rng.standard_normal(motion.theta.shape) + beside

    def products(whole: Shared, c: FloatArray, more: Beside) -> tuple[FloatArray, float]:
        c = c[:-1]
        bent = flexed(whole.model, c, motion, DT)
        J, tau = modelled(whole.model, c, bent, DT)
        late = np.gradient(tau, DT, axis=1)
        blocks = J.swapaxes(0, 1), late[None], more(whole.model, c, bent, DT), error[None]
        rows = np.concatenate(blocks).swapaxes(0, 1)
        return rows @ rows.swapaxes(1, 2), 0.0

    log = SimpleNamespace(products=products, loaded=False, trained=motion.theta.shape[1])
    log.kept = [SimpleNamespace(dt=DT, tau=np.ones((2, 1)))]
    found = Products([log], shared, {False: c}, 0.0, shapes)  # type: ignore[list-item]
    fit = SimpleNamespace(names=shared.names, values=c, shared=shared)
    return found, misfit(fit, found, None)  # type: ignore[arg-type]


def squares(columns: FloatArray, e: FloatArray) -> float:
    """What least squares leaves of e."""
    scaled = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    h, *_ = np.linalg.lstsq(scaled.T, e, rcond=1e-9)
    return float(np.sum((e - scaled.T @ h) ** 2))


@pytest.mark.parametrize("term", ["offset", "stribeck", "load", "phases"])
def test_a_term_explains_what_least_squares_with_it_does(term: str) -> None:
    model, motion = Model(("coulomb",)), motion_of()
    found, _ = told(model, C, motion, np.zeros((2, 400)))
    wide = replace(model, terms=("coulomb", term))
    c = vector(wide.names, dict(zip(model.names, C.tolist(), strict=True)), otherwise=0.0)
    J, tau = modelled(wide, c, motion, DT)
    wider = replace(model, coulomb_speed=model.coulomb_speed * 1.001)
    narrower = replace(model, coulomb_speed=model.coulomb_speed / 1.001)
    width = (torque(wider, C, motion) - torque(narrower, C, motion))[None]
    both = np.concatenate([J.swapaxes(0, 1), width]).reshape(-1, 800)
    own = [name in TERMS[term].names for name in wide.names] + [False]
    e = (tau + np.random.default_rng(6).standard_normal(tau.shape)).ravel()
    explained = squares(both[~np.array(own)], e) - squares(both, e)
    _, without, _ = found.solve(found.columns(["coulomb"]))
    _, left, _ = found.solve(found.columns(["coulomb", term]))
    assert without - left == pytest.approx(explained, rel=1e-3)


def test_white_noise_is_no_misfit_and_a_shape_of_no_term_is() -> None:
    motion, model = motion_of(), Model(("coulomb",))
    assert told(model, C, motion, np.zeros((2, 400)))[1] > 0.01
    assert told(model, C, motion, 0.6 * np.sin(2 * motion.theta))[1] < 1e-4
    far = replace(motion, theta=4 * motion.theta)
    assert told(model, C, far, 0.1 * far.theta)[1] < 1e-4


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
