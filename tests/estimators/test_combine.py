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


def test_the_slope_of_the_likelihood_is_its_gradient_and_its_value_that_of_the_squares() -> None:
    logs = [_log(False, 1), _log(True, 2, 0.1)]
    prior = Prior(("k2", "k7"), TRUTH[[1, 6]] * 1.1, np.array([[30.0, 5.0], [5.0, 20.0]]))
    informations = [log for log, _, _ in logs]
    beta = TRUTH * 1.02

    def squares(beta: FloatArray) -> float:
        """−½ Σ (y − X c)² less that at c0, and the prior's, written out."""
        total = 0.0
        for log, X, y in logs:
            at, own = y - X @ SHARED.coefficients(beta, log.loaded), y - X @ log.c0
            total += 0.5 * float(own @ own - at @ at)
        off = beta[[1, 6]] - prior.mean
        return total - 0.5 * float(off @ prior.precision @ off)

    value, gradient, S = likelihood(SHARED, informations, beta, prior)
    assert value == pytest.approx(squares(beta), rel=1e-10)
    steps = 1e-6 * np.diag(TRUTH)
    slopes = [(squares(beta + step) - squares(beta - step)) / (2 * step.max()) for step in steps]
    scaled = gradient * TRUTH
    np.testing.assert_allclose(np.array(slopes) * TRUTH, scaled, atol=1e-6 * np.abs(scaled).max())
    np.testing.assert_allclose(S, S.T, rtol=1e-12)


@pytest.mark.parametrize("start", [1.0, 0.6, 1.7])
def test_the_most_likely_payload_is_that_of_another_solver(start: float) -> None:
    logs = [_log(False, 3, 0.02), _log(True, 4, 0.02)]
    begun = np.append(TRUTH[:7], TRUTH[7:] * start)
    beta, S, value = combine(SHARED, [log for log, _, _ in logs], begun)

    def residual(beta: FloatArray) -> FloatArray:
        return np.concatenate([y - X @ SHARED.coefficients(beta, log.loaded) for log, X, y in logs])

    other = least_squares(residual, TRUTH, x_scale=TRUTH, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(beta, other.x, rtol=1e-5)
    np.testing.assert_allclose(
        S / np.outer(1 / TRUTH, 1 / TRUTH),
        (other.jac.T @ other.jac) * np.outer(TRUTH, TRUTH),
        rtol=1e-3,
    )
    own = sum(0.5 * float(np.sum((y - X @ log.c0) ** 2)) for log, X, y in logs)
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
    """Σ_h (n_h − 1)/n_h Σ_i (β_(hi) − β̄_h)² written out for three unloaded and two loaded logs,
    and one alone.
    """
    rng = np.random.default_rng(5)
    logs = [_log(kind, seed)[0] for seed, kind in enumerate((False, False, False, True, True))]
    without = rng.standard_normal((5, 10))
    expected = np.zeros((10, 10))
    for rows in (range(3), range(3, 5)):
        mean = sum(without[row] for row in rows) / len(rows)
        for row in rows:
            expected += (
                (len(rows) - 1) / len(rows) * np.outer(without[row] - mean, without[row] - mean)
            )
    found = jackknife(logs, without)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    one, other = (
        jackknife(logs[:4], without[:4]),
        jackknife([*logs[:3], logs[4]], without[[0, 1, 2, 4]]),
    )
    np.testing.assert_allclose(one, other, rtol=1e-12)


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
