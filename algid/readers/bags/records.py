"""Records of a ROS 1 bag in memory: fields, connections, and the messages of a chunk.

An index is believed only where the messages that it lists, with the connections between them, tile
the chunk without a gap. Otherwise the records are walked one by one.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.limits import LIMITS
from algid.log import IntArray
from algid.readers.messages.batch import Messages, beside, gather
from algid.readers.messages.source import MessageChannel
from algid.words import counted

MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
SIZE = struct.Struct("<I")
_SOME = 0xFFFF
"""Records between two looks at how much work they are."""


class BagError(Exception):
    """Bytes of a bag that are not what the format says."""


class BrokenOffBagError(BagError):
    """A record that reaches past the end."""


@dataclass(frozen=True)
class BagRecord:
    """A record's fields by name, and where its data start and end."""

    fields: dict[str, bytes]
    start: int
    end: int

    @property
    def code(self) -> int:
        """What kind of record it is."""
        return self.number("op", 1)

    def number(self, name: str, width: int = 4) -> int:
        """A field of so many bytes as a number.

        Raises
        ------
        BagError
            If there is no such field.
        """
        value = self.fields.get(name, b"")
        if len(value) != width:
            raise BagError(f"a record without {name!r} before byte {self.start}")
        return int.from_bytes(value, "little")

    def text(self, name: str) -> str:
        """A field as text, empty where there is none."""
        return self.fields.get(name, b"").decode("utf-8", errors="replace")


def fields_of(header: bytes) -> dict[str, bytes]:
    """The fields ``name=value`` of a header, each behind its length.

    Raises
    ------
    BagError
        If they do not fill it.
    """
    fields, place = {}, 0
    while place < len(header):
        if place + 4 > len(header):
            raise BagError("a record's header breaks off")
        (length,) = SIZE.unpack_from(header, place)
        name, equals, value = header[place + 4 : place + 4 + length].partition(b"=")
        if not equals or place + 4 + length > len(header):
            raise BagError("a record's header breaks off")
        fields[name.decode("utf-8", errors="replace")] = value
        place += 4 + length
    return fields


def connection(fields: dict[str, bytes], data: bytes) -> tuple[int, MessageChannel]:
    """Number and meaning of a connection out of its record.

    Raises
    ------
    BagError
        If the record cannot be read.
    """
    record = BagRecord(fields, 0, 0)
    stated = fields_of(data)
    kind = stated.get("type", b"").decode("utf-8", errors="replace")
    definition = stated.get("message_definition", b"")
    return record.number("conn"), MessageChannel(
        record.text("topic"), kind, "ros1", "ros1msg", definition
    )


@dataclass(frozen=True, eq=False)
class ChunkMessages:
    """Messages, and the connection (N,) of each."""

    connections: NDArray[np.integer]
    messages: Messages


Others = list[tuple[dict[str, bytes], bytes]]
"""Fields and data of connections."""


def walked(
    content: bytes, works: Callable[[int], bool], *, torn: bool
) -> tuple[ChunkMessages, Others]:
    """The messages and connections within unpacked bytes, one by one.

    Of a `torn` chunk those before the break.

    Raises
    ------
    BagError
        If the records are none, or more than in any honest bag.
    BrokenOffBagError
        If the last one reaches past the end.
    """
    rows: list[tuple[int, int, int, int]] = []
    others: Others = []
    try:
        for count, (fields, start, end) in enumerate(_inside(content, 0, len(content))):
            if count & _SOME == _SOME and not works(_SOME):
                raise BagError("more small messages than in any honest file of this size")
            code = fields.get("op")
            if code == bytes([MESSAGE]):
                record = BagRecord(fields, start, end)
                rows.append(
                    (
                        record.number("conn"),
                        start,
                        end - start,
                        nanoseconds(record.number("time", 8)),
                    )
                )
            elif code == bytes([CONNECTION]):
                others.append((fields, content[start:end]))
                if len(others) > LIMITS.other_records:
                    raise BagError(f"more than {LIMITS.other_records} records that are no messages")
    except BrokenOffBagError:
        if not torn:
            raise
    table = np.array(rows, np.int64).reshape(-1, 4).T
    messages = Messages(np.frombuffer(content, np.uint8), table[1], table[2], table[3])
    return ChunkMessages(table[0], messages), others


def nanoseconds(time: int) -> int:
    """A time in ns: seconds stand in the lower 32 bits, nanoseconds in the upper."""
    return (time & 0xFFFFFFFF) * 10**9 + (time >> 32)


def _inside(content: bytes, place: int, end: int) -> Iterator[tuple[dict[str, bytes], int, int]]:
    """Fields of each record within unpacked bytes, and where its data start and end.

    Raises
    ------
    BrokenOffBagError
        Where a record breaks off.
    """
    while place < end:
        if place + 4 > end:
            raise BrokenOffBagError("a record breaks off")
        (length,) = SIZE.unpack_from(content, place)
        if length > LIMITS.bag_header_bytes or place + 8 + length > end:
            raise BrokenOffBagError("a record breaks off")
        (size,) = SIZE.unpack_from(content, place + 4 + length)
        start = place + 8 + length
        if start + size > end:
            raise BrokenOffBagError("a record breaks off")
        yield fields_of(content[place + 4 : place + 4 + length]), start, start + size
        place = start + size


def indexed(content: bytes, listed: IntArray) -> tuple[ChunkMessages, Others] | None:
    """The messages at the offsets `listed` (N,), and the connections between.

    None where these do not tile.
    """
    octets = np.frombuffer(content, np.uint8)
    if not listed.size or listed[-1] > octets.size - 8:
        return None
    lengths = gather(octets, listed, "<u4").astype(np.int64)
    length = int(lengths[0])
    if (
        np.any(lengths != length)
        or length > LIMITS.bag_header_bytes
        or listed[-1] + 8 + length > octets.size
    ):
        return None
    starts = listed + 8 + length
    sizes = gather(octets, starts - 4, "<u4").astype(np.int64)
    others = _between(content, listed, starts + sizes)
    places = _places(octets, listed, length)
    if others is None or places is None:
        return None
    times = gather(octets, listed + places["time"], "<u4").astype(np.int64) * 10**9
    times += gather(octets, listed + places["time"] + 4, "<u4").astype(np.int64)
    connections = gather(octets, listed + places["conn"], "<u4").astype(np.int64)
    return ChunkMessages(connections, Messages(octets, starts, sizes, times)), others


def _between(content: bytes, starts: IntArray, ends: IntArray) -> Others | None:
    """The connections before, between and behind messages.

    None where anything else stands there, or is missing.
    """
    borders = beside(starts, ends, len(content))
    if borders is None:
        return None
    others: Others = []
    try:
        for first, last in borders:
            for fields, start, end in _inside(content, first, last):
                if fields.get("op") != bytes([CONNECTION]):
                    return None
                others.append((fields, content[start:end]))
    except BagError:
        return None
    return others


_WIDTHS = {"op": 1, "conn": 4, "time": 8}


def _places(octets: NDArray[np.uint8], listed: IntArray, length: int) -> dict[str, int] | None:
    """Where the values of a message's header stand behind its start.

    None where the headers are not all alike.
    """
    first = int(listed[0]) + 4
    try:
        head = fields_of(octets[first : first + length].tobytes())
    except BagError:
        return None
    places, place = dict[str, int](), 4
    same = np.ones(length, np.bool_)
    for name, value in head.items():
        places[name] = place + 5 + len(name)
        place = places[name] + len(value)
        if name in ("conn", "time"):
            same[places[name] - 4 : place - 4] = False
    wanted = {name: len(head.get(name, b"")) for name in _WIDTHS}
    if place != 4 + length or wanted != _WIDTHS or head["op"] != bytes([MESSAGE]):
        return None
    size = octets.size - length + 1
    window: NDArray[np.uint8] = np.ndarray((size, length), np.uint8, octets.data, strides=(1, 1))
    heads = window[listed + 4]
    return None if np.any(heads[:, same] != heads[0, same]) else places


_UNPACKERS = ("none", "bz2", "lz4")


def unpacked(packed: bytes, packing: str, size: int, *, torn: bool) -> bytes:
    """What is packed by the method `packing`, in memory bounded by the `size` claimed.

    a torn one as far as it goes.

    Raises
    ------
    BagError
        If the method is unknown, or the data are not what it says.
    """
    import bz2

    import lz4.frame

    if packing not in _UNPACKERS:
        raise BagError(f"a chunk is packed with {packing[:40]!r}; expected {', '.join(_UNPACKERS)}")
    try:
        if packing == "none":
            octets = packed[:size] if torn else packed
        elif packing == "bz2":
            octets = bz2.BZ2Decompressor().decompress(packed, max_length=size + 1)
        else:
            octets = bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
    except (OSError, EOFError, RuntimeError, ValueError) as error:
        raise BagError(f"a chunk cannot be unpacked ({error})") from error
    if len(octets) != size and not torn:
        raise BagError(
            f"a chunk of {counted(size, 'byte')} unpacks to "
            f"{'more' if len(octets) > size else len(octets)}"
        )
    return octets
