"""Choosing and ordering by name."""

from __future__ import annotations

import numpy as np
import pytest

from algid.base.names import (
    evenly_spread,
    vector,
)
from algid.model import K1, K2, K3


def test_a_vector_has_the_order_of_the_names_and_says_what_is_missing() -> None:
    values = {K1: 1.0, K3: 3.0}
    np.testing.assert_array_equal(vector((K3, K1), values), [3.0, 1.0])
    np.testing.assert_array_equal(vector((K3, K2), values, otherwise=0.0), [3.0, 0.0])
    assert vector((), values).shape == (0,)
    with pytest.raises(KeyError, match=K2):
        vector((K3, K2), values)


@pytest.mark.parametrize(
    ("count", "most", "chosen"),
    [(0, 3, []), (3, 3, [0, 1, 2]), (4, 3, [0, 2]), (7, 3, [0, 3, 6]), (5, 1, [0])],
)
def test_some_of_many_are_evenly_spread_and_no_more_than_asked(
    count: int, most: int, chosen: list[int]
) -> None:
    assert list(evenly_spread(range(count), most)) == chosen
