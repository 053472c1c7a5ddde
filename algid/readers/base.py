"""What every reader of a log format offers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from algid.log import Log, Origin

BLOCK_ROWS = 1 << 18


class Reader(Protocol):
    """An opened log. What it is stands in `origin` at once; its samples come in blocks, in time order.

    A block's notices are those found while reading it; stamps strictly increase within and across blocks.
    Memory is bounded by the block's size wherever the format allows it.
    """

    @property
    def origin(self) -> Origin: ...

    def blocks(self, rows: int = BLOCK_ROWS) -> Iterator[Log]:
        """Yield the log in blocks of at most `rows` samples. Raises `LogError` for what cannot be read."""
        ...
