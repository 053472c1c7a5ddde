"""Walk a file from its start: after a broken record, the next whole one is searched for.

A place is taken for a record where its code and length fit, a chunk's head agrees with its length,
and the same holds for the records that follow, as far as these are looked at.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.limits import LIMITS
from algid.readers.mcap import framing
from algid.readers.mcap.framing import (
    FRAME,
    MAGIC,
    PEEK,
    BrokenError,
    BrokenOffError,
    DamagedError,
    File,
    Record,
    sound,
)

_WINDOW = 1 << 20
_FOLLOWERS = 3
"""Records in a row that are looked at before a place is believed to be one."""
_OUTER = (framing.CHUNK, framing.MESSAGE_INDEX, framing.DATA_END)
"""What cannot stand within a chunk."""
_ANY = (*_OUTER, framing.SCHEMA, framing.CHANNEL, framing.MESSAGE, framing.METADATA)
_SIZES = np.array([framing.SIZES.get(code, (1, 0)) for code in range(256)], np.uint64)
_LEAST, _MOST = np.ascontiguousarray(_SIZES.T)


@dataclass(frozen=True)
class Gap:
    """Bytes [start, end) that are no records.

    `torn` is the chunk that they begin with where it claims to go on.
    """

    start: int
    end: int
    torn: Record | None = None


def salvaged(file: File, start: int) -> Iterator[Record | Gap]:
    """The records from an offset on to the end of the file, with the gaps between them.

    Raises
    ------
    DamagedError
        If the file is made of more small records than any recorder writes.
    """
    tried = others = 0
    while start < file.size:
        if start == file.size - len(MAGIC) and file.read(start, len(MAGIC)) == MAGIC:
            return
        try:
            for record in framing.walk(file, start, file.size):
                start = record.end
                others += record.code not in (framing.MESSAGE, framing.CHUNK, framing.MESSAGE_INDEX)
                if others > LIMITS.file_records:
                    raise DamagedError(
                        f"more than {LIMITS.file_records} records that are neither messages nor "
                        "chunks"
                    )
                yield record
                if record.code == framing.FOOTER:
                    break
        except (BrokenError, BrokenOffError) as error:
            last = error.record if isinstance(error, BrokenOffError) else None
            torn = last if last and last.code == framing.CHUNK else None
            start, tried = _next(file, error.place + 1, tried, _OUTER if torn else _ANY)
            yield Gap(error.place, start, torn)


def _next(file: File, start: int, tried: int, among: Collection[int]) -> tuple[int, int]:
    """Where the next record stands that has one of the codes `among`, else the end.

    And the places tried so far.
    """
    for base in range(start, file.size - FRAME.size + 1, _WINDOW):
        octets = np.frombuffer(file.read(base, min(_WINDOW + 8, file.size - base)), np.uint8)
        codes = octets[:-8]
        lengths: NDArray[np.uint64] = np.ndarray(codes.size, np.dtype("<u8"), octets.data, 1, (1,))
        room = np.arange(
            file.size - base - FRAME.size, file.size - base - FRAME.size - codes.size, -1
        )
        fits = (lengths >= _LEAST[codes]) & (
            lengths <= np.minimum(_MOST[codes], room.astype(np.uint64))
        )
        for place in np.flatnonzero(fits).tolist():
            if int(codes[place]) not in among:
                continue
            if tried >= LIMITS.salvage_places:
                return file.size, tried
            tried += 1
            if _is_record(file, base + place, among):
                return base + place, tried
    return file.size, tried


def _is_record(file: File, place: int, among: Collection[int]) -> bool:
    """Whether adjacent records follow from `place` on, without those that `among` leaves out."""
    refused = set(_ANY) - set(among)
    for _ in range(_FOLLOWERS):
        left = file.size - place
        if left == 0 or (left == len(MAGIC) and file.read(place, left) == MAGIC):
            return True
        if left < FRAME.size:
            return False
        head = file.read(place, min(PEEK, left))
        code, length = FRAME.unpack_from(head)
        record = Record(code, place + FRAME.size, length)
        if code in refused or code >= 0x80 or record.end > file.size or not sound(record, head, 0):
            return False
        if code == framing.DATA_END:
            return True
        place = record.end
    return True
