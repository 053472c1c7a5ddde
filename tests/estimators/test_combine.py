"""Quadratic likelihoods that add up: against exact arithmetic, a solver of SciPy's, and textbook
formulas.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import hilbert, invhilbert
from scipy.optimize import least_squares

from algid.arm import Arm, FloatArray
from algid.estimators.combine import (
    LogInformation,
    Prior,
    combine,
    jackknife,
    joined,
    left_out,
    likelihood,
    scaled_pinv,
)
from algid.estimators.parametrisation import Shared
from algid.model import Model

ARM = Arm(0.6, 0.5, 0.1, 0.15, 0.2, 0.3, 0.004, 0.004, 0.1, 0.08)
TRUTH = np.array([*ARM.constants(), 0.25, ARM.l1, ARM.l2])
SHARED = Shared(Model(), payload=True)


def _log(
    loaded: bool, seed: int, noise: float = 0.0
) -> tuple[LogInformation, FloatArray, FloatArray]:
    """A log's likelihood at coefficients a little off, and the rows X c = y behind it."""
    rng = np.random.default_rng([seed, loaded])
    c = SHARED.coefficients(TRUTH, loaded)
    X = rng.standard_normal((40, 7)) / c
    y = X @ c + noise * rng.standard_normal(40)
    c0 = c * (1 + 0.01 * rng.standard_normal(7))
    S = X[:, :, None] * X[:, None, :]
    return LogInformation(loaded, c0, S, X * (y - X @ c0)[:, None]), X, y


@given(st.lists(st.floats(-8, 8), min_size=5, max_size=5))
@settings(max_examples=25, deadline=None)
def test_units_leave_a_pseudo_inverse_as_it_is(exponents: list[float]) -> None:
    """Of a matrix of Hilbert's, whose inverse is whole numbers, in any units of its rows."""
    size = 10.0 ** np.array(exponents)
    found = scaled_pinv(hilbert(5) * np.outer(size, size)) * np.outer(size, size)
    # rounding times a condition number of 5e5
    np.testing.assert_allclose(found, invhilbert(5, exact=True), rtol=1e-9)


@pytest.mark.parametrize("start", [1.0, 0.6, 1.7])
def test_the_most_likely_payload_is_that_of_another_solver(start: float) -> None:
    """Of two unloaded logs and a loaded one, beside a prior of two constants that is 10 % off, and
    one of a length.
    """
    logs = [_log(False, 3, 0.02), _log(False, 5, 0.02), _log(True, 4, 0.02)]
    known, precision = TRUTH[[1, 6]] * 1.1, np.array([[30.0, 5.0], [5.0, 20.0]])
    prior = joined(Prior(("k2", "k7"), known, precision), Prior(("l1",), TRUTH[8:9], np.eye(1)))
    begun = np.append(TRUTH[:7], TRUTH[7:] * start)
    beta, S, _ = combine(SHARED, [log for log, _, _ in logs], begun, prior)

    def residual(beta: FloatArray) -> FloatArray:
        own = [y - X @ SHARED.coefficients(beta, log.loaded) for log, X, y in logs]
        own += [np.linalg.cholesky(precision).T @ (beta[[1, 6]] - known), (beta - TRUTH)[8:9]]
        return np.concatenate(own)

    other = least_squares(residual, TRUTH, x_scale=TRUTH, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(beta, other.x, rtol=1e-5)
    units = np.outer(TRUTH, TRUTH)
    np.testing.assert_allclose(S * units, (other.jac.T @ other.jac) * units, rtol=1e-3)
    own = sum(0.5 * float(np.sum((y - X @ log.c0) ** 2)) for log, X, y in logs)
    every = [log for log, _, _ in logs]
    value, _, _ = likelihood(SHARED, every, beta, prior)
    assert value == pytest.approx(own - other.cost, rel=1e-6)


def test_directions_without_information_keep_their_values_and_nothing_finite_ends() -> None:
    flat = Shared(Model(gravity=0.0))
    S = np.diag([1.0, 2.0, 0.0, 3.0, 0.0])
    log = LogInformation(False, np.zeros(5), S[None], (S @ np.arange(1.0, 6.0))[None])
    beta, _, _ = combine(flat, [log], np.full(5, 9.0))
    np.testing.assert_allclose(beta, [1, 2, 9, 4, 9])
    broken = LogInformation(False, np.zeros(5), S[None], np.full((1, 5), np.nan))
    held, _, _ = combine(flat, [broken], np.full(5, 9.0))
    np.testing.assert_array_equal(held, 9.0)  # every step is refused, however short


def test_a_jackknife_by_kind_is_wolters_sum() -> None:
    """Σ_h (n_h − 1)/n_h Σ_i (β_(hi) − β̄_h)² written out for three unloaded logs and a loaded one,
    of which nothing is known.
    """
    logs = [_log(kind, seed)[0] for seed, kind in enumerate((False, False, False, True))]
    without = np.random.default_rng(5).standard_normal((4, 10))
    moved = [row - sum(without[:3]) / 3 for row in without[:3]]
    expected = 2 / 3 * sum(np.outer(row, row) for row in moved)
    np.testing.assert_allclose(jackknife(logs, without), expected, rtol=1e-12)


def test_what_is_left_out_is_what_the_others_tell_however_much_a_log_tells() -> None:
    """Of two kinds, at coefficients of their own, one 1e18 times as sure as the others."""
    flat = Shared(Model(gravity=0.0), payload=True)
    rng = np.random.default_rng(7)
    logs = []
    for number in range(6):
        A = rng.standard_normal((8, 5)) * (1e9 if number == 1 else 1.0)
        c0 = 1 + 0.1 * rng.standard_normal(5)
        logs.append(LogInformation(number > 3, c0, (A.T @ A)[None], (A.T @ A @ c0)[None] * 1e-3))
    beta = np.concatenate([np.ones(5), np.full(len(flat.names) - 5, 0.1)])
    for place, found in enumerate(left_out(flat, logs, beta)):
        rest = [*logs[:place], *logs[place + 1 :]]
        expected, _, _ = combine(flat, rest, beta)
        np.testing.assert_allclose(found, expected, rtol=1e-6)
