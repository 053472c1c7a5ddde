"""Work beside other work: its order, its errors, and that it ends with whoever wanted it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from algid.base.runtime import Beside, Worker, ahead, keep_to_one_core


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


@pytest.mark.parametrize("damaged", [1, 2])  # while items come, and behind the last one
def test_an_error_of_the_work_reaches_whoever_hands_items_over(damaged: int) -> None:
    def work(item: int) -> None:
        if item == damaged:
            raise ValueError("damaged")

    def hand_over() -> None:
        with Worker(work) as worker:
            for item in range(3):
                worker.push(item)

    with pytest.raises(ValueError, match="damaged"):
        hand_over()


def test_work_beside_gives_its_result_or_its_error() -> None:
    assert Beside(lambda: 6 * 7).result() == 42
    with pytest.raises(ZeroDivisionError):
        Beside(lambda: 1 // 0).result()


@pytest.fixture
def one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("algid.base.runtime._has_other_cores", True)  # to be put back
    keep_to_one_core()


@pytest.mark.usefixtures("one_core")
def test_a_process_that_keeps_to_one_core_starts_no_thread() -> None:
    before = threading.active_count()
    seen: list[int] = []
    with Worker(seen.append) as worker:
        for item in ahead(iter(range(5))):
            worker.push(item)
            assert threading.active_count() == before, item
    assert seen == [0, 1, 2, 3, 4]
    assert Beside(threading.current_thread).result() is threading.current_thread()
    with pytest.raises(ZeroDivisionError):
        Beside(lambda: 1 // 0).result()
