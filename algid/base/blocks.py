"""Blocks of columns: arrays of one length by their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def rows_of(
    block: Mapping[str, NDArray[Any]], rows: slice | NDArray[Any]
) -> dict[str, NDArray[Any]]:
    """Some rows of each column: a slice of them, by their places, or by a mask."""
    return {name: column[rows] for name, column in block.items()}


def concatenated(blocks: Sequence[Mapping[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """One block out of several with the same columns, in their order."""
    joined = {}
    for name in blocks[0]:
        joined[name] = np.concatenate([block[name] for block in blocks])
    return joined


def stacked(block: Mapping[str, NDArray[Any]], names: Iterable[str], axis: int = 0) -> NDArray[Any]:
    """Some columns (N,) as the rows of a matrix, or along another `axis`."""
    return np.stack([block[name] for name in names], axis)
