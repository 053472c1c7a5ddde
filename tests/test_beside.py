"""Work beside other work: its order, its errors, and that it ends with whoever wanted it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from algid.runtime import Beside, ahead, beside, executor, keep_to_one_core


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


@pytest.fixture
def one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("algid.runtime._has_other_cores", True)  # to be put back
    keep_to_one_core()


@pytest.mark.usefixtures("one_core")
def test_a_process_that_keeps_to_one_core_starts_no_thread() -> None:
    before = threading.active_count()
    seen: list[int] = []
    for item in ahead(beside(range(5), seen.append)):
        assert threading.active_count() == before, item
    assert seen == [0, 1, 2, 3, 4]
    assert Beside(threading.current_thread).result() is threading.current_thread()
    with pytest.raises(ZeroDivisionError):
        Beside(lambda: 1 // 0).result()


@pytest.mark.usefixtures("one_core")
def test_an_error_comes_where_the_work_was_done_at_once() -> None:
    with executor(2) as pool:
        assert pool.submit(divmod, 7, 2).result() == (3, 1)
        with pytest.raises(ZeroDivisionError):
            pool.submit(divmod, 7, 0).result()
