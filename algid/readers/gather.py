"""A whole log out of its blocks: each block is copied once, into arrays of the final size."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.log import Log

ROWS = 1 << 16
"""Rows a block: small enough to stay in a core's cache between decoding and copying."""
_MOST_AT_ONCE = 1 << 26
"""Rows to reserve on a file's word alone."""


class _Growing:
    """An array that grows along its last axis. Reserved memory costs nothing until it is written."""

    def __init__(self, like: NDArray[Any], rows: int) -> None:
        self._array = np.empty((*like.shape[:-1], max(1, rows)), like.dtype)
        self._used = 0

    def append(self, values: NDArray[Any]) -> None:
        end = self._used + values.shape[-1]
        if end > self._array.shape[-1]:
            grown = np.empty((*self._array.shape[:-1], max(end, 2 * self._array.shape[-1])), self._array.dtype)
            grown[..., : self._used] = self._array[..., : self._used]
            self._array = grown
        self._array[..., self._used : end] = values
        self._used = end

    def whole(self) -> NDArray[Any]:
        return self._array[..., : self._used]


def whole_log(blocks: Iterator[Log], rows: int) -> Log:
    """One log out of the blocks of a reader.

    Parameters
    ----------
    blocks : iterator of Log, one at least
    rows : int
        How many samples to expect; 0 where nobody knows. A wrong number costs time, nothing else.
    """
    first = next(blocks)
    rows = min(rows, _MOST_AT_ONCE) or len(first)
    parts = {
        name: _Growing(values, rows)
        for name in ("stamp_ns", "theta", "tau", "omega")
        if (values := getattr(first, name)) is not None
    }
    origin, notices = first.origin, list(first.notices)
    for name, part in parts.items():
        part.append(getattr(first, name))
    for block in blocks:
        notices += block.notices
        for name, part in parts.items():
            part.append(getattr(block, name))
    arrays = {name: part.whole() for name, part in parts.items()}
    return Log(**arrays, origin=origin, notices=tuple(notices))
