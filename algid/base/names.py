"""Names and other items in their order: which are there, some of them, what stands under them.

A block is of columns: arrays of one length by their names.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from math import ceil
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray

Item = TypeVar("Item")


class Named(Protocol):
    """What has a name."""

    @property
    def name(self) -> str:
        """Its name."""
        ...


OneNamed = TypeVar("OneNamed", bound=Named)


def names_in(items: Iterable[Named]) -> tuple[str, ...]:
    """The names of what has one, in order."""
    return tuple(one.name for one in items)


def by_name(items: Iterable[OneNamed]) -> dict[str, OneNamed]:
    """What has a name, by it, in order."""
    return {one.name: one for one in items}


def within(items: Iterable[Item], kept: Container[Item]) -> tuple[Item, ...]:
    """Those of the items that are among `kept`, in order."""
    return tuple(item for item in items if item in kept)


def outside(items: Iterable[Item], gone: Container[Item]) -> tuple[Item, ...]:
    """Those of the items that are not among `gone`, in order."""
    return tuple(item for item in items if item not in gone)


def places_outside(items: Iterable[Item], gone: Container[Item]) -> list[int]:
    """Where those of the items stand that are not among `gone`."""
    return [place for place, item in enumerate(items) if item not in gone]


def evenly_spread(items: Sequence[Item], most: int) -> Sequence[Item]:
    """At most `most` of the items, each as far from the next, the first among them."""
    return items[:: max(1, ceil(len(items) / most))]


def vector(
    names: Iterable[str], value_of: Mapping[str, float], otherwise: float | None = None
) -> FloatArray:
    """Values by name as an array (n,) in the order of the names.

    Raises
    ------
    KeyError
        If a name has no value and there is no value `otherwise`.
    """
    if otherwise is not None:
        return np.array([value_of.get(name, otherwise) for name in names], dtype=np.float64)
    return np.array([value_of[name] for name in names], dtype=np.float64)


def named_values(names: Iterable[str], values: FloatArray) -> dict[str, float]:
    """Values (n,) by name: the inverse of `vector`."""
    return dict(zip(names, values.tolist(), strict=True))


def given(**values: float | None) -> dict[str, float]:
    """Those of the values that are given, by name."""
    return {name: value for name, value in values.items() if value is not None}


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
