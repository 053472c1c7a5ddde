"""MCAP logs: the `mcap` package parses the records, NumPy the messages of a chunk at once.

A file is read by its summary, or record by record up to its first break. Nothing behind a break is
searched for: `mcap recover` does that.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import IO, Any

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Metadata, MetadataIndex, Schema, Statistics
from numpy.typing import NDArray

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.runtime import ahead
from algid.base.words import counted
from algid.log import KEY, IntArray, loads
from algid.notices import Notice
from algid.readers.messages.batch import MessageBatch, Messages, gaps_between, gather
from algid.readers.messages.message_file import MessageChannel, MessageFile
from algid.readers.messages.reader import MessageLog

_MAGIC = b"\x89MCAP0\r\n"
_FRAME = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI8s")
_HEAD_BYTES = 31
"""Of a message record before its payload: code, length, channel, sequence, two times."""
_HEAD = np.dtype(
    [("code", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_ns", "<i8")]
)
_LEAST = {Opcode.MESSAGE: _HEAD_BYTES - 9, Opcode.DATA_END: 4}
_MOST = {Opcode.DATA_END: 4}
_LOOSE_BYTES = 1 << 23
"""Of messages outside of chunks that are read at once."""
_SMALL_BYTES, _GROUP_BYTES = 1 << 13, 1 << 19
"""Of a small chunk, and of the chunks whose messages are decoded together."""


def open_mcap(paths: Sequence[Path]) -> MessageLog:
    """An MCAP log, or the splits of one in their order."""
    name = str(paths[0] if len(paths) == 1 else paths[0].parent)
    return MessageLog(name, "mcap", [cache(partial(mcap_file, path)) for path in paths])


def mcap_file(path: Path) -> MessageFile:
    """What an MCAP file defines and holds; its messages are read when they are asked for.

    Raises
    ------
    LogError
        If not even its start can be read.
    """
    with _stream(path) as stream:
        size = stream.seek(0, io.SEEK_END)
        notice, why = Notice("DAMAGED_INDEX", numbers={"case": "none"}), []
        try:
            found = _from_summary(stream, size)
        except Exception as error:  # what the package raises of bytes that are no records
            found, why = None, [f"its summary: {error}"]
            notice = Notice("DAMAGED_INDEX", numbers={"case": "summary", "why": str(error)})
        if found is None:
            found = _walked(stream, size)
            found.notices.insert(0, notice)
            found.damage[:0] = why
    text = found.metadata.get(KEY, {}).get(KEY)
    try:
        truth = None if text is None else loads(text).truth
    except ValueError as error:
        raise LogError(
            f"{path}: the truth in the file's metadata cannot be read ({error})"
        ) from error
    return MessageFile(
        str(path),
        {number: _channel(one, found.schemas) for number, one in found.channels.items()},
        partial(_batches, path, found),
        found.counts,
        found.span_ns,
        tuple(found.notices),
        found.damage,
        truth,
    )


def _channel(one: Channel, schemas: dict[int, Schema]) -> MessageChannel:
    schema = schemas.get(one.schema_id) or Schema(0, b"", "", "")
    return MessageChannel(
        one.topic, schema.name, one.message_encoding, schema.encoding, schema.data, one.metadata
    )


@contextmanager
def _stream(path: Path) -> Iterator[IO[bytes]]:
    try:
        stream = path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: the log cannot be read ({error.strerror})") from error
    with stream:
        yield stream


@dataclass(frozen=True)
class _Part:
    """A chunk record's content, or adjacent message records, by their place in the file.

    `channels` are those that have messages in it, None where nobody knows.
    """

    start: int
    length: int
    index_length: int = 0
    channels: frozenset[int] | None = None
    loose: bool = False
    torn: bool = False


@dataclass
class _Contents:
    """What a file defines and where its messages lie."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    redefined: dict[tuple[int, int], int] = field(default_factory=dict)
    """By code and id of a schema or channel the first byte from which it means something else."""
    parts: list[_Part] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    span_ns: tuple[int, int] | None = None
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notices: list[Notice] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    _known: set[tuple[int, bytes]] = field(default_factory=set)

    def define(self, code: int, content: bytes, place: int) -> None:
        """Take in a schema or a channel: the first of an id holds, up to one that differs."""
        if (code, content) in self._known:  # recorders repeat them in every chunk
            return
        one: Any = _parsed(Schema if code == Opcode.SCHEMA else Channel, content)
        known: dict[int, Any] = self.schemas if code == Opcode.SCHEMA else self.channels
        if known.setdefault(one.id, one) == one:
            self._known.add((code, content))
        else:
            self.redefined[code, one.id] = min(place, self.redefined.get((code, one.id), place))

    def holds(self, channel: int, place: int) -> bool:
        """Whether a channel and its schema mean at a byte what they meant first."""
        schema = self.channels[channel].schema_id
        others = ((Opcode.CHANNEL, channel), (Opcode.SCHEMA, schema))
        return all(self.redefined.get(one, place + 1) > place for one in others)


def _parsed(kind: Any, content: bytes) -> Any:
    return kind.read(ReadDataStream(io.BytesIO(content)))


def _from_summary(stream: IO[bytes], size: int) -> _Contents | None:
    """What a summary says, None where it does not tell enough.

    It is believed if its checksum holds, and no chunk or message stands beside those it lists.

    Raises
    ------
    ValueError
        If it is damaged; the package raises more.
    """
    tail = _read(stream, max(0, size - _FOOTER.size), min(_FOOTER.size, size))
    if not tail.endswith(_MAGIC) or len(tail) < _FOOTER.size:
        raise ValueError("the file has no end: it was cut off")
    code, length, start, _, checksum, _ = _FOOTER.unpack(tail)
    end = size - _FOOTER.size
    if code != Opcode.FOOTER or length != 20:
        raise ValueError("its footer is damaged")
    if start == 0:
        return None
    if not len(_MAGIC) <= start <= end or end - start > LIMITS.summary_bytes:
        raise ValueError(f"its footer claims a summary at byte {start}")
    content = _read(stream, start, end - start)
    if checksum and zlib.crc32(tail[:25], zlib.crc32(content)) != checksum:
        raise ValueError("its checksum is wrong")
    found, statistics = _Contents(), None
    chunks: list[ChunkIndex] = []
    for code, place, length in _frames(io.BytesIO(content), 0, len(content)):
        body = content[place : place + length]
        if code in (Opcode.SCHEMA, Opcode.CHANNEL):
            found.define(code, body, 0)
        elif code == Opcode.CHUNK_INDEX:
            chunks.append(_parsed(ChunkIndex, body))
        elif code == Opcode.STATISTICS:
            statistics = _parsed(Statistics, body)
        elif code == Opcode.METADATA_INDEX:
            one = _parsed(MetadataIndex, body)
            if one.name == KEY:
                record = _parsed(Metadata, _read(stream, one.offset + 9, one.length - 9))
                found.metadata.setdefault(record.name, record.metadata)
    if statistics is None or not chunks or not found.channels:
        return None
    counts = {one: count for one, count in statistics.channel_message_counts.items() if count}
    if found.redefined or counts.keys() - found.channels.keys():
        raise ValueError("it defines a channel twice, or counts messages of one it does not define")
    indexed = [(one.message_index_length, len(one.message_index_offsets)) for one in chunks]
    entries = sum(length - 15 * channels for length, channels in indexed)
    if all(channels for _, channels in indexed) and entries != 16 * sum(counts.values()):
        raise ValueError("its indexes and its statistics count different numbers of messages")
    place = len(_MAGIC)
    for chunk in sorted(chunks, key=lambda one: one.chunk_start_offset):
        _check_between(stream, place, chunk.chunk_start_offset)
        place = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
        channels = frozenset(chunk.message_index_offsets) or None
        part = _Part(chunk.chunk_start_offset + 9, chunk.chunk_length - 9)
        found.parts.append(
            replace(part, index_length=chunk.message_index_length, channels=channels)
        )
    _check_between(stream, place, start)
    found.counts = counts
    found.span_ns = statistics.message_start_time, statistics.message_end_time
    return found


def _check_between(stream: IO[bytes], start: int, end: int) -> None:
    """Refuse a summary that leaves out chunks or messages between those it lists."""
    if start > end:
        raise ValueError(f"its chunks overlap at byte {end}")
    for code, place, length in _frames(stream, start, end):
        if code in (Opcode.CHUNK, Opcode.MESSAGE) or place + length > end:
            raise ValueError(f"it leaves out a record at byte {place - 9}")


def _walked(stream: IO[bytes], size: int) -> _Contents:
    """What stands in a file up to its end, or to its first break."""
    found, ended, whole = _Contents(), False, len(_MAGIC)
    last: dict[str, Any] = {"case": "end"}
    try:
        for code, start, length in _frames(stream, whole, size):
            end = start + length
            if end > size:
                last = {
                    "case": "chunk" if code == Opcode.CHUNK else "record",
                    "bytes": size - whole,
                }
                if code == Opcode.CHUNK:
                    found.parts.append(_Part(start, size - start, torn=True))
                raise ValueError(f"it breaks off at byte {whole}")
            before = found.parts[-1] if found.parts else _Part(0, 0)
            adjacent = whole == before.start + before.length + before.index_length
            if code in (Opcode.SCHEMA, Opcode.CHANNEL):
                found.define(code, _read(stream, start, length), start)
            elif code == Opcode.METADATA:
                record = _parsed(Metadata, _read(stream, start, length))
                found.metadata.setdefault(record.name, record.metadata)
            elif code == Opcode.MESSAGE_INDEX and adjacent and not before.loose:
                index_length = before.index_length + 9 + length
                found.parts[-1] = replace(before, index_length=index_length)
            elif code == Opcode.CHUNK:
                found.parts.append(_Part(start, length))
            elif (
                code == Opcode.MESSAGE
                and adjacent
                and before.loose
                and before.length < _LOOSE_BYTES
            ):
                found.parts[-1] = replace(before, length=before.length + 9 + length)
            elif code == Opcode.MESSAGE:
                found.parts.append(_Part(whole, length + 9, loose=True))
            # data behind an end: it was none
            ended = code == Opcode.DATA_END or (
                ended and code not in (Opcode.CHUNK, Opcode.MESSAGE)
            )
            whole = end
            if code == Opcode.FOOTER:
                if _read(stream, end, size - end) != _MAGIC:
                    ended = False
                    raise ValueError(f"its end stands at byte {end}, and more behind it")
                break
    except Exception as error:  # what the package raises of bytes that are no records
        if not ended:
            found.damage.append(str(error))
            if last["case"] == "end":
                numbers = {"bytes": size - whole, "first": whole, "why": str(error)}
                found.notices.append(Notice("DAMAGED", numbers={"case": "bytes"} | numbers))
                ended = True
    if not ended:
        found.notices.append(Notice("CUT_OFF", numbers=last))
    for number, part in enumerate(found.parts):
        try:
            records = _records(stream, part)
            for code, content in records.others:
                found.define(code, content, part.start)
            own, sizes = np.unique(records.heads["channel"], return_counts=True)
            counts = dict(zip(own.tolist(), sizes.tolist(), strict=True))
            found.parts[number] = replace(part, channels=frozenset(counts))
        except Exception as error:  # told when it is read
            found.damage.append(f"{error} (at byte {part.start})")
            index = _read(stream, part.start + part.length, part.index_length)
            counts = {channel: offsets.size for channel, offsets in _listed(index).items()}
        for channel, count in counts.items():
            found.counts[channel] = found.counts.get(channel, 0) + count
    return found


def _read(stream: IO[bytes], start: int, length: int) -> bytes:
    stream.seek(start)
    content = stream.read(length)
    if len(content) != length:
        raise ValueError(f"bytes {start} to {start + length} cannot be read")
    return content


def _frames(stream: IO[bytes], start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Code, and start and length of the content, of each record; the last may reach past the end.

    Raises
    ------
    ValueError
        Where what follows is no record.
    """
    while start < end:
        code, length = _FRAME.unpack(_read(stream, start, _FRAME.size))
        known = 0 < code <= Opcode.DATA_END or code >= 0x80
        if not known or not _LEAST.get(code, 0) <= length <= _MOST.get(code, length):
            raise ValueError(f"what stands at byte {start} is no record")
        yield code, start + _FRAME.size, length
        start += _FRAME.size + length


@dataclass(frozen=True, eq=False)
class _Records:
    """Unpacked bytes, heads (M,) of the messages in them and their offsets, and other records.

    Of those code and content.
    """

    content: NDArray[np.uint8]
    offsets: IntArray
    heads: NDArray[np.void]
    others: Sequence[tuple[int, bytes]]
    checked: bool
    torn: tuple[int, int] | None = None
    """Of a torn chunk the bytes that are there, and those that there should be."""

    def messages_of(self, channels: frozenset[int]) -> Messages:
        """The messages of some channels, in bytes of their own if they are of one size."""
        numbers = self.heads["channel"]
        one = next(iter(channels))  # numpy.isin takes longer than all else here
        ours = np.flatnonzero(
            numbers == one if len(channels) == 1 else np.isin(numbers, list(channels))
        )
        sizes = self.heads["length"][ours].astype(np.int64) - (_HEAD_BYTES - 9)
        log_ns = self.heads["log_ns"][ours].astype(np.int64)
        return Messages(self.content, self.offsets[ours] + _HEAD_BYTES, sizes, log_ns).compacted()


def _records(stream: IO[bytes], part: _Part) -> _Records:
    """The records of a part.

    Raises
    ------
    ValueError
        If they are damaged; the libraries raise more.
    """
    body, index = _read(stream, part.start, part.length), b""
    if part.loose:
        content, size, checked = body, len(body), False
    else:
        chunk = _parsed(Chunk, body)
        size, checked = chunk.uncompressed_size, chunk.uncompressed_crc != 0
        content = _unpacked(chunk)
        if len(content) != size and not part.torn:
            unpacked = "more" if len(content) > size else f"{len(content):,}"
            raise ValueError(f"a chunk of {counted(size, 'byte')} unpacks to {unpacked}")
        if len(content) == size and checked and zlib.crc32(content) != chunk.uncompressed_crc:
            raise ValueError("a chunk's checksum is wrong")
        index = _read(stream, part.start + part.length, part.index_length)
    octets: NDArray[np.uint8] = np.frombuffer(content, np.uint8)
    # a small chunk is sooner walked than compared with its index
    listed = None if len(content) < _SMALL_BYTES else _by_index(octets, content, index)
    if listed is not None:
        return _Records(octets, *listed, checked)
    found, others, end = _one_by_one(content)
    if end != len(content) and not part.torn:
        raise ValueError("its records do not fill it")
    offsets = np.array(found, np.int64)
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    if part.torn and end != size:  # nothing vouches for what is there, which CUT_OFF says
        return _Records(octets[:end], offsets, heads, others, True, (end, size))
    return _Records(octets, offsets, heads, others, checked)


def _unpacked(chunk: Chunk) -> bytes:
    """A chunk unpacked as far as its bytes go, with one byte too many where it holds more.

    Raises
    ------
    ValueError
        If it claims more than memory is for, or its packing is not known.
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


def _one_by_one(content: bytes) -> tuple[list[int], list[tuple[int, bytes]], int]:
    """The records that are whole, found by their lengths.

    Offsets of messages, code and content of definitions, and where the last record ends.

    Raises
    ------
    ValueError
        If a message is shorter than its head.
    """
    offsets, others, place = list[int](), list[tuple[int, bytes]](), 0
    unpack, last = _FRAME.unpack_from, len(content) - _FRAME.size
    while place <= last:
        code, length = unpack(content, place)
        end = place + 9 + length
        if end > last + 9:
            break
        if code != Opcode.MESSAGE:
            if code in (Opcode.SCHEMA, Opcode.CHANNEL):
                others.append((code, content[place + 9 : end]))
        elif length < _HEAD_BYTES - 9:
            raise ValueError("a message is shorter than its head")
        else:
            offsets.append(place)
        place = end
    return offsets, others, place


def _by_index(
    octets: NDArray[np.uint8], content: bytes, index: bytes
) -> tuple[IntArray, NDArray[np.void], list[tuple[int, bytes]]] | None:
    """Offsets and heads of messages, and other records, by the message index behind a chunk.

    None where the messages that it lists, with the few other records between, do not tile it: an
    index has no checksum of its own.
    """
    offsets = np.sort(np.concatenate([np.empty(0, np.int64), *_listed(index).values()]))
    if not offsets.size or offsets[0] < 0 or offsets[-1] > octets.size - _HEAD_BYTES:
        return None
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    lengths = heads["length"]
    if np.any(heads["code"] != Opcode.MESSAGE) or lengths.max() > octets.size:
        return None
    borders = gaps_between(offsets, offsets + 9 + lengths.astype(np.int64), octets.size)
    if borders is None or lengths.min() < _HEAD_BYTES - 9:
        return None
    others: list[tuple[int, bytes]] = []
    for first, last in borders:
        hidden, between, end = _one_by_one(content[first:last])
        if hidden or end != last - first:
            return None
        others += between
    return offsets, heads, others


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


def _batches(path: Path, found: _Contents, channels: frozenset[int]) -> Iterator[MessageBatch]:
    """The messages of `channels` in file order; a damaged part yields its reason."""
    yield from ahead(_grouped(_parts(path, found, channels), channels))


def _parts(
    path: Path, found: _Contents, channels: frozenset[int]
) -> Iterator[_Records | MessageBatch]:
    """The records of each part with messages of `channels`, or why they are lost."""
    with _stream(path) as stream:
        for part in found.parts:
            if part.channels is not None and not part.channels & channels:
                continue
            try:
                records = _records(stream, part)
                for code, content in records.others:
                    found.define(code, content, part.start)
                if not all(found.holds(channel, part.start) for channel in channels):
                    raise ValueError("a channel or its schema is defined anew and differently")
                yield records
            except Exception as error:  # what the libraries raise of damaged bytes
                reason = f"{error or 'it breaks off'} (at byte {part.start})"
                yield MessageBatch(None, checked=True, reason=reason)


def _grouped(
    parts: Iterator[_Records | MessageBatch], channels: frozenset[int]
) -> Iterator[MessageBatch]:
    """Their messages, those of small chunks together: a batch costs more than a few messages."""
    held: list[_Records] = []
    size = 0
    for part in parts:
        alone = isinstance(part, MessageBatch) or part.torn is not None
        if held and (alone or size >= _GROUP_BYTES):
            yield _joined(held, channels)
            held, size = [], 0
        if isinstance(part, MessageBatch):
            yield part
        else:
            held.append(part)
            size += _GROUP_BYTES if alone else part.content.size
    if held:
        yield _joined(held, channels)


def _joined(held: Sequence[_Records], channels: frozenset[int]) -> MessageBatch:
    checked = all(one.checked or not one.offsets.size for one in held)
    ends = np.cumsum([one.content.size for one in held])
    offsets = [one.offsets + end - one.content.size for one, end in zip(held, ends, strict=True)]
    whole = (
        held[0]
        if len(held) == 1
        else _Records(
            np.concatenate([one.content for one in held]),
            np.concatenate(offsets),
            np.concatenate([one.heads for one in held]),
            (),
            checked,
        )
    )
    return MessageBatch(whole.messages_of(channels), checked, torn=whole.torn)
