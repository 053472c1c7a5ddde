import numpy as np
import pytest

from algid.base.quantiles import distinct, median, medians, quantile


@pytest.mark.parametrize("size", [1, 2, 3, 4, 9, 10, 1001])
def test_medians_are_those_of_numpy(size: int) -> None:
    rng = np.random.default_rng(size)
    rows = rng.standard_normal((3, size))
    np.testing.assert_array_equal(medians(rows), np.median(rows, axis=1))
    assert median(rows) == np.median(rows)
    whole = rng.integers(-(2**60), 2**60, size)
    assert median(whole) == np.median(whole)
    rows[1, size // 2] = np.nan
    np.testing.assert_array_equal(medians(rows), np.median(rows, axis=1))
    rows[1, size // 2] = np.inf
    np.testing.assert_array_equal(medians(rows), np.median(rows, axis=1))


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.9, 0.95, 0.99, 1.0])
@pytest.mark.parametrize("size", [1, 2, 7, 1000])
def test_quantiles_are_those_of_numpy(size: int, share: float) -> None:
    values = np.random.default_rng(size).standard_normal((2, size))
    assert quantile(values, share) == np.quantile(values, share)
    assert quantile(np.arange(size), share) == np.quantile(np.arange(size), share)
    values[0, 0] = np.nan
    assert np.isnan(quantile(values, share))


def test_distinct_values_are_those_of_numpy() -> None:
    values = np.random.default_rng(0).integers(0, 50, 400).astype(np.float64)
    np.testing.assert_array_equal(distinct(values), np.unique(values))
    assert distinct(np.zeros(0)).size == 0
