"""Work beside other work: its order, its errors, and that it ends with whoever wanted it."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from algid.base.runtime import ahead, beside, keep_to_one_core


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


def test_work_beside_gives_its_result_or_its_error_and_keeps_no_process_alive() -> None:
    assert beside(lambda: 6 * 7).result() == 42
    with pytest.raises(ZeroDivisionError):
        beside(lambda: 1 // 0).result()
    script = "import time; from algid.base.runtime import beside; beside(lambda: time.sleep(60))"
    subprocess.run([sys.executable, "-c", script], check=True, timeout=30)


@pytest.fixture
def one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("algid.base.runtime._has_other_cores", True)  # to be put back
    keep_to_one_core()


@pytest.mark.usefixtures("one_core")
def test_a_process_that_keeps_to_one_core_starts_no_thread() -> None:
    before = threading.active_count()
    for item in ahead(iter(range(5))):
        assert threading.active_count() == before, item
    assert beside(threading.current_thread).result() is threading.current_thread()
    with pytest.raises(ZeroDivisionError):
        beside(lambda: 1 // 0).result()
