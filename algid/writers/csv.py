"""CSV logs: canonical columns, every float exact, the truth in ``LOG.csv.truth.json``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from algid.base.files import whole_file
from algid.log import Companion, Log, Truth
from algid.writers.blocks import as_blocks, columns, exact_in_seconds, summed


def write(
    path: Path, log: Log | Iterable[Log], *, truth: Truth | None = None, force: bool = True
) -> None:
    """Write a log, or the blocks of one: t in s, angles, torques, velocities where recorded.

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
            for block in as_blocks(log):
                first = stamped is None
                if stamped is None:
                    stamped = not exact_in_seconds(block.stamp_ns)
                by_name = columns(block)
                if not stamped:
                    del by_name["stamp_ns"]
                summed(sums, by_name)
                pl.DataFrame(by_name).write_csv(stream, include_header=first)
    beside = path.with_name(path.name + ".truth.json")
    if truth is None:
        # what an older file of this name left there is not this log's truth
        beside.unlink(missing_ok=True)
        return
    with whole_file(beside) as temporary:
        temporary.write_text(Companion(truth, sums).dumps() + "\n", encoding="utf-8")
