"""MCAP logs: the `mcap` package parses the records, NumPy the messages of a chunk at once.

A file is read by its summary, or record by record up to its first break. Nothing behind a break is
searched for: `mcap recover` does that.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Metadata, Schema
from mcap.summary import Summary
from numpy.typing import NDArray

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.runtime import ahead
from algid.base.words import counted
from algid.log import KEY, IntArray, loads
from algid.notices import Notice
from algid.readers.messages.message_file import (
    MessageBatch,
    MessageChannel,
    MessageFile,
    Messages,
    gather,
)
from algid.readers.messages.reader import MessageLog

_MAGIC = b"\x89MCAP0\r\n"
_FRAME = struct.Struct("<BQ")
_FOOTER_BYTES = 37
"""Of a footer with the magic behind it; its checksum covers the summary and the first 25."""
_HEAD_BYTES = 31
"""Of a message record before its payload: code, length, channel, sequence, two times."""
_HEAD = np.dtype(
    [("code", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_ns", "<i8")]
)
_DEFINITIONS = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata}
_SUMMARY = (2, 3, 4, 8, 10, 11, 13, 14)
"""Codes of the records that may stand behind the end of the data."""
_LOOSE_BYTES = 1 << 23
"""Of records outside of chunks that are read at once."""
_SMALL_BYTES = 1 << 13


def open_mcap(paths: Sequence[Path]) -> MessageLog:
    """An MCAP log, or the splits of one in their order."""
    name = str(paths[0] if len(paths) == 1 else paths[0].parent)
    return MessageLog(name, "mcap", [cache(partial(mcap_file, path)) for path in paths])


@dataclass
class ChunkRange:
    """Where a chunk's content lies in the file, or records outside of chunks (`loose`).

    `channels` are those that have messages in it, None where nobody knows. Message indexes of
    `index_length` bytes follow.
    """

    start: int
    length: int
    index_length: int = 0
    channels: frozenset[int] | None = None
    loose: bool = False
    torn: bool = False

    @property
    def end(self) -> int:
        """The byte behind its content and indexes."""
        return self.start + self.length + self.index_length


@dataclass
class FileIndex:
    """What a file defines and where its messages lie."""

    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    chunks: list[ChunkRange] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    span_ns: tuple[int, int] | None = None
    notices: list[Notice] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    redefined: float = math.inf
    """From which byte on a channel or schema is another than before: messages there are not read,
    since nobody knows which definition they follow."""

    def define(self, others: Sequence[tuple[int, bytes]], place: int) -> None:
        """Take in the definitions of a chunk at a byte: the first one of an id holds."""
        for code, content in others:
            one: Any = _parsed(_DEFINITIONS[Opcode(code)], content)
            if isinstance(one, Metadata):
                self.metadata.setdefault(one.name, one.metadata)
                continue
            known: dict[int, Any] = self.schemas if isinstance(one, Schema) else self.channels
            if known.setdefault(one.id, one) != one:
                self.redefined = min(place, self.redefined)


def mcap_file(path: Path) -> MessageFile:
    """What an MCAP file defines and holds; its messages are read when they are asked for.

    Raises
    ------
    LogError
        If not even its start can be read.
    """
    with _stream(path) as stream:
        size = stream.seek(0, io.SEEK_END)
        found, promised, why = None, dict[int, int](), []
        numbers: dict[str, Any] = {"case": "none"}
        try:
            summary = _summary(stream, size)
            if summary is not None and summary.statistics is not None:
                promised = summary.statistics.channel_message_counts
                found = _from_summary(stream, summary)
        except Exception as error:  # what the package raises of bytes that are no records
            numbers = {"case": "summary", "why": str(error)}
            why = [f"its summary: {error}"]
        if found is None:
            found = _walked(stream, size)
            found.notices.insert(0, Notice("DAMAGED_INDEX", numbers=numbers))
            found.damage[:0] = why
            for channel, count in promised.items():  # what is not there is lost
                found.counts[channel] = max(count, found.counts.get(channel, 0))
    text = found.metadata.get(KEY, {}).get(KEY)
    try:
        truth = None if text is None else loads(text).truth
    except ValueError as error:
        raise LogError(
            f"{path}: the truth in the file's metadata cannot be read ({error})"
        ) from error
    channels = {}
    for number, one in found.channels.items():
        schema = found.schemas.get(one.schema_id) or Schema(0, b"", "", "")
        form = (one.message_encoding, schema.encoding, schema.data)
        channels[number] = MessageChannel(one.topic, schema.name, *form, one.metadata)
    batches = partial(_batches, path, found)
    notices = tuple(found.notices)
    return MessageFile(
        str(path), channels, batches, found.counts, found.span_ns, notices, found.damage, truth
    )


@contextmanager
def _stream(path: Path) -> Iterator[IO[bytes]]:
    try:
        stream = path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: the log cannot be read ({error.strerror})") from error
    with stream:
        yield stream


def _parsed(kind: Any, content: bytes) -> Any:
    return kind.read(ReadDataStream(io.BytesIO(content)))


def _read(stream: IO[bytes], start: int, length: int) -> bytes:
    stream.seek(start)
    content = stream.read(length)
    if len(content) != length:
        raise ValueError(f"bytes {start} to {start + length} cannot be read")
    return content


def _summary(stream: IO[bytes], size: int) -> Summary | None:
    """A file's summary, None where it has none.

    Raises
    ------
    ValueError
        If it is damaged; the package raises more.
    """
    tail = _read(stream, max(0, size - _FOOTER_BYTES), min(_FOOTER_BYTES, size))
    if not tail.endswith(_MAGIC) or len(tail) < _FOOTER_BYTES:
        raise ValueError("the file has no end: it was cut off")
    stream.seek(0)
    summary = SeekingReader(stream, record_size_limit=LIMITS.chunk_bytes).get_summary()
    start, checksum = struct.unpack_from("<Q8xI", tail, 9)
    content = _read(stream, start, size - _FOOTER_BYTES - start)
    if summary is not None and checksum and zlib.crc32(tail[:25], zlib.crc32(content)) != checksum:
        raise ValueError("its checksum is wrong")
    return summary


def _from_summary(stream: IO[bytes], summary: Summary) -> FileIndex | None:
    """What a summary with statistics says, None where it does not tell enough.

    Raises
    ------
    ValueError
        If it contradicts itself; the package raises more.
    """
    if not summary.chunk_indexes or not summary.channels or summary.statistics is None:
        return None
    statistics, chunks = summary.statistics, []
    counts = {one: count for one, count in statistics.channel_message_counts.items() if count}
    entries = 0
    for one in sorted(summary.chunk_indexes, key=lambda one: one.chunk_start_offset):
        entries += one.message_index_length - 15 * len(one.message_index_offsets)
        channels = frozenset(one.message_index_offsets) or None
        place = one.chunk_start_offset + 9, one.chunk_length - 9, one.message_index_length
        chunks.append(ChunkRange(*place, channels))
    indexed = all(one.channels for one in chunks)
    # what lies outside of the chunks that it lists, or a chunk that it does not list
    if (indexed and entries != 16 * sum(counts.values())) or counts.keys() - summary.channels:
        raise ValueError("its indexes and its statistics count different messages")
    if any(one.start + one.length > after.start for one, after in pairwise(chunks)):
        raise ValueError("its chunks overlap")
    found = FileIndex(summary.channels, summary.schemas, {}, chunks, counts)
    found.span_ns = statistics.message_start_time, statistics.message_end_time
    for entry in summary.metadata_indexes:
        if entry.name == KEY:
            record = _parsed(Metadata, _read(stream, entry.offset + 9, entry.length - 9))
            if record.name != KEY:
                raise ValueError("its metadata stand elsewhere")
            found.metadata.setdefault(KEY, record.metadata)
    return found


def _walked(stream: IO[bytes], size: int) -> FileIndex:
    """What stands in a file up to its end, or to its first break."""
    found, chunks = FileIndex(), list[ChunkRange]()
    place, data_end = len(_MAGIC), 0
    while True:
        head = _read(stream, place, min(_FRAME.size, size - place))
        code, length = _FRAME.unpack(head.ljust(_FRAME.size, b"\0"))
        end = place + _FRAME.size + length
        known = 0 < code <= Opcode.DATA_END or code >= 0x80
        known &= length >= _HEAD_BYTES - 9 or code != Opcode.MESSAGE
        known &= length == 4 or code != Opcode.DATA_END
        if not known or end > size:
            break
        last = chunks[-1] if chunks else ChunkRange(0, 0)
        follows = last.end == place
        if code == Opcode.CHUNK:
            chunks.append(ChunkRange(place + _FRAME.size, length))
        elif code == Opcode.MESSAGE_INDEX and follows and not last.loose:
            last.index_length += end - place
        elif code == Opcode.MESSAGE or (code in _DEFINITIONS and not data_end):
            if follows and last.loose and last.length < _LOOSE_BYTES:
                last.length += end - place
            else:
                chunks.append(ChunkRange(place, end - place, loose=True))
        elif code == Opcode.DATA_END:
            data_end = end
        place = end
        if code == Opcode.FOOTER:
            break
    broken, left = place < end, size - place
    # what breaks off behind the data is its summary if the footer says so, or is gone too
    summary = known and code in _SUMMARY
    if size > 28 and (tail := _read(stream, size - 28, 28)).endswith(_MAGIC):
        summary = struct.unpack("<Q20x", tail)[0] == data_end
    why = "" if known or len(head) < _FRAME.size else "what stands there is no record"
    if data_end and not broken:
        why = "its end stands there, and more behind it"
    numbers: dict[str, Any] = {"case": "end"}
    if data_end and (left <= len(_MAGIC) or (summary and broken)):
        left = 0
    elif why:
        numbers = {"case": "bytes", "bytes": left, "first": place, "why": why}
        found.notices.append(Notice("DAMAGED", numbers=numbers))
    else:
        if left:
            numbers = {"case": "chunk" if code == Opcode.CHUNK else "record", "bytes": left}
        found.notices.append(Notice("CUT_OFF", numbers=numbers))
    if left:
        found.damage.append(f"it breaks off at byte {place}")
        if known and code == Opcode.CHUNK:
            chunks.append(ChunkRange(place + _FRAME.size, left - _FRAME.size, torn=True))
    found.chunks = chunks
    for chunk in chunks:
        try:
            records = _records(stream, chunk)
            found.define(records.others, chunk.start)
            own, sizes = np.unique(records.heads["channel"], return_counts=True)
            counts = dict(zip(own.tolist(), sizes.tolist(), strict=True))
            chunk.channels = frozenset(counts)
        except Exception as error:  # what the libraries raise; told when it is read
            found.damage.append(f"{error} (at byte {chunk.start})")
            index = _read(stream, chunk.start + chunk.length, chunk.index_length)
            counts = {channel: offsets.size for channel, offsets in _listed(index).items()}
        for channel, count in counts.items():
            found.counts[channel] = found.counts.get(channel, 0) + count
    return found


@dataclass(frozen=True, eq=False)
class _Records:
    """The records of a chunk, unpacked: heads (M,) of its messages, their offsets, and the rest.

    `others` are code and content of definitions, `torn` of a torn chunk the bytes that are there
    and those that there should be.
    """

    content: NDArray[np.uint8]
    offsets: IntArray
    heads: NDArray[np.void]
    others: Sequence[tuple[int, bytes]]
    checked: bool
    torn: tuple[int, int] | None = None

    def batch_of(self, channels: frozenset[int]) -> MessageBatch:
        """The messages of some channels, in bytes of their own if they are of one size."""
        numbers = self.heads["channel"]
        one = next(iter(channels))  # numpy.isin takes longer than all else here
        ours = np.flatnonzero(
            numbers == one if len(channels) == 1 else np.isin(numbers, list(channels))
        )
        sizes = self.heads["length"][ours].astype(np.int64) - (_HEAD_BYTES - 9)
        log_ns = self.heads["log_ns"][ours].astype(np.int64)
        messages = Messages(self.content, self.offsets[ours] + _HEAD_BYTES, sizes, log_ns)
        return MessageBatch(messages.compacted(), self.checked, torn=self.torn)


def _records(stream: IO[bytes], chunk: ChunkRange) -> _Records:
    """The records of a chunk.

    Raises
    ------
    ValueError
        If they are damaged; the libraries raise more.
    """
    content, index = _read(stream, chunk.start, chunk.length), b""
    size, checked = len(content), False
    if not chunk.loose:
        packed = _parsed(Chunk, content)
        content, size = _unpacked(packed), packed.uncompressed_size
        checked = packed.uncompressed_crc != 0
        if len(content) != size and not chunk.torn:
            unpacked = "more" if len(content) > size else f"{len(content):,}"
            raise ValueError(f"a chunk of {counted(size, 'byte')} unpacks to {unpacked}")
        if len(content) == size and checked and zlib.crc32(content) != packed.uncompressed_crc:
            raise ValueError("a chunk's checksum is wrong")
        index = _read(stream, chunk.start + chunk.length, chunk.index_length)
    octets: NDArray[np.uint8] = np.frombuffer(content, np.uint8)
    # a small chunk is sooner walked than compared with its index
    listed = _by_index(octets, content, index) if size > _SMALL_BYTES else None
    offsets, others, end = listed or _one_by_one(content, 0, len(content))
    if end != len(content) and not chunk.torn:
        raise ValueError("its records do not fill it")
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    if chunk.torn and end != size:  # nothing vouches for what is there, which CUT_OFF says
        return _Records(octets[:end], offsets, heads, others, True, (end, size))
    return _Records(octets, offsets, heads, others, checked)


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


Listed = tuple[IntArray, list[tuple[int, bytes]], int]
"""Offsets of messages, code and content of definitions, and where the last whole record ends."""


def _one_by_one(content: bytes, place: int, stop: int) -> Listed:
    """The whole records in [place, stop), found by their lengths.

    Raises
    ------
    ValueError
        If a message is shorter than its head.
    """
    offsets, others = list[int](), list[tuple[int, bytes]]()
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
        elif code in _DEFINITIONS:
            others.append((code, content[place + 9 : end]))
        place = end
    return np.array(offsets, np.int64), others, place


def _by_index(octets: NDArray[np.uint8], content: bytes, index: bytes) -> Listed | None:
    """The same by the message indexes behind a chunk.

    None where the messages that they list, with the definitions between, do not fill the chunk: an
    index has no checksum of its own.
    """
    offsets = np.sort(np.concatenate([np.empty(0, np.int64), *_listed(index).values()]))
    if not offsets.size or offsets[0] < 0 or offsets[-1] > octets.size - _HEAD_BYTES:
        return None
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    lengths = heads["length"]
    if np.any(heads["code"] != Opcode.MESSAGE) or lengths.max() > octets.size:
        return None
    starts = np.append(offsets, octets.size)
    ends = np.append(0, offsets + 9 + lengths.astype(np.int64))
    others: list[tuple[int, bytes]] = []
    for gap in np.flatnonzero(starts != ends).tolist():
        unlisted, between, end = _one_by_one(content, int(ends[gap]), int(starts[gap]))
        if unlisted.size or end != starts[gap]:
            return None
        others += between
    return offsets, others, octets.size


def _listed(index: bytes) -> dict[int, IntArray]:
    """Offsets of messages by channel as message index records list them; none where damaged."""
    found: dict[int, IntArray] = {}
    place = 0
    while place + 15 <= len(index):
        code, length, channel, size = struct.unpack_from("<BQHI", index, place)
        if code != Opcode.MESSAGE_INDEX or size != length - 6 or place + 15 + size > len(index):
            return {}
        found[channel] = np.frombuffer(index, "<i8", size // 16 * 2, place + 15)[1::2]
        place += 9 + length
    return found


def _batches(path: Path, found: FileIndex, channels: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of `channels` in file order; a damaged chunk yields its reason."""

    def batches() -> Iterator[MessageBatch]:
        with _stream(path) as stream:
            for chunk in found.chunks:
                if chunk.channels is not None and not chunk.channels & channels:
                    continue
                try:
                    records = _records(stream, chunk)
                    found.define(records.others, chunk.start)
                    if chunk.start >= found.redefined:
                        raise ValueError("a channel or its schema is defined anew and differently")
                    batch = records.batch_of(channels)
                except Exception as error:  # what the libraries raise of damaged bytes
                    reason = f"{error or 'it breaks off'} (at byte {chunk.start})"
                    batch = MessageBatch(None, checked=True, reason=reason)
                yield batch

    return ahead(batches())
