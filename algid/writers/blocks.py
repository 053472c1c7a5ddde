"""What the writers share: a block as columns with canonical names, and their sums."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from algid.log import Log, add, word_sum


def columns(block: Log) -> dict[str, NDArray[Any]]:
    """Columns (N,) by canonical name, ``t`` in s first and ``stamp_ns`` last."""
    by_name: dict[str, NDArray[Any]] = {"t": block.stamp_ns / 1e9}
    pairs = [("theta", block.theta), ("tau", block.tau)]
    if block.omega is not None:
        pairs.append(("omega", block.omega))
    if block.reference is not None:
        pairs.append(("q_des", block.reference))
    for name, (first, second) in pairs:
        by_name |= {f"{name}1": first, f"{name}2": second}
    return by_name | {"stamp_ns": block.stamp_ns}


def summed(totals: dict[str, int], found: dict[str, NDArray[Any]]) -> None:
    """Add the words of a block's columns to `totals`, in place."""
    for name, values in found.items():
        totals[name] = add(totals.get(name, 0), word_sum(values))
