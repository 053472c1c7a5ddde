"""Choosing and ordering by name."""

from __future__ import annotations

import numpy as np
import pytest

from algid.base.names import (
    by_name,
    evenly_spread,
    names_in,
    outside,
    places_outside,
    vector,
    within,
)
from algid.model import K1, K2, K3, PARAMETERS


def test_what_is_chosen_keeps_its_order() -> None:
    names = (K3, K1, K2)
    assert within(names, {K2, K3}) == (K3, K2)
    assert outside(names, {K2, K3}) == (K1,)
    assert places_outside(names, {K1}) == [0, 2]


def test_names_of_parameters_find_them_again() -> None:
    chosen = [PARAMETERS[K2], PARAMETERS[K1]]
    assert names_in(chosen) == (K2, K1)
    assert list(by_name(chosen).items()) == [(K2, PARAMETERS[K2]), (K1, PARAMETERS[K1])]


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
