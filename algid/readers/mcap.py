"""MCAP logs: one walk over a file's records finds its chunks, NumPy reads the messages of each.

The `mcap` package parses the records. A file is read up to its first break. Nothing behind a break
is searched for: `mcap recover` does that.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
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

from algid.base.limits import LIMITS
from algid.base.runtime import ahead
from algid.log import KEY, IntArray, loads
from algid.notices import Notice
from algid.readers.messages.message_file import MessageChannel, MessageFile, Messages, gather
from algid.readers.table import as_log_error

_FRAME = struct.Struct("<BQ")
_INDEX = struct.Struct("<BQH4x")
"""Head of a message index: code, length, channel, bytes of its entries (16 each)."""
_FOOTER_BYTES = 37
"""Of a footer with the magic behind it; its checksum covers the summary and the first 25."""
_HEAD = np.dtype("u1, <u8, <u2, <u4, <i8, <i8")
"""Of a message before its payload: code, length, channel, sequence, log time, publish time."""
_MESSAGE_BYTES = _HEAD.itemsize - _FRAME.size
_KINDS: dict[int, tuple[Any, str]] = {
    Opcode.SCHEMA: (Schema, "id"),
    Opcode.CHANNEL: (Channel, "id"),
    Opcode.METADATA: (Metadata, "name"),
    Opcode.METADATA_INDEX: (MetadataIndex, "name"),
    Opcode.STATISTICS: (Statistics, ""),
}
"""Records that define something, and what they are known by."""
_TRUTH = (Opcode.METADATA, KEY), (Opcode.METADATA_INDEX, KEY)
_LOOSE_BYTES = 1 << 23
"""Of records outside of chunks that are read at once."""
_BUFFER_BYTES = 1 << 9
"""What is read of a chunk to know its head."""
Definitions = list[tuple[int, bytes]]
"""Code and content of each."""


@dataclass
class _Part:
    """Where records lie: a chunk with the message indexes behind it, or `loose` ones.

    `counts` are its messages by channel; None where nobody knows.
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
    redefined: float = np.inf
    """From which byte on a channel or schema is another than before: messages there are not read,
    since nobody knows which definition they follow."""

    def define(self, others: Definitions, place: int) -> None:
        """Take in the records of a part at a byte: the first one of an id holds.

        Raises
        ------
        ValueError
            If a channel or schema is another than before.
        """
        for code, content in others:
            kind, name = _KINDS[code]
            one = kind.read(ReadDataStream(io.BytesIO(content)))
            known = self.records.setdefault((code, getattr(one, name, None)), one)
            if known != one and name == "id":
                self.redefined = min(place, self.redefined)
        if place >= self.redefined:
            raise ValueError("a channel or its schema is defined anew and differently")

    def read(self, stream: IO[bytes], part: _Part, channels: frozenset[int]) -> Messages | str:
        """The messages of some channels in a part, or why it is lost.

        What it defines is taken in; of no channels, what it holds is counted.
        """
        try:
            messages, numbers, others = _records(stream, part)
            self.define(others, part.start)
        except Exception as error:  # what the libraries raise of damaged bytes
            return f"{error or 'it breaks off'} (at byte {part.start})"
        if not channels:
            part.counts = Counter(numbers.tolist())
        chosen = np.zeros(1 << 16, np.bool_)  # numpy.isin takes longer than all else here
        chosen[list(channels)] = True
        return messages.take(np.flatnonzero(chosen[numbers]))


def mcap_file(path: Path) -> MessageFile:
    """What an MCAP file defines and holds; its messages are read when they are asked for.

    Raises
    ------
    LogError
        If the truth in its metadata cannot be read.
    """
    found, counts, promised, why = _Contents(), Counter[int](), Counter[int](), ""
    with path.open("rb", buffering=_BUFFER_BYTES) as stream:
        size = stream.seek(0, io.SEEK_END)
        _walk(stream, size, found)
        try:
            found.define(_summary(stream, size), 0)
        except Exception as error:  # what the package raises of bytes that are no records
            why = str(error)
            found.records.clear()
        statistics = found.records.get((Opcode.STATISTICS, None))
        if statistics:
            promised.update(statistics.channel_message_counts)
            if any((Opcode.CHANNEL, number) not in found.records for number in promised):
                statistics, why = None, "it counts messages of channels that it does not define"
        found.damage += [f"its summary: {why}"] if why else []
        if not statistics or all(part.loose for part in found.parts):
            case = "summary" if why else "none"
            found.notices.append(Notice("DAMAGED_INDEX", numbers={"case": case, "why": why}))
        for part in found.parts:
            if part.loose or not statistics:
                lost = found.read(stream, part, frozenset())
                found.damage += [lost] if isinstance(lost, str) else []
            counts.update(part.counts or {})
    truth = None
    if not found.records.keys().isdisjoint(_TRUTH):  # of its name no checksum speaks
        with as_log_error("truth in the MCAP"):
            truth = loads(found.records[_TRUTH[0]].metadata[KEY]).truth
    channels = {}
    for (code, number), one in found.records.items():
        if code == Opcode.CHANNEL:
            schema = found.records.get((Opcode.SCHEMA, one.schema_id)) or Schema(0, b"", "", "")
            channels[number] = MessageChannel(
                one.topic,
                schema.name,
                one.message_encoding,
                schema.encoding,
                schema.data,
                one.metadata,
            )
    return MessageFile(
        str(path),
        channels,
        lambda channels: ahead(_batches(path, found, channels)),
        counts | promised,  # what is not there is lost
        statistics and (statistics.message_start_time, statistics.message_end_time),
        tuple(found.notices),
        found.damage,
        truth,
    )


def _read(stream: IO[bytes], start: int, length: int) -> bytes:
    stream.seek(start)
    content = stream.read(length)
    if len(content) != length:
        raise ValueError(f"bytes {start} to {start + length} cannot be read")
    return content


def _walk(stream: IO[bytes], size: int, found: _Contents) -> None:
    """Find the parts of a file up to its end, or to its first break."""
    place, last, data_end, code = len(MCAP), _Part(0, 0, loose=False), False, 0
    while code != Opcode.FOOTER:
        head = _read(stream, place, min(_INDEX.size, size - place))
        code, length, channel = _INDEX.unpack(head.ljust(_INDEX.size, b"\0"))
        end = place + _FRAME.size + length
        follows, loose = last.start + last.length == place, code != Opcode.CHUNK
        if (
            end > size
            or not (0 < code <= Opcode.DATA_END or code >= 0x80)
            or (code == Opcode.MESSAGE and length < _MESSAGE_BYTES)
            # its chunk is gone; behind what ends the data it may be a damaged footer
            or (code == Opcode.MESSAGE_INDEX and not data_end and (last.loose or not follows))
        ):
            break
        if code == Opcode.MESSAGE_INDEX and follows:
            last.length = end - last.start
            if length > _INDEX.size - _FRAME.size:
                last.counts = {**(last.counts or {}), channel: length // 16}
        elif code in (Opcode.CHUNK, Opcode.MESSAGE) or (code in _KINDS and not data_end):
            data_end = False  # it stood too early
            if loose and follows and last.loose and last.length < _LOOSE_BYTES:
                last.length = end - last.start
            else:
                last = _Part(place, end - place, loose)
                found.parts.append(last)
        place, data_end = end, data_end or code == Opcode.DATA_END
    left = size - place
    if data_end and (place < end or left <= len(MCAP)):
        return  # what breaks off behind the data is its summary
    case = "chunk" if code == Opcode.CHUNK else "record" if left else "end"
    found.notices.append(Notice("CUT_OFF", numbers={"case": case, "first": place, "bytes": left}))
    found.damage.append(f"it breaks off at byte {place}")
    if case == "chunk":
        found.parts.append(_Part(place, left, loose=False))


def _summary(stream: IO[bytes], size: int) -> Definitions:
    """Code and content of what a file's summary defines: nothing where it has none.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    tail = _read(stream, size - _FOOTER_BYTES, _FOOTER_BYTES)
    start, checksum = struct.unpack_from("<Q8xI", tail, _FRAME.size)
    if not tail.endswith(MCAP):
        raise ValueError("the file has no end: it was cut off")
    content = _read(stream, start, size - _FOOTER_BYTES - start) if start else b""
    if checksum and zlib.crc32(tail[:25], zlib.crc32(content)) != checksum:
        raise ValueError("its checksum is wrong")
    return _listed(content)[1]


def _records(stream: IO[bytes], part: _Part) -> tuple[Messages, NDArray[np.uint16], Definitions]:
    """The messages of a part, the channel (M,) of each, its definitions.

    Raises
    ------
    ValueError
        If it is damaged; the libraries raise more.
    """
    content, index, checked, torn = _read(stream, part.start, part.length), b"", False, False
    if not part.loose:
        end = _FRAME.size + _FRAME.unpack_from(content)[1]
        torn, index = end > len(content), content[end:]
        chunk = Chunk.read(ReadDataStream(io.BytesIO(content[_FRAME.size : end])))
        content, checked = _unpacked(chunk), chunk.uncompressed_crc != 0
        left = chunk.uncompressed_size - len(content)
        wrong = checked and zlib.crc32(content) != chunk.uncompressed_crc
        if left < 0 or (wrong if left == 0 else not torn):
            raise ValueError("a chunk's size or its checksum is wrong")
    octets: NDArray[np.uint8] = np.frombuffer(content, np.uint8)
    offsets, others, end = _listed(content, index)
    if end != len(content) and not torn:
        raise ValueError("its records do not fill it")
    heads = gather(octets, offsets, f"V{_HEAD.itemsize}").view(_HEAD)
    sizes = heads["f1"].astype(np.int64) - _MESSAGE_BYTES
    log_ns = heads["f4"].astype(np.int64)
    starts, checked = offsets + _HEAD.itemsize, checked or torn  # a torn one is told as such
    return Messages(octets[:end], starts, sizes, log_ns, checked), heads["f2"], others


def _unpacked(chunk: Chunk) -> bytes:
    """A chunk unpacked as far as its bytes go, with one byte too many where it holds more.

    Raises
    ------
    ValueError
        If it claims more memory than a recorder's chunk needs, or its packing is not known.
    """
    size, packed = chunk.uncompressed_size, chunk.compression
    if size > LIMITS.chunk_bytes or packed not in ("", "lz4", "zstd"):
        raise ValueError(
            f"a chunk of {size:,} bytes, packed with {packed!r}; expected at most "
            f"{LIMITS.chunk_bytes:,}, packed with lz4, zstd or not"
        )
    if packed == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
    if packed == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1))
    return chunk.data[: size + 1]


def _listed(content: bytes, index: bytes = b"") -> tuple[IntArray, Definitions, int]:
    """Offsets of the messages, the definitions, and where the last whole record ends.

    Records are found by their lengths; from the first message on by the message indexes behind a
    chunk, if what they list fills it: they have no checksum of their own.
    """
    offsets, others, place, size = list[int](), Definitions(), 0, len(content)
    while place + _FRAME.size <= size:
        code, length = _FRAME.unpack_from(content, place)
        end = place + _FRAME.size + length
        if end > size or (code == Opcode.MESSAGE and length < _MESSAGE_BYTES):
            break
        if code == Opcode.MESSAGE and index:
            listed, index = np.append(_indexed(index), size), b""
            steps = np.diff(listed)
            if listed[0] == place and steps.min() >= _HEAD.itemsize:
                octets: NDArray[np.uint8] = np.frombuffer(content, np.uint8)
                heads = gather(octets, listed[:-1], f"V{_FRAME.size}").view("u1, <i8")
                if np.all((heads["f0"] == code) & (heads["f1"] == steps - _FRAME.size)):
                    return listed[:-1], others, size
        if code == Opcode.MESSAGE:
            offsets.append(place)
        elif code in _KINDS:
            others.append((code, content[place + _FRAME.size : end]))
        place = end
    return np.array(offsets, np.int64), others, place


def _indexed(index: bytes) -> IntArray:
    """The offsets of messages that message indexes list, in their order in the chunk."""
    found, place = [np.empty(0, np.int64)], 0
    while place < len(index):
        entries = (_FRAME.unpack_from(index, place)[1] - 6) // 16
        found.append(np.frombuffer(index, "<i8", 2 * entries, place + _INDEX.size)[1::2])
        place += _INDEX.size + 16 * entries
    return np.sort(np.concatenate(found))


def _batches(path: Path, found: _Contents, channels: frozenset[int]) -> Iterator[Messages | str]:
    """The messages of `channels` in file order; or why a part of them is lost."""
    with path.open("rb", buffering=_BUFFER_BYTES) as stream:
        for part in found.parts:
            if part.counts is None or not channels.isdisjoint(part.counts):
                yield found.read(stream, part, channels)
