"""MCAP logs: one walk over a file's records finds its chunks, NumPy reads the messages of each.

The `mcap` package parses the records. A file is read up to its first break. Nothing behind a break
is searched for: `mcap recover` does that.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, partial, reduce
from operator import or_
from pathlib import Path
from typing import IO, Any

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, MetadataIndex, Schema, Statistics
from mcap.writer import MCAP0_MAGIC as MCAP
from numpy.typing import NDArray

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.runtime import ahead
from algid.base.text import counted
from algid.log import KEY, IntArray, loads
from algid.notices import Notice
from algid.readers.flat import as_log_error
from algid.readers.messages.message_file import (
    MessageChannel,
    MessageFile,
    Messages,
    gather,
)
from algid.readers.messages.offer import MessageLog

_FRAME = struct.Struct("<BQ")
_INDEX = struct.Struct("<BQHI")
"""Head of a message index: code, length, channel, bytes of its entries (16 each)."""
_FOOTER_BYTES = 37
"""Of a footer with the magic behind it; its checksum covers the summary and the first 25."""
_HEAD_BYTES = 31
"""Of a message record before its payload: code, length, channel, sequence, two times."""
_HEAD = np.dtype(
    [("code", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_ns", "<i8")]
)
_KINDS: dict[int, tuple[Any, str]] = {
    Opcode.SCHEMA: (Schema, "id"),
    Opcode.CHANNEL: (Channel, "id"),
    Opcode.METADATA: (Metadata, "name"),
    Opcode.METADATA_INDEX: (MetadataIndex, "name"),
    Opcode.STATISTICS: (Statistics, ""),
}
"""Records that define something, and what they are known by."""
_LOOSE_BYTES = 1 << 23
"""Of records outside of chunks that are read at once."""
_BUFFER_BYTES = 1 << 9
"""What is read of a chunk to know its head."""
Definitions = list[tuple[int, bytes]]
"""Code and content of each."""
Listed = tuple[IntArray, Definitions, int]
"""Offsets of messages, definitions, and where the last whole record ends."""


def open_mcap(path: Path) -> MessageLog:
    """An MCAP log."""
    return MessageLog(str(path), "mcap", [cache(partial(mcap_file, path))])


@dataclass
class _Part:
    """Where records lie: a chunk with the message indexes behind it, or `loose` ones.

    `counts` are its messages by channel, as the indexes tell; None where nobody knows.
    """

    start: int
    length: int
    loose: bool
    counts: dict[int, int] | None = None


@dataclass
class _Contents:
    """What a file defines, by code and id or name, and where its messages lie."""

    records: dict[tuple[int, Any], Any] = field(default_factory=dict)
    parts: list[_Part] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    redefined: float = math.inf
    """From which byte on a channel or schema is another than before: messages there are not read,
    since nobody knows which definition they follow."""

    def define(self, others: Definitions, place: int) -> None:
        """Take in the records of a part at a byte: the first one of an id holds."""
        for code, content in others:
            kind, name = _KINDS[code]
            one = _parsed(kind, content)
            known = self.records.setdefault((code, getattr(one, name, None)), one)
            if known != one and name == "id":
                self.redefined = min(place, self.redefined)

    def look(self, stream: IO[bytes], *, loose: bool) -> None:
        """Unpack parts to know what they define and hold; damage is told when they are read."""
        for part in self.parts:
            if part.loose == loose:
                try:
                    _, numbers, others = _records(stream, part)
                    self.define(others, part.start)
                    part.counts = Counter(numbers.tolist())
                except Exception as error:  # what the libraries raise
                    self.damage.append(f"{error} (at byte {part.start})")

    def counts(self) -> Counter[int]:
        """Messages by channel, as far as the parts are known."""
        total = Counter[int]()
        for part in self.parts:
            total.update(part.counts or {})
        return total


def mcap_file(path: Path) -> MessageFile:
    """What an MCAP file defines and holds; its messages are read when they are asked for.

    Raises
    ------
    LogError
        If the truth in its metadata cannot be read.
    """
    found, why, span = _Contents(), "", None
    with path.open("rb", buffering=_BUFFER_BYTES) as stream:
        size = stream.seek(0, io.SEEK_END)
        _walk(stream, size, found)
        try:
            found.define(_summary(stream, size), 0)
        except Exception as error:  # what the package raises of bytes that are no records
            why = str(error)
            found.records.clear()
        found.look(stream, loose=True)
        promised, records = Counter[int](), found.records
        statistics = records.get((Opcode.STATISTICS, None))
        if statistics:
            promised += Counter(statistics.channel_message_counts)
            span = statistics.message_start_time, statistics.message_end_time
            if any((Opcode.CHANNEL, number) not in records for number in promised):
                why = "it counts messages of channels that it does not define"
        if why or not statistics or all(part.loose for part in found.parts):
            numbers = {"case": "summary" if why else "none", "why": why}
            found.notices.insert(0, Notice("DAMAGED_INDEX", numbers=numbers))
            found.damage[:0] = [f"its summary: {why}"] if why else []
            found.look(stream, loose=False)
    metadata = records.get((Opcode.METADATA, KEY))
    if metadata is None and (Opcode.METADATA_INDEX, KEY) in records:  # no checksum covers it
        raise LogError(f"{path}: the truth in the MCAP file is damaged (no name); copy it again")
    with as_log_error(path, "truth in the MCAP"):
        truth = loads(metadata.metadata.get(KEY, "")).truth if metadata else None
    channels = {}
    for (code, number), one in records.items():
        if code == Opcode.CHANNEL:
            schema = records.get((Opcode.SCHEMA, one.schema_id)) or Schema(0, b"", "", "")
            form = (one.message_encoding, schema.encoding, schema.data)
            channels[number] = MessageChannel(one.topic, schema.name, *form, one.metadata)
    counts = found.counts() | promised  # what is not there is lost
    batches, notices = partial(_batches, path, found), tuple(found.notices)
    return MessageFile(str(path), channels, batches, counts, span, notices, found.damage, truth)


def _parsed(kind: Any, content: bytes) -> Any:
    return kind.read(ReadDataStream(io.BytesIO(content)))


def _read(stream: IO[bytes], start: int, length: int) -> bytes:
    stream.seek(start)
    content = stream.read(length)
    if len(content) != length:
        raise ValueError(f"bytes {start} to {start + length} cannot be read")
    return content


def _walk(stream: IO[bytes], size: int, found: _Contents) -> None:
    """Find the parts of a file up to its end, or to its first break."""
    place, data_end = len(MCAP), 0
    while True:
        head = _read(stream, place, min(_INDEX.size, size - place))
        code, length, channel, entries = _INDEX.unpack(head.ljust(_INDEX.size, b"\0"))
        end = place + _FRAME.size + length
        known = 0 < code <= Opcode.DATA_END or code >= 0x80
        known &= code != Opcode.MESSAGE or length >= _HEAD_BYTES - 9
        if not known or end > size:
            break
        last = found.parts[-1] if found.parts else _Part(0, 0, loose=False)
        follows, loose = last.start + last.length == place, code != Opcode.CHUNK
        if code == Opcode.MESSAGE_INDEX and follows and not last.loose:
            last.length += end - place
            if 0 < entries == length - 6:
                last.counts = {} if last.counts is None else last.counts
                last.counts[channel] = entries // 16
        elif code in (Opcode.CHUNK, Opcode.MESSAGE) or (code in _KINDS and not data_end):
            if loose and follows and last.loose and last.length < _LOOSE_BYTES:
                last.length += end - place
            else:
                found.parts.append(_Part(place, end - place, loose))
        elif code == Opcode.DATA_END:
            data_end = end
        place = end
        if code == Opcode.FOOTER:
            break
    left, torn = size - place, place < end and (known or len(head) < _FRAME.size)
    if data_end and (left <= len(MCAP) or torn):
        return  # what breaks off behind the data is its summary
    if torn:
        case = "chunk" if code == Opcode.CHUNK else "record"
        numbers: dict[str, Any] = {"case": case if left else "end", "bytes": left}
        found.notices.append(Notice("CUT_OFF", numbers=numbers))
    else:
        numbers = {"case": "bytes", "bytes": left, "first": place}
        numbers["why"] = "what stands there is no record"
        found.notices.append(Notice("DAMAGED", numbers=numbers))
    if left:
        found.damage.append(f"it breaks off at byte {place}")
        if known and code == Opcode.CHUNK:
            found.parts.append(_Part(place, left, loose=False))


def _summary(stream: IO[bytes], size: int) -> Definitions:
    """Code and content of what a file's summary defines: nothing where it has none.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    tail = _read(stream, size - _FOOTER_BYTES, _FOOTER_BYTES)
    if not tail.endswith(MCAP):
        raise ValueError("the file has no end: it was cut off")
    start, checksum = struct.unpack_from("<Q8xI", tail, _FRAME.size)
    content = _read(stream, start, size - _FOOTER_BYTES - start) if start else b""
    if checksum and zlib.crc32(tail[:25], zlib.crc32(content)) != checksum:
        raise ValueError("its checksum is wrong")
    return _one_by_one(content, 0, len(content))[1]


def _records(stream: IO[bytes], part: _Part) -> tuple[Messages, NDArray[np.uint16], Definitions]:
    """The messages of a part, the channel (M,) of each, its definitions.

    Raises
    ------
    ValueError
        If it is damaged; the libraries raise more.
    """
    content, checked, torn = _read(stream, part.start, part.length), False, False
    listed: Listed | None = None
    if not part.loose:
        end = _FRAME.size + _FRAME.unpack_from(content)[1]
        torn, index = end > len(content), content[end:]
        chunk = _parsed(Chunk, content[_FRAME.size : end])
        content, checked = _unpacked(chunk), chunk.uncompressed_crc != 0
        wrong = not torn
        if len(content) == chunk.uncompressed_size:
            wrong = checked and zlib.crc32(content) != chunk.uncompressed_crc
        if wrong:
            raise ValueError("a chunk's size or its checksum is wrong")
        listed = _by_index(content, index)
    octets: NDArray[np.uint8] = np.frombuffer(content, np.uint8)
    offsets, others, end = listed or _one_by_one(content, 0, len(content))
    if end != len(content) and not torn:
        raise ValueError("its records do not fill it")
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    sizes = heads["length"].astype(np.int64) - (_HEAD_BYTES - 9)
    log_ns = heads["log_ns"].astype(np.int64)
    # nothing vouches for what is there of a torn chunk, which CUT_OFF says
    messages = Messages(octets[:end], offsets + _HEAD_BYTES, sizes, log_ns, checked or torn)
    return messages, heads["channel"], others


def _unpacked(chunk: Chunk) -> bytes:
    """A chunk unpacked as far as its bytes go, with one byte too many where it holds more.

    Raises
    ------
    ValueError
        If it claims more memory than a recorder's chunk needs, or its packing is not known.
    """
    size = chunk.uncompressed_size
    if size > LIMITS.chunk_bytes:
        raise ValueError(
            f"a chunk claims {counted(size, 'byte')} unpacked, more than {LIMITS.chunk_bytes:,}"
        )
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as unpacker:
            return unpacker.read(size + 1)
    if chunk.compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1))
    if chunk.compression:
        raise ValueError(f"a chunk is packed with {chunk.compression!r}; expected zstd or lz4")
    return chunk.data[: size + 1]


def _one_by_one(content: bytes, place: int, stop: int) -> Listed:
    """The whole records in [place, stop), found by their lengths.

    Raises
    ------
    ValueError
        If a message is shorter than its head.
    """
    offsets, others = list[int](), Definitions()
    unpack = _FRAME.unpack_from
    while place + 9 <= stop:
        code, length = unpack(content, place)
        end = place + 9 + length
        if end > stop:
            break
        if code == Opcode.MESSAGE:
            if length < _HEAD_BYTES - 9:
                raise ValueError("a message is shorter than its head")
            offsets.append(place)
        elif code in _KINDS:
            others.append((code, content[place + 9 : end]))
        place = end
    return np.array(offsets, np.int64), others, place


def _by_index(content: bytes, index: bytes) -> Listed | None:
    """The same by the message indexes behind a chunk.

    None where the messages that they list do not fill the chunk behind its first definitions: an
    index has no checksum of its own.
    """
    octets: NDArray[np.uint8] = np.frombuffer(content, np.uint8)
    found, place = [np.empty(0, np.int64)], 0
    while place < len(index):
        _, length, _, entries = _INDEX.unpack_from(index, place)
        if entries != length - 6:
            return None
        found.append(np.frombuffer(index, "<i8", entries // 16 * 2, place + _INDEX.size)[1::2])
        place += _FRAME.size + length
    offsets = np.sort(np.concatenate(found))
    if not offsets.size or offsets[0] < 0 or offsets[-1] > octets.size - _HEAD_BYTES:
        return None
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    lengths = heads["length"].astype(np.int64)
    gaps = np.diff(offsets, append=octets.size) - 9 != lengths
    if np.any(gaps | (heads["code"] != Opcode.MESSAGE)):
        return None
    unlisted, others, first = _one_by_one(content, 0, int(offsets[0]))
    return (offsets, others, octets.size) if first == offsets[0] and not unlisted.size else None


def _batches(path: Path, found: _Contents, channels: frozenset[int]) -> Iterator[Messages | str]:
    """The messages of `channels` in file order; or why a part of them is lost."""

    def batches() -> Iterator[Messages | str]:
        with path.open("rb", buffering=_BUFFER_BYTES) as stream:
            for part in found.parts:
                if part.counts is not None and not part.counts.keys() & channels:
                    continue
                try:
                    messages, numbers, others = _records(stream, part)
                    found.define(others, part.start)
                    if part.start >= found.redefined:
                        raise ValueError("a channel or its schema is defined anew and differently")
                except Exception as error:  # what the libraries raise of damaged bytes
                    yield f"{error or 'it breaks off'} (at byte {part.start})"
                    continue
                # numpy.isin takes longer than all else here
                ours = reduce(or_, [numbers == one for one in channels])
                yield messages.take(np.flatnonzero(ours))

    return ahead(batches())
