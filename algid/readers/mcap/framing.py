"""The frame of an MCAP file: records, each with an operation code and a length, read by their offsets.

The content of the small records is parsed by the `mcap` package; what it raises on damaged bytes is
turned into `DamagedError` here and nowhere else.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

from algid.errors import LogError

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, DATA_END = 0x0B, 0x0C, 0x0F
FRAME = struct.Struct("<BQ")
SMALL_RECORD = 1 << 24
_WINDOW = 1 << 20


class DamagedError(Exception):
    """Bytes that are not what the format says; the reader decides what can still be had."""


class BrokenOffError(DamagedError):
    """A record that reaches past the end; `record` is what its head says, None where even that breaks off."""

    def __init__(self, start: int, record: Record | None = None) -> None:
        super().__init__(f"a record at byte {start} breaks off")
        self.record = record


@dataclass
class File:
    """An opened file, read by offset; counts the bytes it read."""

    path: Path
    size: int = 0
    read_bytes: int = 0
    _handle: int = field(default=-1, repr=False)

    def __enter__(self) -> File:
        try:
            self._handle = os.open(self.path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise LogError(f"{self.path}: the log cannot be read ({error.strerror})") from error
        self.size = os.fstat(self._handle).st_size
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._handle)

    def read(self, start: int, length: int) -> bytes:
        """The bytes at `start`, or `DamagedError` where the file ends before."""
        if start < 0 or length < 0 or start + length > self.size:
            raise DamagedError(f"bytes {start} to {start + length} of a file of {self.size}")
        self.read_bytes += length
        found = os.pread(self._handle, length, start)
        if len(found) != length:
            raise DamagedError(f"bytes {start} to {start + length} cannot be read")
        return found


@dataclass(frozen=True)
class Record:
    """One record: its code, where its content starts, and how long that is."""

    code: int
    start: int
    length: int

    @property
    def end(self) -> int:
        """Where the next record starts."""
        return self.start + self.length


def walk(file: File, start: int, end: int) -> Iterator[Record]:
    """The records between two offsets of the file, in order; `BrokenOffError` where one breaks off.

    Neighbours are read a window at a time where they are messages, and by their frames alone where they
    are chunks.
    """
    window, base, last = b"", start, 0
    while start < end:
        if start + FRAME.size > end:
            raise BrokenOffError(start)
        if not base <= start <= base + len(window) - FRAME.size:
            width = min(_WINDOW, end - start) if last == MESSAGE else FRAME.size
            window, base = file.read(start, width), start
        code, length = FRAME.unpack_from(window, start - base)
        record = Record(code, start + FRAME.size, length)
        if record.end > end:
            raise BrokenOffError(start, record)
        yield record
        start, last = record.end, code


def walk_bytes(content: bytes | memoryview, start: int, end: int) -> Iterator[Record]:
    """The records within unpacked bytes; `BrokenOffError` where one reaches past `end`."""
    while start < end:
        if start + FRAME.size > end:
            raise BrokenOffError(start)
        code, length = FRAME.unpack_from(content, start)
        record = Record(code, start + FRAME.size, length)
        if record.end > end:
            raise BrokenOffError(start, record)
        yield record
        start = record.end


def parse(kind: Any, content: bytes) -> Any:
    """A small record's content as the `mcap` package's record class `kind`."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError

    try:
        return kind.read(ReadDataStream(io.BytesIO(content)))
    except (McapError, struct.error, ValueError, KeyError, EOFError, OverflowError, MemoryError) as error:
        raise DamagedError(f"a {kind.__name__} record cannot be read ({error})") from error
