"""What the messages of an Arrow file (Feather) claim, known before any library unpacks them.

pyarrow reserves what a packed buffer says that it holds, and has no way to ask beforehand. A
message is a flatbuffer behind its length, and its body behind that (Arrow's columnar format,
"Encapsulated message format"); a packed buffer begins with the bytes that it unpacks to.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from algid.errors import LogError
from algid.limits import LIMITS
from algid.words import counted

MAGIC = b"ARROW1"
_CONTINUED = 0xFFFFFFFF
_DICTIONARIES, _BATCHES = 2, 3
"""Fields of the footer: where those messages stand."""
_BLOCK = struct.Struct("<qi4xq")
_NODE = _BUFFER = struct.Struct("<qq")


def claims(path: Path) -> int:
    """Rows of an Arrow file, once its messages claim no more than a log's.

    Raises
    ------
    LogError
        If the file is cut off, or they claim more than any log's of this size.
    """
    try:
        with path.open("rb") as stream:
            return _rows(stream, stream.seek(0, 2))
    except (struct.error, ValueError) as error:
        raise LogError(
            f"{path}: the feather file is damaged, or larger than any log ({error}); copy it "
            "again, or write it "
            "anew as Parquet"
        ) from error


def _rows(stream: BinaryIO, size: int) -> int:
    rows = unpacked = buffers = 0
    footer = _footer(stream, size)
    blocks = {kind: footer.vector(kind, _BLOCK) for kind in (_DICTIONARIES, _BATCHES)}
    if sum(map(len, blocks.values())) > LIMITS.spans:
        raise ValueError(f"more than {LIMITS.spans} messages")
    most = LIMITS.free_text_bytes + LIMITS.text_a_byte * size
    for kind, places in blocks.items():
        for place in places:
            message = _message(stream, size, kind, place)
            rows += message.rows if kind == _BATCHES else 0
            buffers += message.buffers
            unpacked += message.unpacked
            if (
                message.unpacked > LIMITS.whole_bytes
                or unpacked > most
                or buffers > LIMITS.message_indexes
            ):
                raise ValueError(
                    f"it claims {counted(unpacked, 'byte')} in {counted(buffers, 'buffer')}"
                )
    return rows


def _footer(stream: BinaryIO, size: int) -> _Table:
    stream.seek(max(0, size - 10))
    tail = stream.read(10)
    if tail[4:] != MAGIC:
        raise ValueError("it is cut off: its footer is missing")
    length = int.from_bytes(tail[:4], "little")
    if length > min(LIMITS.record_bytes, size - 10):
        raise ValueError(f"it claims a footer of {counted(length, 'byte')}")
    stream.seek(size - 10 - length)
    footer = stream.read(length)
    return _Table(footer, struct.unpack_from("<I", footer)[0])


@dataclass(frozen=True)
class _Message:
    rows: int
    buffers: int
    unpacked: int


def _message(stream: BinaryIO, size: int, kind: int, block: tuple[int, ...]) -> _Message:
    """Claims of the message in a block: its offset, and the lengths of its head and its body."""
    place, length, body = block
    if not (
        place > 0
        and 8 <= length <= LIMITS.record_bytes
        and body >= 0
        and place + length + body <= size
    ):
        raise ValueError(f"it lists a message at byte {place}")
    stream.seek(place)
    head = stream.read(length)
    (mark,) = struct.unpack_from("<I", head)
    head = head[8 if mark == _CONTINUED else 4 :]  # before version 0.15 without the mark
    message = _Table(head, struct.unpack_from("<I", head)[0])
    if message.number(3, "<q") != body or message.number(1, "<B") != kind:
        raise ValueError(f"what stands at byte {place} is not the message that is listed")
    batch = message.table(2)
    return _claimed(
        batch.table(1) if kind == _DICTIONARIES else batch, stream, place + length, body
    )


def _claimed(batch: _Table, stream: BinaryIO, start: int, size: int) -> _Message:
    """What a batch claims whose body of so many bytes begins at `start`."""
    places = batch.vector(2, _BUFFER)
    unpacked = size
    if batch.place_of(3):  # packed
        unpacked = 0
        for offset, length in places:
            if not 0 <= offset <= offset + length <= size:
                raise ValueError(f"a buffer of the message at byte {start} lies outside of it")
            if length >= 8:
                stream.seek(start + offset)
                (one,) = struct.unpack("<q", stream.read(8))
                unpacked += length if one == -1 else max(0, one)
    rows = batch.number(0, "<q")
    if not 0 <= rows <= LIMITS.whole_bytes:
        raise ValueError(f"the message at byte {start} claims {rows} as its rows")
    nodes = batch.vector(1, _NODE)
    if nodes and nodes[0][0] != rows:  # pyarrow takes the fewer
        raise ValueError(
            f"the message at byte {start} claims {counted(rows, 'row')}, and its first column "
            f"{nodes[0][0]}"
        )
    return _Message(rows, len(places), unpacked)


@dataclass(frozen=True)
class _Table:
    """A flatbuffer's table that stands at a byte."""

    data: bytes
    place: int

    def place_of(self, field: int) -> int:
        """Where a field stands; 0 where it is left out."""
        entries = self.place - struct.unpack_from("<i", self.data, self.place)[0]
        if entries < 0:
            raise ValueError("a table lies outside of its message")
        (length,) = struct.unpack_from("<H", self.data, entries)
        if 4 + 2 * field >= length:
            return 0
        (offset,) = struct.unpack_from("<H", self.data, entries + 4 + 2 * field)
        return self.place + int(offset) if offset else 0

    def number(self, field: int, kind: str) -> int:
        """A field's number, 0 where it is left out."""
        place = self.place_of(field)
        return int(struct.unpack_from(kind, self.data, place)[0]) if place else 0

    def table(self, field: int) -> _Table:
        """The table that a field names."""
        place = self.place_of(field)
        if not place:
            raise ValueError("a message lacks what its kind has")
        return _Table(self.data, place + struct.unpack_from("<I", self.data, place)[0])

    def vector(self, field: int, one: struct.Struct) -> list[tuple[int, ...]]:
        """The structures of a vector."""
        place = self.place_of(field)
        if not place:
            return []
        start = place + struct.unpack_from("<I", self.data, place)[0]
        (size,) = struct.unpack_from("<I", self.data, start)
        content = self.data[start + 4 : start + 4 + size * one.size]
        if len(content) < size * one.size:
            raise ValueError("a vector breaks off")
        return list(one.iter_unpack(content))
