"""Work beside other work: its order, its errors, and that it ends with whoever wanted it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from algid.threads import Beside, ahead, beside, one_blas_thread


def test_items_read_ahead_keep_their_order() -> None:
    assert list(ahead(iter(range(100)))) == list(range(100))
    assert list(ahead(iter([]))) == []


def test_an_error_comes_where_the_item_would_have_come() -> None:
    def source() -> Iterator[int]:
        yield 1
        raise ValueError("damaged")

    items = ahead(source())
    assert next(items) == 1
    with pytest.raises(ValueError, match="damaged"):
        next(items)


def test_no_thread_is_left_when_the_consumer_leaves() -> None:
    before = threading.active_count()
    items = ahead(iter(range(100)))
    next(items)
    items.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_items_are_worked_on_in_order_and_to_the_last_one() -> None:
    seen: list[int] = []
    assert list(beside(range(100), seen.append)) == list(range(100))
    assert seen == list(range(100))


def test_an_error_of_the_work_beside_reaches_the_consumer() -> None:
    def work(item: int) -> None:
        if item == 2:
            raise ValueError("damaged")

    with pytest.raises(ValueError, match="damaged"):
        list(beside(range(3), work))


def test_work_beside_gives_its_result_or_its_error() -> None:
    assert Beside(lambda: 6 * 7).result() == 42
    with pytest.raises(ZeroDivisionError):
        Beside(lambda: 1 // 0).result()


def test_blas_is_bounded_within_the_block() -> None:
    import numpy as np
    from threadpoolctl import threadpool_info

    np.ones((4, 4)) @ np.ones((4, 4))
    with one_blas_thread():
        assert {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"} <= {1}
