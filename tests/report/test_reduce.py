from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.report.reduce import (
    MinMax,
    Share,
    Thinned,
    blocks,
    broken_at_gaps,
    bucket_size,
    table_of,
)
from algid.report.text import script_json


def reduced(y: FloatArray, size: int, cuts: list[int]) -> tuple[FloatArray, FloatArray]:
    reducer = MinMax(size)
    x = np.arange(y.size, dtype=np.float64)
    for part_x, part_y in zip(np.split(x, cuts), np.split(y, cuts), strict=True):
        reducer.feed(part_x, part_y)
    return reducer.result()


@given(
    st.integers(1, 400),
    st.integers(1, 60),
    st.lists(st.integers(0, 400), max_size=5),
    st.integers(0, 2**32 - 1),
)
def test_no_extreme_is_lost_however_the_series_is_cut(
    samples: int, size: int, cuts: list[int], seed: int
) -> None:
    y = np.random.default_rng(seed).normal(size=samples)
    whole = reduced(y, size, [])
    x, values = reduced(y, size, sorted(min(cut, samples) for cut in cuts))
    np.testing.assert_array_equal((x, values), whole)
    assert np.all(np.diff(x) > 0)
    np.testing.assert_array_equal(values, y[x.astype(int)])  # each where it lies
    for start in range(0, samples, size):
        inside = values[(x >= start) & (x < start + size)]
        stretch = y[start : start + size]
        assert inside.min() == stretch.min()
        assert inside.max() == stretch.max()
        assert size <= 2 or inside.size <= 2


def test_one_spike_in_a_million_stays() -> None:
    y = np.zeros(1_000_000)
    y[654_321] = 7.0
    x, values = reduced(y, bucket_size(y.size, 4000), [])
    assert x.size <= 4001
    assert x[values.argmax()] == 654_321
    assert values.max() == 7.0


def test_a_stretch_without_numbers_breaks_the_line_and_others_do_not() -> None:
    y = np.arange(30.0)
    y[10:20] = np.nan
    y[25] = np.nan
    _, values = reduced(y, 10, [])
    np.testing.assert_array_equal(values, [0, 9, np.nan, 20, 29])


def test_shares_add_up_over_blocks() -> None:
    holds = np.arange(25) % 5 == 0
    share = Share(10)
    share.feed(np.arange(7.0), holds[:7])
    share.feed(np.arange(7.0, 25.0), holds[7:])
    x, held = share.result()
    np.testing.assert_array_equal(x, [0, 10, 20])
    np.testing.assert_allclose(held, [0.2, 0.2, 0.2], rtol=1e-15)


@given(st.integers(1, 50), st.lists(st.integers(0, 500), max_size=4))
def test_thinning_keeps_one_sample_a_stretch_however_it_is_cut(step: int, cuts: list[int]) -> None:
    y = np.arange(500.0)[None]
    thinned = Thinned(step)
    for part in np.split(y, sorted(cuts), axis=1):
        thinned.feed(part)
    kept = thinned.result(1)[0]
    whole = 500 // step
    np.testing.assert_array_equal(kept[:whole] // step, np.arange(whole))
    assert whole <= kept.size <= whole + 1


def test_thinning_does_not_fall_into_step_with_a_periodic_motion() -> None:
    angle = np.mod(np.arange(100_000.0), 100)[None]
    thinned = Thinned(100)
    thinned.feed(angle)
    assert np.unique(thinned.result(1)).size >= 90


def test_a_line_breaks_where_samples_are_missing() -> None:
    x, y = broken_at_gaps(np.array([0.0, 1.0, 5.0, 6.0]), np.arange(4.0), 2.0)
    np.testing.assert_array_equal(x, [0, 1, 5, 5, 6])
    np.testing.assert_array_equal(y, [0, 1, np.nan, 2, 3])


def test_a_bucket_needs_a_sample() -> None:
    with pytest.raises(ValueError, match="at least 1, got 0"):
        MinMax(0)


@pytest.mark.parametrize("column", ["log", "t", "x"])
@pytest.mark.parametrize("value", [None, math.nan, math.inf, 1e300])
def test_a_row_that_lies_nowhere_is_refused(
    tmp_path: Path, column: str, value: float | None
) -> None:
    path = tmp_path / "series.parquet"
    pl.DataFrame({column: [0.0, value], "k1": [1.0, math.nan]}).write_parquet(path)
    with pytest.raises(ResultError, match=f"{column}': expected a number in every row"):
        list(blocks(path, [column, "k1"]))
    (block,) = blocks(path, ["k1"])
    np.testing.assert_array_equal(block["k1"], [1.0, np.nan])


def test_text_where_numbers_belong_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "series.parquet"
    pl.DataFrame({"quantity": ["a"], "value": ["b"]}).write_parquet(path)
    assert table_of(path, ["quantity", "value"]) == {"quantity": ["a"], "value": ["b"]}
    with pytest.raises(ResultError, match="'value': expected numbers, found"):
        table_of(path, ["quantity", "value"], numbers=["value"])


def test_no_number_is_null_on_a_page() -> None:
    panel = {"x": [1.0, math.nan], "range": (-math.inf, 2.0), "name": "NaN"}
    assert script_json([panel]) == '[{"x":[1.0,null],"range":[null,2.0],"name":"NaN"}]'
