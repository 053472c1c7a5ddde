"""The framing of an MCAP file: records with operation code and length, read by their offsets.

The content of the small records is parsed by the `mcap` package; what it raises on damaged bytes
is turned into `DamagedError` here and nowhere else. Chunks are unpacked with a bound on what they
claim, and always checked against their CRC. By hand, since the package's readers parse every
record on the way.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from algid.limits import LIMITS
from algid.readers.opened import OpenedFile
from algid.words import counted

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, DATA_END = 0x0B, 0x0C, 0x0D, 0x0F
FRAME = struct.Struct("<BQ")
_FOOTER_SIZE = 9 + 20 + 8
_WINDOW = 1 << 20
_PIECE = 1 << 20
PEEK = FRAME.size + 80
"""Bytes that tell a record's kind: its frame, and the head of a chunk."""
_SMALL = LIMITS.record_bytes
_CHUNK = LIMITS.chunk_bytes
SIZES = {
    HEADER: (8, _SMALL), FOOTER: (20, 20), SCHEMA: (14, _SMALL), CHANNEL: (16, _SMALL),
    MESSAGE: (22, _CHUNK), CHUNK: (40, _CHUNK), MESSAGE_INDEX: (6, _CHUNK),
    CHUNK_INDEX: (60, _SMALL), 0x09: (36, 1 << 62), 0x0A: (52, _SMALL), STATISTICS: (46, _SMALL),
    METADATA: (8, 1 << 62), METADATA_INDEX: (20, _SMALL), 0x0E: (17, 17), DATA_END: (4, 4),
}  # fmt: skip
"""By operation code the least and the largest length that a record has."""


class DamagedError(Exception):
    """Bytes that are not what the format says; the reader decides what can still be had."""


class BrokenOffError(DamagedError):
    """A record that reaches past the end.

    `record` is what its head says, None where even that breaks off.
    """

    def __init__(self, start: int, record: Record | None = None) -> None:
        super().__init__(f"a record at byte {start} breaks off")
        self.place, self.record = start, record


class BrokenError(DamagedError):
    """Bytes at `place` that are no record."""

    def __init__(self, place: int) -> None:
        super().__init__(f"what stands at byte {place} is no record")
        self.place = place


class File(OpenedFile):
    """An opened file, which counts what its chunks claim and how much work it makes."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, DamagedError)
        self._unpacked = self._work = 0

    def unpacks(self, size: int) -> None:
        """Count bytes that a chunk claims to unpack to.

        Raises
        ------
        DamagedError
            Where no honest file of this size claims so much.
        """
        self._unpacked += size
        if self._unpacked > LIMITS.free_unpacked_bytes + LIMITS.unpacked_a_byte * self.size:
            raise DamagedError(
                f"the chunks of a file of {counted(self.size, 'byte')} claim "
                f"{counted(self._unpacked, 'byte')} so far"
            )

    def works(self, steps: int) -> bool:
        """Count steps of some microsecond each.

        False where no honest file of this size asks for so many.
        """
        self._work += steps
        return self._work <= LIMITS.free_work + LIMITS.work_a_byte * self.size


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
    """The records between two offsets of the file, in order.

    Neighbours are read a window at a time where they are messages, and by their heads alone where
    they are chunks.

    Raises
    ------
    BrokenOffError
        Where a record reaches past the end.
    BrokenError
        Where what follows is no record.
    """
    window, base, last = b"", start, 0
    while start < end:
        if start + FRAME.size > end:
            raise BrokenOffError(start)
        if not base <= start <= base + len(window) - min(PEEK, end - start):
            window, base = (
                file.read(start, min(_WINDOW if last == MESSAGE else PEEK, end - start)),
                start,
            )
        code, length = FRAME.unpack_from(window, start - base)
        record = Record(code, start + FRAME.size, length)
        if not sound(record, window, start - base):
            raise BrokenError(start)
        if record.end > end:
            raise BrokenOffError(start, record)
        yield record
        start, last = record.end, code


def sound(record: Record, content: bytes | memoryview, place: int) -> bool:
    """Whether a record's length, and the lengths within, are what its code asks for.

    Its bytes start at `place`.
    """
    least, most = SIZES.get(record.code, (0, 1 << 62 if record.code >= 0x80 else -1))
    if not least <= record.length <= most:
        return False
    start = place + FRAME.size
    if record.code == MESSAGE_INDEX and start + 6 <= len(content):
        return bool(
            struct.unpack_from("<I", content, start + 2)[0] == record.length - 6
            and record.length % 16 == 6
        )
    if record.code == CHUNK and start + 40 <= len(content):
        (name,) = struct.unpack_from("<I", content, start + 28)
        if name > 32 or start + 40 + name > len(content):
            return False
        return bool(
            struct.unpack_from("<Q", content, start + 32 + name)[0] == record.length - 40 - name
        )
    return True


def walk_bytes(content: bytes | memoryview, start: int, end: int) -> Iterator[Record]:
    """The records within unpacked bytes; `BrokenOffError` where one reaches past `end`."""
    unpack, others = FRAME.unpack_from, 0
    while start < end:
        if start + FRAME.size > end:
            raise BrokenOffError(start)
        code, length = unpack(content, start)
        if start + FRAME.size + length > end:
            raise BrokenOffError(start, Record(code, start + FRAME.size, length))
        others += code != MESSAGE
        if others > LIMITS.other_records:
            raise DamagedError(f"more than {LIMITS.other_records} records that are no messages")
        yield Record(code, start + FRAME.size, length)
        start += FRAME.size + length


def summary(file: File) -> tuple[int, bytes]:
    """Where the summary starts, and its bytes, none where the footer names no summary.

    Its checksum is verified.

    Raises
    ------
    DamagedError
        If the file has no end, or its footer or summary is damaged.
    """
    tail = file.read(max(0, file.size - _FOOTER_SIZE), min(_FOOTER_SIZE, file.size))
    if len(tail) < _FOOTER_SIZE or tail[-8:] != MAGIC:
        raise DamagedError("the file has no end: it was cut off")
    code, length, start, _, crc = struct.unpack("<BQQQI", tail[:-8])
    end = file.size - _FOOTER_SIZE
    if code != FOOTER or length != 20:
        raise DamagedError("its footer is damaged")
    if start == 0:
        return 0, b""
    if not 8 <= start <= end or end - start > LIMITS.summary_bytes:
        raise DamagedError(f"its footer claims a summary at byte {start}")
    content = file.read(start, end - start)
    if crc and zlib.crc32(tail[:25], zlib.crc32(content)) != crc:
        raise DamagedError("its checksum is wrong")
    return start, content


def parse(kind: Any, content: bytes) -> Any:
    """A small record's content as the `mcap` package's record class `kind`."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError

    try:
        return kind.read(ReadDataStream(io.BytesIO(content)))
    except (
        McapError,
        struct.error,
        ValueError,
        KeyError,
        EOFError,
        OverflowError,
        MemoryError,
    ) as error:
        raise DamagedError(f"a {kind.__name__} record cannot be read ({error})") from error


class ChunkIndex(NamedTuple):
    """A chunk's place by the summary, and the places of its message indexes by channel."""

    chunk_start_offset: int
    chunk_length: int
    message_index_offsets: dict[int, int]
    message_index_length: int


_INDEX_HEAD = struct.Struct("<QQQQI")
_INDEX_PAIR = struct.Struct("<HQ")


def chunk_index(content: bytes) -> ChunkIndex:
    """A chunk index record's content; by hand, since a file may hold a hundred thousand of them.

    Raises
    ------
    DamagedError
        If it breaks off.
    """
    try:
        _, _, start, length, size = _INDEX_HEAD.unpack_from(content)
        end = _INDEX_HEAD.size + size
        (indexes,) = struct.unpack_from("<Q", content, end)
        return ChunkIndex(
            start, length, dict(_INDEX_PAIR.iter_unpack(content[_INDEX_HEAD.size : end])), indexes
        )
    except struct.error as error:
        raise DamagedError(f"a ChunkIndex record cannot be read ({error})") from error


def claimed(content: bytes | memoryview) -> int:
    """The bytes that a chunk record claims to unpack to.

    Raises
    ------
    DamagedError
        If they are more than `FileLimits.chunk_bytes`.
    """
    if len(content) < 40:
        raise DamagedError("a chunk breaks off")
    (size,) = struct.unpack_from("<Q", content, 16)
    if size > LIMITS.chunk_bytes:
        raise DamagedError(
            f"a chunk claims {counted(size, 'byte')} unpacked, more than {LIMITS.chunk_bytes}"
        )
    return int(size)


def unpack(content: bytes | memoryview, *, torn: bool = False) -> bytes:
    """The records within a chunk record's content.

    Of a `torn` one that breaks off the whole records at its start.

    Those of a torn chunk can be checked only where all are there: its CRC covers all of it.

    Raises
    ------
    DamagedError
        If the chunk is larger than `FileLimits.chunk_bytes`, packed in an unknown way, or not what
        its CRC says.
    """
    size = claimed(content)
    crc, name_length = struct.unpack_from("<II", content, 24)
    if name_length > 32 or 40 + name_length > len(content):
        raise DamagedError("a chunk's compression has no name")
    (packed_size,) = struct.unpack_from("<Q", content, 32 + name_length)
    packed = memoryview(content)[40 + name_length :]
    if not torn and packed_size != len(packed):
        raise DamagedError(f"a chunk claims {counted(packed_size, 'byte')} and has {len(packed)}")
    unpacked = _decompressed(
        bytes(content[32 : 32 + name_length]), packed[:packed_size], size, torn
    )
    if len(unpacked) != size and not torn:
        raise DamagedError(f"a chunk of {counted(size, 'byte')} unpacks to {len(unpacked)}")
    if len(unpacked) == size and crc and zlib.crc32(unpacked) != crc:
        raise DamagedError("a chunk's checksum is wrong")
    if not torn:
        return unpacked
    end = 0
    with suppress(BrokenOffError):
        for record in walk_bytes(unpacked, 0, len(unpacked)):
            end = record.end
    return unpacked[:end]


def has_checksum(content: bytes) -> bool:
    """Whether a chunk record's content carries a CRC."""
    return len(content) >= 28 and content[24:28] != b"\0\0\0\0"


def _decompressed(name: bytes, packed: memoryview, size: int, torn: bool) -> bytes:
    """What is packed by the method `name`, in memory bounded by the `size` claimed.

    A torn one is unpacked as far as it goes.

    Raises
    ------
    DamagedError
        Where the method is unknown or the bytes cannot be unpacked.
    """
    if name == b"":
        return bytes(packed[:size] if torn else packed)
    if name not in (b"zstd", b"lz4"):
        raise DamagedError(
            f"a chunk is packed with {name.decode(errors='replace')!r}; expected zstd, lz4 or "
            "nothing"
        )
    import lz4.frame
    import zstandard

    try:
        if name == b"lz4":  # this one goes as far as it can anyway
            content = bytes(
                lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
            )
            return content[:size] if torn else content
        if torn:
            unpacked = bytearray()
            stream = zstandard.ZstdDecompressor().stream_reader(packed)
            while piece := stream.read(min(_PIECE, size - len(unpacked))):
                unpacked += piece
            return bytes(unpacked)
        # the frame's own claim is what the library would allocate
        frame_size = zstandard.frame_content_size(packed) if size else -1
        if frame_size > size:
            raise DamagedError(
                f"a chunk of {counted(size, 'byte')} holds a zstd frame of {frame_size}"
            )
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size or 1)
    except (zstandard.ZstdError, RuntimeError, EOFError, ValueError) as error:
        raise DamagedError(f"a chunk cannot be unpacked ({error})") from error
