"""Chunks: unpacked with a bound on what they claim, and always checked against their CRC."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from algid.readers.mcap.framing import BrokenOffError, DamagedError, walk_bytes

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
