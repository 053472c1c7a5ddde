"""The structure of a MATLAB file of version 5 to 7, walked before SciPy reads it.

SciPy takes an element's type for a place in a table without a look, and ends the process at one
that is none.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from pathlib import Path

from algid.errors import LogError
from algid.limits import LIMITS

_HEAD = 128
_MATRIX, _PACKED = 14, 15
_TYPES = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, _MATRIX, _PACKED, 16, 17, 18})
_PIECE = 1 << 20
_HDF5 = 2
"""The major version of 7.3."""


def check_elements(path: Path) -> None:
    """Refuse a file with an element of no type, beyond its container, or larger than any log.

    Raises
    ------
    LogError
        If it is so.
    """
    try:
        with (
            path.open("rb") as stream,
            mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content,
        ):
            order = "<" if content[126:128] == b"IM" else ">"
            (version,) = struct.unpack_from(f"{order}H", content, 124)
            if version >> 8 != _HDF5:
                walk = _Walk(order)
                walk.elements(content, _HEAD, len(content), 0)
    except (struct.error, zlib.error, ValueError) as error:
        raise LogError(f"{path}: the mat file is damaged ({error}); copy it again") from error


class _Walk:
    """Goes over elements and counts them."""

    def __init__(self, order: str) -> None:
        self._tag = struct.Struct(f"{order}II")
        self._found = self._unpacked = 0

    def elements(self, content: bytearray | mmap.mmap, place: int, end: int, depth: int) -> None:
        """The elements between two bytes, and those within them."""
        while place + self._tag.size <= end:
            self._found += 1
            kind, size = self._tag.unpack_from(content, place)
            start = place + self._tag.size
            # a small element: its size stands beside its type, and its four bytes in the tag
            if kind >> 16:
                kind, size, start = kind & 0xFFFF, min(4, kind >> 16), place + 4
            if kind not in _TYPES or start + size > end:
                raise ValueError(f"what stands at byte {place} is no element")
            if depth > LIMITS.definition_depth or self._found > LIMITS.other_records:
                raise ValueError("more elements than any log's")
            if kind == _MATRIX:
                self.elements(content, start, start + size, depth + 1)
            elif kind == _PACKED:
                inside = self._inside(content, start, start + size)
                self.elements(inside, 0, len(inside), depth + 1)
            # but for packed ones, elements are padded to 8 bytes
            size += 0 if kind == _PACKED else -size % 8
            place = (
                max(place + self._tag.size, start + size)
                if start > place + 4
                else place + self._tag.size
            )

    def _inside(self, content: bytearray | mmap.mmap, start: int, end: int) -> bytearray:
        """What the packed bytes between two places hold.

        Pages of the file are let go as they are read.

        Raises
        ------
        ValueError
            Where the elements unpack to more than 1 GiB.
        """
        stream = zlib.decompressobj()
        inside = bytearray()
        for place in range(start, end, _PIECE):
            left = LIMITS.whole_bytes - self._unpacked - len(inside)
            inside += stream.decompress(content[place : min(place + _PIECE, end)], max(left, 1))
            if stream.unconsumed_tail or left <= 0:
                raise ValueError("its elements unpack to more than 1 GiB")
            if isinstance(content, mmap.mmap):
                content.madvise(mmap.MADV_DONTNEED)
        self._unpacked += len(inside)
        return inside
