"""What the writers share: a log as blocks, and a block as columns with canonical names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from numpy.typing import NDArray

from algid.log import Log, add, word_sum

_EXACT_SECONDS_NS = 1 << 53
"""Stamps below 104 days survive as float64 seconds: half a unit in the last place is < 0.5 ns."""


def as_blocks(log: Log | Iterable[Log]) -> Iterator[Log]:
    """The blocks of a log, whether it is given whole or in blocks."""
    if isinstance(log, Log):
        return iter([log])
    return iter(log)


def columns(block: Log) -> dict[str, NDArray[Any]]:
    """Columns (N,) by canonical name, ``t`` in s first and ``stamp_ns`` last."""
    by_name: dict[str, NDArray[Any]] = {"t": seconds(block)}
    pairs = [("theta", block.theta), ("tau", block.tau)]
    if block.omega is not None:
        pairs.append(("omega", block.omega))
    if block.reference is not None:
        pairs.append(("q_des", block.reference))
    for name, (first, second) in pairs:
        by_name |= {f"{name}1": first, f"{name}2": second}
    return by_name | {"stamp_ns": block.stamp_ns}


def seconds(block: Log) -> NDArray[Any]:
    """Stamps in s, correctly rounded."""
    return block.stamp_ns / 1e9


def exact_in_seconds(stamp_ns: NDArray[Any]) -> bool:
    """Whether the stamps come back to the nanosecond from float64 seconds."""
    return bool(stamp_ns[0] >= 0 and stamp_ns[-1] < _EXACT_SECONDS_NS)


def summed(totals: dict[str, int], found: dict[str, NDArray[Any]]) -> None:
    """Add the words of a block's columns to `totals`, in place."""
    for name, values in found.items():
        totals[name] = add(totals.get(name, 0), word_sum(values))
