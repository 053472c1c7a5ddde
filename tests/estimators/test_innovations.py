"""The residual's pictures against other libraries' spectra, and their bands against noise that is
known to be white.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import binom

from algid.arm import FloatArray
from algid.estimators.innovations import (
    autocorrelation,
    pooled,
    residual_sums,
    spectra,
    whiteness_of,
)

DT = 2e-3


def _inside(value: FloatArray, low: FloatArray, high: FloatArray) -> int:
    return int(np.count_nonzero((value >= low) & (value <= high)))


def test_the_bands_hold_95_percent_of_white_noise_and_tell_it_from_90() -> None:
    rng = np.random.default_rng(5)
    lags = bins = lags_in = bins_in = 0
    for _ in range(40):
        pieces = [residual_sums(rng.normal(size=(2, n)), DT) for n in (4000, 2500, 700, 5)]
        sums = pooled(pieces)
        r, S = autocorrelation(sums), whiteness_of(sums)
        lags, lags_in = lags + r.values.size, lags_in + _inside(r.values, r.low, r.high)
        bins, bins_in = bins + S.values.size, bins_in + _inside(S.values, S.low, S.high)
    for count, inside in ((lags, lags_in), (bins, bins_in)):
        low, high = binom.interval(0.999, count, 0.95)
        assert low <= inside <= high, (count, inside)
        assert inside > binom.ppf(0.999, count, 0.90)


def test_the_density_of_coloured_noise_is_that_of_its_filter() -> None:
    rng = np.random.default_rng(1)
    count = inside = 0
    for _ in range(30):
        w = np.stack(
            [np.convolve(row, [1.0, 0.8], "valid") for row in rng.normal(size=(2, 20_001))]
        )
        sums = residual_sums(w, DT)
        found = spectra(sums)
        exact = 2 * DT * np.abs(1 + 0.8 * np.exp(-2j * np.pi * found.x * DT)) ** 2
        # the bins are narrow beside the filter's shape but for the highest, where it falls to a
        # hundredth
        wide = found.x < 0.35 / DT
        share = (found.values / exact)[:, wide]
        count, inside = (
            count + share.size,
            inside + _inside(share, found.low[wide], found.high[wide]),
        )
        # five standard errors of 20,000 samples
        np.testing.assert_allclose(autocorrelation(sums).values[:, 0], 0.8 / 1.64, atol=0.035)
    low, high = binom.interval(0.999, count, 0.95)
    assert low <= inside <= high, (count, inside)
    assert inside > binom.ppf(0.999, count, 0.90)


def test_a_residual_that_is_nothing_is_no_number() -> None:
    found = residual_sums(np.zeros((2, 400)), DT)
    assert not autocorrelation(found).values.any()
    assert not whiteness_of(found).values.any()
    assert all(part.size == 0 for part in spectra(residual_sums(np.zeros((2, 5)), DT)))
