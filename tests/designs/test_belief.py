"""Beliefs and the figure that a design makes small, by closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.base.errors import SettingError
from algid.base.significance import SURE
from algid.designs.belief import Belief, Objective, objective_of
from algid.estimators.parametrisation import Shared
from algid.model import Model

SIZES = np.array([0.1, 1.0, 20.0])
ALL = np.ones(3, bool)


def asked(size: FloatArray = SIZES, wanted: FloatArray | None = None) -> Objective:
    return Objective(size, ALL, ALL if wanted is None else wanted.astype(bool))


def test_relative_bounds_of_correlated_parameters_are_those_of_cramer_and_rao() -> None:
    J = np.random.default_rng(1).standard_normal((40, 3)) * 100 / SIZES
    S = J.T @ J
    covariance = np.linalg.inv(S)  # of least squares with unit noise
    np.testing.assert_allclose(asked().relative(S), np.sqrt(np.diag(covariance)) / SIZES, rtol=1e-3)
    np.testing.assert_allclose(asked().covariance(S), asked().covariance(S).T, rtol=1e-10)


def test_the_figures_derivative_is_that_of_differences() -> None:
    rng = np.random.default_rng(2)
    J = rng.standard_normal((20, 3)) * 10 / SIZES
    S, asks = J.T @ J, asked(wanted=np.array([1, 0, 1]))
    _, A = asks.figure(S, 4.0)
    np.testing.assert_allclose(A, A.T, rtol=1e-9)
    for _ in range(5):
        D = rng.standard_normal((3, 3)) / np.outer(SIZES, SIZES)
        D = D + D.T
        step = 1e-4
        slope = (asks.figure(S + step * D, 4.0)[0] - asks.figure(S - step * D, 4.0)[0]) / (2 * step)
        assert np.trace(A @ D) == pytest.approx(slope, rel=1e-6, abs=1e-10)


def belief(box: bool) -> Belief:
    shared = Shared(Model(), payload=True, lengths={"l1": 0.4, "l2": 0.3})
    mean = np.array([0.05, 1.0, 0.03, 4.0, 0.2, 0.3, 0.2, 0.5])
    spread = np.zeros((8, 3))
    spread[3, 0], spread[3, 1], spread[7, 2] = 0.3, 0.4, 0.1
    return Belief(shared, mean, spread, box)


@pytest.mark.parametrize("box", [True, False])
def test_drawn_arms_scatter_as_believed(box: bool) -> None:
    one = belief(box)
    drawn = one.draws(4000, seed=3)
    # a uniform number has variance a third
    std = np.sqrt(np.diag(one.spread @ one.spread.T) / (3 if box else 1))
    np.testing.assert_allclose(one.std, std, rtol=1e-12)
    np.testing.assert_allclose(drawn.mean(axis=0), one.mean, atol=5 * std.max() / np.sqrt(4000))
    np.testing.assert_allclose(drawn.std(axis=0), std, atol=5 * std.max() / np.sqrt(8000))
    if box:
        assert np.all(np.abs(drawn - one.mean) <= np.abs(one.spread).sum(axis=1))
    load, Y = one.load(True), np.random.default_rng(4).standard_normal((2, 7, 3))
    torque = np.einsum("aqn,dq->dan", Y, [one.shared.coefficients(arm, True) for arm in drawn])
    mean, more, _ = load.largest(Y)
    np.testing.assert_allclose(torque.mean(axis=0), mean, atol=0.1 * more.max())
    if box:  # no arm asks for more, and one in a corner for nearly that
        assert np.all(np.abs(torque - mean) <= more + 1e-9)
        np.testing.assert_allclose(np.abs(torque - mean).max(axis=0), more, rtol=0.15)
    else:
        np.testing.assert_allclose(SURE * torque.std(axis=0), more, rtol=0.05)
    np.testing.assert_array_equal(one.draws(5, 3), one.draws(5, 3))
    assert np.any(one.draws(5, 3) != one.draws(5, 4))


def test_what_is_asked_for_is_what_the_prior_knows_or_what_is_named() -> None:
    one = belief(True)
    assert objective_of(one, None, "it").wanted.all()
    named = objective_of(one, ["k4", "m_p"], "it")
    np.testing.assert_array_equal(np.flatnonzero(named.wanted), [3, 7])
    np.testing.assert_array_equal(named.size, np.abs(one.mean))
    vague = Belief(one.shared, one.mean, 6 * one.spread, True)
    found = objective_of(vague, None, "it")
    # of k4, 4 ± 1.73, it is two deviations sure
    np.testing.assert_array_equal(np.flatnonzero(~found.known), [7])
    np.testing.assert_array_equal(found.wanted, found.known)
    assert found.size[3] == 4.0
    with pytest.raises(SettingError) as refused:
        objective_of(vague, ["k4", "m_p"], "it")
    assert str(refused.value) == (
        "--for m_p: it cannot tell it from zero (0.5 ± 0.35), so that no error is large or small "
        "beside it; leave it out"
    )
    with pytest.raises(SettingError) as refused:
        objective_of(one, ["l1"], "it")
    assert str(refused.value) == (
        "--for l1: expected some of k1, k2, k3, k4, k5, k6, k7, m_p, found 'l1' (there are no "
        "loaded runs); leave it out"
    )
