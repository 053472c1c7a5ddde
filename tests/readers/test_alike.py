"""Records of one size are found without a walk, and only where they tile the chunk."""

from __future__ import annotations

import struct

import numpy as np

from algid.readers.mcap.records import alike, records_in


def message(number: int, size: int, code: int = 5) -> bytes:
    return struct.pack("<BQHIQQ", code, 22 + size, 1, number, 10 * number, 10 * number) + bytes(
        size
    )


def found(content: bytes) -> list[int] | None:
    records = alike(np.frombuffer(content, np.uint8))
    return None if records is None else records.tolist()


def test_equal_messages_are_found_at_once_and_rightly() -> None:
    content = b"".join(message(number, 40) for number in range(5))
    assert found(content) == [71 * number for number in range(5)]
    messages = records_in(content).of({1})
    assert messages.log_ns.tolist() == [0, 10, 20, 30, 40]
    assert set(messages.sizes.tolist()) == {40}


def test_anything_else_is_left_to_the_walk() -> None:
    assert found(message(0, 40) + message(1, 41) + message(2, 39)) is None
    assert found(message(0, 40) + message(1, 40, code=4)) is None
    assert found(message(0, 40)[:-1]) is None
    assert found(b"") is None
    mixed = message(0, 40) + message(1, 41) + message(2, 39)
    assert records_in(mixed).of({1}).sizes.tolist() == [40, 41, 39]
