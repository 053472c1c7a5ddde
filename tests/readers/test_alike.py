"""Records of one size are found without a walk, and only where they tile the chunk."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from algid.readers.mcap.records import alike, records_in
from algid.readers.messages.columnar import ColumnDecoder, Numbers, Shape


def message(number: int, size: int, code: int = 5, channel: int = 1) -> bytes:
    time = 10 * number
    return struct.pack("<BQHIQQ", code, 22 + size, channel, number, time, time) + bytes(size)


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


@pytest.mark.parametrize("size", [0, 1, 8, 43])
def test_messages_of_one_size_stand_in_bytes_of_their_own(size: int) -> None:
    records = [message(number, size) for number in range(5)]
    payloads = [bytes([number] * size) for number in range(5)]
    content = message(5, 100, channel=2) + b"".join(
        one[: len(one) - size] + payload for one, payload in zip(records, payloads, strict=True)
    )
    messages = records_in(content).of({1})
    assert messages.content.size == 5 * (size // 8 + (size % 8 > 0 or size == 0)) * 8
    ends = messages.starts + messages.sizes
    read = [
        messages.content[first:last].tobytes()
        for first, last in zip(messages.starts, ends, strict=True)
    ]
    assert read == payloads
    assert messages.log_ns.tolist() == [0, 10, 20, 30, 40]


def test_numbers_do_not_keep_the_messages_they_stood_in() -> None:
    shape = Shape(numbers={"a": Numbers(0, "<f8"), "b": Numbers(8, "<i4")})
    decoder = ColumnDecoder({"a": "a", "b": "b"}, lambda _: True, walk=lambda _: shape)
    content = b"".join(message(number, 16) for number in range(9))
    held, columns = decoder.columns(records_in(content).of({1}))
    assert held.all()
    assert all(column.base is None for column in columns.values())
