"""Structure-aware hostile logs: files that are well formed down to the place where they lie.

Each comes with the log that a reader must find in it unless it says otherwise, or with none where
any answer is right that is one: the file then is a sound one with another content, or holds no log
at all.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from algid.log import Log

FINE = {"same", "told", "read", "refused", "done", "library", "stopped"}
"""Ends of a case that are good; any other is a finding."""


@dataclass(frozen=True)
class Hostile:
    """A hostile file: its suffix and bytes, how it was made, and the log in it (None:
    see above).
    """

    suffix: str
    content: bytes
    kind: str
    log: Log | None


def hostile(seed: int) -> Hostile:
    """One hostile file, the same for the same seed."""
    from pipelines.hostile import records, schemas, tables

    draw = random.Random(seed)
    makers: tuple[Callable[[random.Random], Hostile], ...] = (
        *(records.lying, records.lying, records.lying, schemas.beside, schemas.alone),
        *(tables.parquet, tables.csv),
    )
    return draw.choice(makers)(draw)


def corpus(folder: Path, files: int, seed: int = 1) -> Iterator[tuple[Path, Hostile]]:
    """Write so many hostile files into a folder, one at a time."""
    for number in range(seed, seed + files):
        one = hostile(number)
        path = folder / f"{number:06d}-{one.kind}{one.suffix}"
        path.write_bytes(one.content)
        yield path, one
