"""Are the innovations white and Gaussian, as the error bars of the likelihood suppose?

Ljung & Box's test on the innovations of each joint, as they are and summed over 16 and 64 samples, so that slow
colour is seen as well as fast. The smallest p-value counts three times over (Bonferroni), and a correlation too
faint to matter counts as none. The excess kurtosis tells heavy tails.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from algid.arm import FloatArray

SCALES = (1, 16, 64)
_LAGS = 10
P_VALUE = 1e-3
_FAINT = 0.02  # root mean square of the correlations that does not matter
_TAILS = 6.0  # standard errors of the kurtosis
_HEAVY = 1.0  # excess kurtosis that matters


@dataclass(frozen=True, eq=False)
class Correlations:
    """Sums over innovations: counts (3,), lag products (3, 2, 1 + lags) by scale, fourth powers (2,)."""

    count: FloatArray
    products: FloatArray
    fourth: FloatArray

    def __add__(self, other: Correlations) -> Correlations:
        return Correlations(self.count + other.count, self.products + other.products, self.fourth + other.fourth)


@dataclass(frozen=True, eq=False)
class Whiteness:
    """The test's outcome by joint (2,): p-value, lag-one correlation, excess kurtosis; and the verdict."""

    p_value: FloatArray
    lag1: FloatArray
    kurtosis: FloatArray
    joint_white: tuple[bool, bool]

    @property
    def white(self) -> bool:
        """Whether both joints' innovations pass."""
        return all(self.joint_white)


def correlations(w: FloatArray) -> Correlations:
    """Sums for the innovations w (2, n) of one piece."""
    counts, products = [], []
    for scale in SCALES:
        whole = w.shape[1] // scale
        x = w if scale == 1 else w[:, : whole * scale].reshape(2, whole, scale).sum(axis=2) / np.sqrt(scale)
        counts.append(float(whole))
        products.append([_lag_products(row) for row in x])
    return Correlations(np.array(counts), np.array(products), np.sum(w**4, axis=1))


def _lag_products(x: FloatArray) -> FloatArray:
    return np.array([x[lag:] @ x[: x.size - lag] if lag < x.size else 0.0 for lag in range(_LAGS + 1)])


def judge(sums: Correlations) -> Whiteness:
    """Test the innovations whose sums are given."""
    power = np.maximum(sums.products[:, :, :1], 1e-300)
    rho = sums.products[:, :, 1:] / power
    n = sums.count[:, None, None]
    lags = np.arange(1, _LAGS + 1)
    tested = lags < n / 4
    statistic = np.sum(np.where(tested, n * (n + 2) * rho**2 / np.maximum(n - lags, 1), 0.0), axis=2)
    p = chdtrc(np.maximum(tested.sum(axis=2), 1), statistic)
    # In a long log the least colour is significant; one this faint does not move an error bar.
    faint = np.sqrt(np.mean(rho**2, axis=2)) < _FAINT
    p_value = np.minimum(1.0, len(SCALES) * np.where(faint, 1.0, p).min(axis=0))
    variance = power[0, :, 0] / sums.count[0]
    kurtosis = sums.fourth / sums.count[0] / variance**2 - 3
    heavy = (kurtosis > _HEAVY) & (kurtosis > _TAILS * np.sqrt(24 / sums.count[0]))
    white = [bool(p_value[joint] >= P_VALUE and not heavy[joint]) for joint in range(2)]
    return Whiteness(p_value, rho[0, :, 0], kurtosis, (white[0], white[1]))
