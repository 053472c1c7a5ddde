"""The frame of an MCAP file: records, each with an operation code and a length, read by their offsets.

The content of the small records is parsed by the `mcap` package; what it raises on damaged bytes is
turned into `DamagedError` here and nowhere else.

Chunks: unpacked with a bound on what they claim, and always checked against their CRC.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
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


LARGEST_CHUNK = 1 << 28
"""A recorder closes a chunk at some MiB; beyond 256 MiB it is a mistake or an attack."""
_PIECE = 1 << 20


@dataclass(frozen=True)
class _Chunk:
    """A chunk record's head and what is there of its packed records."""

    size: int
    crc: int
    compression: bytes
    packed_size: int
    packed: memoryview


def _chunk(content: bytes) -> _Chunk:
    if len(content) < 40:
        raise DamagedError("a chunk breaks off")
    _, _, size, crc, name_length = struct.unpack_from("<QQQII", content)
    if name_length > 32 or 32 + name_length + 8 > len(content):
        raise DamagedError("a chunk's compression has no name")
    name = content[32 : 32 + name_length]
    (packed_size,) = struct.unpack_from("<Q", content, 32 + name_length)
    if size > LARGEST_CHUNK:
        raise DamagedError(f"a chunk claims {size} bytes unpacked, more than {LARGEST_CHUNK}")
    return _Chunk(size, crc, name, packed_size, memoryview(content)[40 + name_length :])


def unpack(content: bytes) -> bytes:
    """The records within a chunk record's content.

    Raises
    ------
    DamagedError
        If the chunk is larger than `LARGEST_CHUNK`, packed in an unknown way, or not what its CRC says.
    """
    chunk = _chunk(content)
    if chunk.packed_size != len(chunk.packed):
        raise DamagedError(f"a chunk claims {chunk.packed_size} bytes and has {len(chunk.packed)}")
    unpacked = _unpacked(chunk.compression, chunk.packed, chunk.size)
    if len(unpacked) != chunk.size:
        raise DamagedError(f"a chunk of {chunk.size} bytes unpacks to {len(unpacked)}")
    _check_sum(chunk, unpacked)
    return unpacked


def _check_sum(chunk: _Chunk, unpacked: bytes) -> None:
    if chunk.crc and zlib.crc32(unpacked) != chunk.crc:
        raise DamagedError("a chunk's checksum is wrong")


def unpack_torn(content: bytes) -> tuple[bytes, int]:
    """The whole records at the start of a chunk that breaks off, and the size that all of them would have.

    They can be checked only where all are there: the chunk's CRC covers all of it.

    Raises
    ------
    DamagedError
        As `unpack`.
    """
    chunk = _chunk(content)
    unpacked = _start(chunk.compression, chunk.packed[: chunk.packed_size], chunk.size)
    if len(unpacked) == chunk.size:
        _check_sum(chunk, unpacked)
    end = 0
    try:
        for record in walk_bytes(unpacked, 0, len(unpacked)):
            end = record.end
    except BrokenOffError:
        pass
    return unpacked[:end], chunk.size


def has_checksum(content: bytes) -> bool:
    """Whether a chunk record's content carries a CRC."""
    return len(content) >= 28 and content[24:28] != b"\0\0\0\0"


def _unpacked(name: bytes, packed: memoryview, size: int) -> bytes:
    if name == b"":
        return bytes(packed)
    if name == b"zstd":
        return _zstd(packed, size)
    if name == b"lz4":
        return _lz4(packed, size)
    raise _unknown(name)


def _start(name: bytes, packed: memoryview, size: int) -> bytes:
    """As `_unpacked`, but as far as it goes, at most `size` bytes."""
    if name == b"":
        return bytes(packed[:size])
    if name == b"zstd":
        return _zstd_start(packed, size)
    if name == b"lz4":
        return _lz4(packed, size)[:size]  # this one goes as far as it can anyway
    raise _unknown(name)


def _unknown(name: bytes) -> DamagedError:
    return DamagedError(f"a chunk is packed with {name.decode(errors='replace')!r}; expected zstd, lz4 or nothing")


def _zstd(packed: memoryview, size: int) -> bytes:
    import zstandard

    try:
        # the frame's own claim is what the library would allocate
        claimed = zstandard.frame_content_size(packed) if size else -1
        if claimed > size:
            raise DamagedError(f"a chunk of {size} bytes holds a zstd frame of {claimed}")
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size or 1)
    except zstandard.ZstdError as error:
        raise DamagedError(f"a chunk cannot be unpacked ({error})") from error


def _zstd_start(packed: memoryview, size: int) -> bytes:
    import zstandard

    unpacked = bytearray()
    try:
        stream = zstandard.ZstdDecompressor().stream_reader(packed)
        while piece := stream.read(min(_PIECE, size - len(unpacked))):
            unpacked += piece
    except zstandard.ZstdError as error:
        raise DamagedError(f"a chunk cannot be unpacked ({error})") from error
    return bytes(unpacked)


def _lz4(packed: memoryview, size: int) -> bytes:
    import lz4.frame

    try:
        unpacked = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    except (RuntimeError, EOFError, ValueError) as error:
        raise DamagedError(f"a chunk cannot be unpacked ({error})") from error
    return bytes(unpacked)
