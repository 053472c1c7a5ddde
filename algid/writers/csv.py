"""CSV logs: canonical columns, every float exact, the truth in ``LOG.csv.truth.json``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from algid.base.files import whole_file
from algid.log import Companion, Log, Truth
from algid.writers import columns

_EXACT_SECONDS_NS = 1 << 53
"""Stamps below 104 days survive as float64 seconds: half a unit in the last place is < 0.5 ns."""


def write(
    path: Path, blocks: Iterable[Log], *, truth: Truth | None = None, force: bool = True
) -> None:
    """Write the blocks of a log: t in s, angles, torques, velocities where recorded.

    Stamps too far from zero for float64 seconds get a column ``stamp_ns`` as well. The sidecar is
    written only with a truth.

    Raises
    ------
    OutputError
        If the file cannot be written there, or exists and `force` is not set.
    """
    import polars as pl

    sums: dict[str, int] = {}
    with whole_file(path, force=force) as temporary:
        stamped = None
        with temporary.open("wb") as stream:
            for block in blocks:
                first = stamped is None
                if stamped is None:
                    whole = block.stamp_ns[0] >= 0 and block.stamp_ns[-1] < _EXACT_SECONDS_NS
                    stamped = not whole
                by_name = columns(block, sums)
                if not stamped:
                    del by_name["stamp_ns"], sums["stamp_ns"]
                pl.DataFrame(by_name).write_csv(stream, include_header=first)
    beside = path.with_name(path.name + ".truth.json")
    if truth is None:
        # what an older file of this name left there is not this log's truth
        beside.unlink(missing_ok=True)
        return
    with whole_file(beside) as temporary:
        temporary.write_text(Companion(truth, sums).dumps() + "\n", encoding="utf-8")
