"""An object of which some parts are had: a sparse file of its size that holds them at their own places.

Readers of files read it as they read the whole. What was not fetched are zeros, which no MCAP or Parquet
reader takes for data.
"""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any

from algid.readers.mcap.framing import DamagedError, File

Range = tuple[int, int]
"""First byte, and the one behind the last."""

GAP = 1 << 16
"""Bytes between two ranges that are fetched along, to save a request."""
_PIECE = 1 << 23
_REQUESTS = 8


class UnforeseenError(Exception):
    """A reader asks for bytes that were not fetched."""


@dataclass
class Partial(File):
    """The sparse file under construction; also what `algid.readers.mcap` reads while planning.

    Parameters
    ----------
    path : Path
        Of the sparse file.
    source : pyarrow's random access file of the object
    on_demand : bool
        Fetch what is read and not there, instead of raising `UnforeseenError`.
    """

    source: Any = None
    on_demand: bool = False
    _held: list[Range] = field(default_factory=list)

    def __enter__(self) -> Partial:
        self._handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
        self.size = self.source.size()
        os.ftruncate(self._handle, self.size)
        return self

    def fetch(self, ranges: Iterable[Range]) -> None:
        """Fetch ranges, neighbours in one request, several requests at a time.

        Raises
        ------
        DamagedError
            If a range lies outside the object.
        OSError
            If the object cannot be read.
        """
        wanted = merged(ranges)
        if wanted and not 0 <= wanted[0][0] <= wanted[-1][1] <= self.size:
            raise DamagedError(f"bytes {wanted[0][0]} to {wanted[-1][1]} of an object of {self.size}")
        wanted = merged(without(wanted, self._held), GAP)
        with ThreadPoolExecutor(_REQUESTS, thread_name_prefix="algid-fetch") as pool:
            for _ in pool.map(self._copy, list(_pieces(wanted))):
                pass
        self._held = merged([*self._held, *wanted])

    def read(self, start: int, length: int) -> bytes:
        """The bytes at `start`. Raises `DamagedError` where the object ends before."""
        place = (start, start + length)
        if 0 <= start <= place[1] <= self.size and any(without([place], self._held)):
            if not self.on_demand:
                raise UnforeseenError(f"bytes {start} to {place[1]}")
            self.fetch([place])
        return super().read(start, length)

    def _copy(self, place: Range) -> None:
        start, end = place
        content = self.source.read_at(end - start, start)
        if len(content) != end - start:
            raise OSError(f"bytes {start} to {end} are gone: it was changed meanwhile")
        view = memoryview(content)
        while view:
            written = os.pwrite(self._handle, view, start)
            view, start = view[written:], start + written


def merged(ranges: Iterable[Range], gap: int = 0) -> list[Range]:
    """Ranges in order, those made one that lie at most `gap` bytes apart."""
    found: list[Range] = []
    for start, end in sorted(ranges):
        if found and start <= found[-1][1] + gap:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((start, end))
    return found


def without(ranges: Iterable[Range], held: Sequence[Range]) -> Iterator[Range]:
    """What of `ranges` does not lie in any of the `held` ones, which are in order and apart."""
    for start, end in ranges:
        place = start
        for first, last in held[max(0, bisect_right(held, start, key=itemgetter(0)) - 1) :]:
            if first >= end:
                break
            if first > place:
                yield place, first
            place = max(place, last)
        if place < end:
            yield place, end


def _pieces(ranges: Iterable[Range]) -> Iterator[Range]:
    """The same bytes in pieces that fit into memory side by side."""
    for start, end in ranges:
        for place in range(start, end, _PIECE):
            yield place, min(place + _PIECE, end)
