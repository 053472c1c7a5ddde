"""Error bars of regressions whose sandwich is written down row by row, and their degrees of
freedom.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from algid.arm import FloatArray
from algid.estimators.combine import LogInformation, long_run_variance
from algid.estimators.fit import Fit, finish
from algid.estimators.parametrisation import Shared
from algid.model import Model

SHARED = Shared(Model(gravity=0.0))  # k1, k3, k5, k6, k7
Q = len(SHARED.names)


def _information(X: FloatArray, y: FloatArray, loaded: bool = False) -> LogInformation:
    """A row a stretch: the likelihood of y = X c + noise of variance 1, at c = 0."""
    return LogInformation(
        loaded, np.zeros(X.shape[1]), X[:, :, None] * X[:, None, :], X * y[:, None]
    )


def _regression(rows: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Regressors and what is measured at c = (2, 2, 2, 2, 2), with noise that grows
    along the log.
    """
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((rows, Q)) * np.sign(rng.standard_normal((rows, 1)))
    return X, X @ np.full(Q, 2.0) + 0.1 * np.linspace(0.5, 2, rows) * rng.standard_normal(rows)


def _fit(X: FloatArray, y: FloatArray) -> Fit:
    return finish("weak", SHARED, [_information(X, y)], np.zeros(Q), np.ones(2), coloured=True)


def _bartlett(scores: FloatArray, lags: int) -> FloatArray:
    """Newey & West 1987, eq. (5), pair by pair."""
    n = len(scores)
    weight = [[max(0.0, 1 - abs(i - j) / (lags + 1)) for j in range(n)] for i in range(n)]
    return scores.T @ np.array(weight) @ scores


@pytest.mark.parametrize("rows", [60, 150, 400])
def test_covariance_and_quantile_are_those_of_n_less_p_rows(rows: int) -> None:
    X, y = _regression(rows, seed=rows)
    fit = _fit(X, y)
    c = np.linalg.lstsq(X, y, rcond=None)[0]
    np.testing.assert_allclose(fit.values, c, rtol=1e-9)
    scores = X * (y - X @ c)[:, None]
    _, lags = long_run_variance(scores)
    free = rows // (lags + 1) - Q  # rows that the window makes one are one
    inverse = np.linalg.inv(X.T @ X)
    expected = (free + Q) / free * inverse @ _bartlett(scores, lags) @ inverse
    np.testing.assert_allclose(fit.covariance, expected, rtol=1e-7)
    assert fit.freedom == free
    assert fit.quantile == pytest.approx(student.ppf(0.975, free), rel=1e-9)
    assert fit.intervals == "sandwich"


def test_lags_are_those_of_andrews() -> None:
    """Eq. (6.2), (6.4) of 1991: 1.1447 (α n)^⅓, with α = 4 ρ² / ((1 − ρ)² (1 + ρ)²) of one
    autoregression.
    """
    rng = np.random.default_rng(2)
    for rho in (0.3, -0.3, 0.7):
        scores = lfilter([1.0], [1.0, -rho], rng.standard_normal(3001))
        found = np.sum(scores[1:] * scores[:-1]) / np.sum(scores**2)
        alpha = 4 * found**2 / ((1 - found) ** 2 * (1 + found) ** 2)
        assert long_run_variance(scores[:, None])[1] == int(1.1447 * (alpha * 3001) ** (1 / 3))
    # as correlated as can be: a quarter of the rows, and no more
    total, lags = long_run_variance(np.ones((8, 1)))
    assert lags == 2
    assert total[0, 0] == pytest.approx(_bartlett(np.ones((8, 1)), 2)[0, 0])
    assert long_run_variance(np.zeros((8, 2)))[1] == 0
