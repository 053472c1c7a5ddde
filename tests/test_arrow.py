"""Columns of Arrow as arrays and back, against Arrow's own conversion."""

from __future__ import annotations

import numpy as np
import pyarrow
import pytest

from algid.base.arrow import numbers_of, table_of_columns, whole_column


@pytest.mark.parametrize("dtype", ["i1", "i4", "i8", "u2", "f4", "f8"])
def test_numbers_go_to_arrow_and_back(dtype: str) -> None:
    values = np.arange(-3, 9).astype(dtype)[::2]  # not contiguous
    column = table_of_columns({"x": values})["x"].combine_chunks()
    assert column.equals(pyarrow.array(values))
    back = whole_column(column.slice(1, 3))
    assert back.dtype == values.dtype
    assert back.tolist() == values[1:4].tolist()


@pytest.mark.parametrize(
    "values", [[1.5, None, -2.0], [True, False, None], [True, False], [1, 2, 3], [None], []]
)
def test_what_is_missing_is_no_number(values: list[float | bool | None]) -> None:
    column = pyarrow.array(values, pyarrow.float64() if values in ([None], []) else None)
    np.testing.assert_array_equal(
        numbers_of(column), column.to_numpy(zero_copy_only=False).astype(float)
    )
