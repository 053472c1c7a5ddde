"""The whiteness test against Ljung and Box's own formula (1978), and how often it is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from algid.arm import FloatArray
from algid.estimators.innovations import ResidualSums, judge, residual_sums


def summed(w: FloatArray) -> list[ResidualSums]:
    return [residual_sums(w, 1.0)]


def _ljung_box(x: np.ndarray, lags: int = 10) -> float:
    """Q = n (n + 2) Σ ρ_h² / (n − h), sample by sample."""
    n = x.size
    q = 0.0
    for lag in range(1, lags + 1):
        rho = sum(x[i] * x[i - lag] for i in range(lag, n)) / sum(value * value for value in x)
        q += rho**2 / (n - lag)
    return n * (n + 2) * q


def test_the_p_value_is_that_of_the_least_likely_scale_three_times_over() -> None:
    rng = np.random.default_rng(3)
    w = np.stack(
        [np.convolve(rng.standard_normal(1301), [1.0, 0.1], "valid"), rng.standard_normal(1300)]
    )
    found = judge(summed(w))
    for joint in range(2):
        by_scale = [
            w[joint],
            w[joint, :1296].reshape(-1, 16).sum(axis=1),
            w[joint, :1280].reshape(-1, 64).sum(axis=1),
        ]
        # of 20 sums over 64 samples four lags are told: those below a quarter as many
        q = [
            (_ljung_box(x, min(10, (x.size - 1) // 4)), min(10, (x.size - 1) // 4))
            for x in by_scale
        ]
        p = min(1.0, 3 * min(float(chi2.sf(value, lags)) for value, lags in q))
        assert found.p_value[joint] == pytest.approx(p, rel=1e-9)
        x = w[joint]
        assert found.lag1[joint] == pytest.approx((x[1:] @ x[:-1]) / (x @ x), rel=1e-12)


def test_white_innovations_pass_as_often_as_said_and_coloured_ones_do_not() -> None:
    rng = np.random.default_rng(5)
    found = [judge(summed(rng.standard_normal((2, 4000)))) for _ in range(400)]
    assert sum(all(one.joint_white) for one in found) >= 398
    fast, slow = rng.standard_normal((2, 4001)), rng.standard_normal((2, 4000))
    fast[0, 1:] += 0.15 * fast[0, :-1]
    slow[1] += 0.15 * np.sin(np.arange(4000) / 60)
    assert judge(summed(fast)).joint_white == (False, True)
    assert judge(summed(slow)).joint_white == (True, False)


def test_colour_that_is_too_faint_to_matter_is_none() -> None:
    rng = np.random.default_rng(6)
    faint = np.stack(
        [np.convolve(row, [1.0, 0.03], "valid") for row in rng.standard_normal((2, 60_001))]
    )
    assert float(chi2.sf(60_000 * 0.03**2, 10)) < 1e-6  # Ljung and Box alone would call it coloured
    assert all(judge(summed(faint)).joint_white)
