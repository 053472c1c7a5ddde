"""The score test of a likelihood's residual: by least squares, on sound logs and on others."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from algid.arm import FloatArray
from algid.estimators.misfit import columns, lacking, misfit
from algid.identification.identify import identify
from algid.model import RIGID, TERMS, Model, Motion, regressor, torque
from algid.settings import Settings
from pipelines import conventions, planar
from pipelines import misfit as scenes
from pipelines.accuracy_scenes import case_of
from tests.intervals import distances

K = np.array([8e-4, 0.05, 2e-3, 0.42, 5.5e-3, 0.136, 0.31])


def motion_of(count: int = 400) -> Motion:
    rng = np.random.default_rng(5)
    return Motion(*(size * rng.standard_normal((2, count)) for size in (1.0, 3.0, 20.0)))


def told(
    model: Model, c: FloatArray, motion: Motion, beside: FloatArray, *, delay: bool = False
) -> Any:
    """The test of a log with white noise of unit deviation, and with the torque `beside`."""
    rng = np.random.default_rng(6)
    Y = regressor(model, motion, c)
    error = rng.standard_normal(motion.theta.shape) + beside
    blocks = [Y.swapaxes(0, 1), error[None], columns(model, c, motion, 1e-3)]
    rows = np.concatenate([block.reshape(len(block), -1) for block in blocks])
    fit = SimpleNamespace(
        names=model.names,
        values=c,
        shared=SimpleNamespace(
            model=model, delay=delay, jacobian=lambda _c, _loaded: np.eye(len(c))
        ),
    )
    return rows, misfit(fit, [(False, rows @ rows.T)], None)  # type: ignore[arg-type]


def squares(columns: FloatArray, e: FloatArray) -> float:
    """What least squares leaves of e."""
    scaled = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    h, *_ = np.linalg.lstsq(scaled.T, e, rcond=1e-9)
    return float(np.sum((e - scaled.T @ h) ** 2))


@pytest.mark.parametrize("term", ["offset", "stribeck", "load", "phases"])
def test_the_statistic_of_a_term_is_what_least_squares_with_it_explains(term: str) -> None:
    model = Model(("coulomb",))
    c = np.array([*K, 0.1, 0.05])
    motion = motion_of()
    rows, found = told(model, c, motion, np.zeros((2, 400)))
    q, pairs = len(c), lacking(model)
    Y, e, G = rows[:q], rows[q], rows[q + 1 :]
    wider = replace(model, coulomb_speed=model.coulomb_speed * 1.001)
    narrower = replace(model, coulomb_speed=model.coulomb_speed / 1.001)
    width = (torque(wider, c, motion) - torque(narrower, c, motion)).ravel()
    own = [place for place, pair in enumerate(pairs) if pair[0] == term]
    plain = np.vstack([Y, width])
    explained = squares(plain, e) - squares(np.vstack([plain, G[own]]), e)
    (one,) = (each for each in found.overlooked if each.term == term)
    assert one.p_value == pytest.approx(chi2.sf(explained, len(own)), rel=1e-3)
    assert list(one.values) == list(TERMS[term].names)


@pytest.mark.parametrize("delay", [False, True])
def test_a_delay_is_overlooked_where_none_is_estimated(delay: bool) -> None:
    """The torque acts 5 ms late: beside an estimated delay its slow part shows no other."""
    c, motion = np.array([*K, 0.1, 0.05]), motion_of()
    model = Model(("coulomb",))
    late = np.gradient(torque(model, c, motion), 1e-3, axis=1) * 5e-3
    _, found = told(model, c, motion, late, delay=delay)
    assert ("delay" in {one.term for one in found.overlooked}) is not delay


def test_white_noise_is_no_misfit_and_a_shape_of_no_term_is() -> None:
    c, motion = np.array([*K, 0.1, 0.05]), motion_of()
    model = Model(("coulomb",))
    assert not told(model, c, motion, np.zeros((2, 400)))[1].significant
    spring = 0.6 * np.sin(2 * motion.theta)
    assert told(model, c, motion, spring)[1].significant


def test_a_term_that_is_missing_is_the_most_evident_and_its_value_right() -> None:
    c, motion = np.array([*K, 0.1, 0.05]), motion_of()
    offset = np.array([[0.5], [-0.4]]) * np.ones((2, 400))
    seen = told(Model(("coulomb",)), c, motion, offset)[1]
    best = min(seen.overlooked, key=lambda one: one.p_value)
    assert best.term == "offset"
    assert best.values == pytest.approx({"o1": 0.5, "o2": -0.4}, abs=0.2)


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
