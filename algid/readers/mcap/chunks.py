"""Chunks: unpacked with a bound on what they claim, and always checked against their CRC."""

from __future__ import annotations

import struct
import zlib

from algid.readers.mcap.framing import DamagedError

LARGEST_CHUNK = 1 << 28
"""A recorder closes a chunk at some MiB; beyond 256 MiB it is a mistake or an attack."""


def unpack(content: bytes) -> bytes:
    """The records within a chunk record's content.

    Raises
    ------
    DamagedError
        If the chunk is larger than `LARGEST_CHUNK`, packed in an unknown way, or not what its CRC says.
    """
    if len(content) < 40:
        raise DamagedError("a chunk breaks off")
    _, _, size, crc, name_length = struct.unpack_from("<QQQII", content)
    if name_length > 32 or 32 + name_length + 8 > len(content):
        raise DamagedError("a chunk's compression has no name")
    name = content[32 : 32 + name_length]
    (packed_size,) = struct.unpack_from("<Q", content, 32 + name_length)
    packed = memoryview(content)[40 + name_length :]
    if packed_size != len(packed):
        raise DamagedError(f"a chunk claims {packed_size} bytes and has {len(packed)}")
    if size > LARGEST_CHUNK:
        raise DamagedError(f"a chunk claims {size} bytes unpacked, more than {LARGEST_CHUNK}")
    unpacked = _unpacked(name, packed, size)
    if len(unpacked) != size:
        raise DamagedError(f"a chunk of {size} bytes unpacks to {len(unpacked)}")
    if crc and zlib.crc32(unpacked) != crc:
        raise DamagedError("a chunk's checksum is wrong")
    return unpacked


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
    raise DamagedError(f"a chunk is packed with {name.decode(errors='replace')!r}; expected zstd, lz4 or nothing")


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


def _lz4(packed: memoryview, size: int) -> bytes:
    import lz4.frame

    try:
        unpacked = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    except (RuntimeError, EOFError, ValueError) as error:
        raise DamagedError(f"a chunk cannot be unpacked ({error})") from error
    return bytes(unpacked)
