"""What an MCAP file holds and where: from its summary where that can be trusted, else by walking through it.

The summary is trusted when its CRC, the counts of its statistics and the message indexes agree. Everything
else, a file cut off for one, is walked from its start, record by record.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from algid.log import Notice
from algid.readers.mcap import framing
from algid.readers.mcap.framing import BrokenOffError, DamagedError, File, parse, unpack, unpack_torn
from algid.readers.mcap.messages import alike

_FOOTER_SIZE = 9 + 20 + 8
_LARGEST_SUMMARY = 1 << 28
_SPAN = 1 << 23


@dataclass(frozen=True)
class Span:
    """Records side by side in the file: a chunk with the message indexes behind it, or loose records.

    `channels` are those that the index names; None where nobody knows. `torn`: a chunk that breaks off.
    """

    start: int
    length: int
    index_length: int = 0
    channels: frozenset[int] | None = None
    loose: bool = False
    torn: bool = False


@dataclass
class Catalogue:
    """Schemas and channels by id, spans in file order, messages by channel where counted.

    `damage` names the places where bytes were met that are not what the format says.
    """

    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    counts: dict[int, int] | None = None
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notices: list[Notice] = field(default_factory=list)
    walked: bool = False
    damage: list[str] = field(default_factory=list)


def catalogue(file: File) -> Catalogue:
    """The catalogue of an opened file; `DamagedError` only where not even the start can be read."""
    if file.size < len(framing.MAGIC) or file.read(0, len(framing.MAGIC)) != framing.MAGIC:
        raise DamagedError("the file does not begin as MCAP does")
    notice, damage = Notice("NO_INDEX", "the file has no usable index; read by scanning"), []
    try:
        found = _from_summary(file)
    except DamagedError as error:
        found = None
        damage = [f"its summary: {error}"]
        notice = Notice("DAMAGED_SUMMARY", f"the file's summary cannot be used ({error}); read by scanning")
    if found is not None:
        return found
    walked = _walked(file)
    walked.notices.insert(0, notice)
    walked.damage[:0] = damage
    return walked


def _from_summary(file: File) -> Catalogue | None:
    from mcap import records

    tail = file.read(max(0, file.size - _FOOTER_SIZE), min(_FOOTER_SIZE, file.size))
    if len(tail) < _FOOTER_SIZE or tail[-8:] != framing.MAGIC:
        raise DamagedError("the file has no end: it was cut off")
    code, length, start, _, crc = struct.unpack("<BQQQI", tail[:-8])
    end = file.size - _FOOTER_SIZE
    if code != framing.FOOTER or length != 20:
        raise DamagedError("its footer is damaged")
    if start == 0:
        return None
    if not 8 <= start <= end or end - start > _LARGEST_SUMMARY:
        raise DamagedError(f"its footer claims a summary at byte {start}")
    content = file.read(start, end - start)
    if crc and zlib.crc32(tail[:25], zlib.crc32(content)) != crc:
        raise DamagedError("its checksum is wrong")
    found, statistics, chunks, metadata = Catalogue(), None, [], []
    for record in framing.walk_bytes(content, 0, len(content)):
        body = content[record.start : record.end]
        if record.code == framing.SCHEMA:
            schema = parse(records.Schema, body)
            found.schemas[schema.id] = schema
        elif record.code == framing.CHANNEL:
            channel = parse(records.Channel, body)
            found.channels[channel.id] = channel
        elif record.code == framing.CHUNK_INDEX:
            chunks.append(parse(records.ChunkIndex, body))
        elif record.code == framing.STATISTICS:
            statistics = parse(records.Statistics, body)
        elif record.code == 0x0D:
            metadata.append(parse(records.MetadataIndex, body))
    if statistics is None or not chunks or not found.channels:
        return None
    found.counts = dict(statistics.channel_message_counts)
    found.spans = [_chunk_span(file, chunk) for chunk in sorted(chunks, key=lambda one: one.chunk_start_offset)]
    _check_counts(file, chunks, statistics)
    for place in metadata:
        _keep_metadata(file, framing.Record(framing.METADATA, place.offset + 9, place.length - 9), found)
        if place.name not in found.metadata:
            text = f"the metadata record {place.name!r} is damaged and was left out"
            found.notices.append(Notice("DAMAGED_RECORD", text))
    return found


def _chunk_span(file: File, chunk: Any) -> Span:
    start, length = chunk.chunk_start_offset + 9, chunk.chunk_length - 9
    if not (length > 0 and start + length + chunk.message_index_length <= file.size):
        raise DamagedError(f"it claims a chunk at byte {chunk.chunk_start_offset}")
    channels = frozenset(chunk.message_index_offsets) if chunk.message_index_length else None
    return Span(start, length, chunk.message_index_length, channels)


def _check_counts(file: File, chunks: list[Any], statistics: Any) -> None:
    """Compare the messages that the indexes list with those that the statistics count, for every channel."""
    if statistics.chunk_count != len(chunks):
        raise DamagedError(f"it lists {len(chunks)} of {statistics.chunk_count} chunks")
    if any(not chunk.message_index_length for chunk in chunks):
        return
    listed: dict[int, int] = {}
    for chunk in chunks:
        for channel, offset in chunk.message_index_offsets.items():
            code, _, named, size = struct.unpack("<BQHI", file.read(offset, 15))
            if code != framing.MESSAGE_INDEX or named != channel or size % 16:
                raise DamagedError(f"it claims a message index at byte {offset}")
            listed[channel] = listed.get(channel, 0) + size // 16
    counted = {channel: count for channel, count in statistics.channel_message_counts.items() if count}
    if listed != counted:
        raise DamagedError("its indexes and its statistics count different numbers of messages")


def _walked(file: File) -> Catalogue:
    """Everything there is up to the end, or to where the file breaks off."""
    found = Catalogue(walked=True)
    spans: list[list[Any]] = []
    loose: list[int] | None = None
    end = 8
    try:
        for record in framing.walk(file, 8, file.size):
            if record.code == framing.DATA_END:
                end = file.size
                break
            if record.code == framing.MESSAGE:
                if loose is None or loose[1] != record.start - 9 or record.end - loose[0] > _SPAN:
                    loose = [record.start - 9, record.end]
                    spans.append([loose, None])
                loose[1] = record.end
            else:
                _place(file, record, found, spans)
            end = record.end
    except DamagedError as error:
        last = error.record if isinstance(error, BrokenOffError) else None
        torn = [Span(last.start, file.size - last.start, torn=True)] if last and last.code == framing.CHUNK else []
        told = "chunk, read as far as it goes" if torn else "record and were left out"
        text = f"the file breaks off: its last {file.size - end} bytes are an unfinished {told}"
        found.notices.append(Notice("CUT_OFF", text, lossy=True))
        found.damage.append(f"it breaks off at byte {end}")
    else:
        torn = []
        if end != file.size:
            text = "the file breaks off behind its last whole record"
            found.notices.append(Notice("CUT_OFF", text, lossy=True))
    found.spans = [_span(*span) for span in spans] + torn
    _inner_channels(file, found)
    return found


def _span(place: list[int], index: int | None) -> Span:
    if index is None:
        return Span(place[0], place[1] - place[0], loose=True)
    return Span(place[0], place[1], index)


def _place(file: File, record: framing.Record, found: Catalogue, spans: list[list[Any]]) -> None:
    if record.code == framing.CHUNK:
        spans.append([[record.start, record.length], 0])
    elif record.code == framing.MESSAGE_INDEX and spans and spans[-1][1] is not None:
        spans[-1][1] += record.length + 9
    elif record.code in (framing.SCHEMA, framing.CHANNEL) and record.length <= framing.SMALL_RECORD:
        _define(record.code, file.read(record.start, record.length), found)
    elif record.code == framing.METADATA:
        _keep_metadata(file, record, found)


def _define(code: int, content: bytes, found: Catalogue) -> None:
    """Take in a schema or a channel; the first of an id holds, as in every other reader."""
    from mcap import records

    try:
        if code == framing.SCHEMA:
            schema = parse(records.Schema, content)
            found.schemas.setdefault(schema.id, schema)
        else:
            channel = parse(records.Channel, content)
            found.channels.setdefault(channel.id, channel)
    except DamagedError as error:
        found.notices.append(Notice("DAMAGED_RECORD", f"{error}; left out", lossy=True))
        found.damage.append(str(error))


def _inner_channels(file: File, found: Catalogue) -> None:
    """Schemas and channels that stand within chunks; damaged chunks are told of when they are read."""
    for span in found.spans:
        if span.loose:
            continue
        try:
            packed = file.read(span.start, span.length)
            content = unpack_torn(packed)[0] if span.torn else unpack(packed)
            if alike(np.frombuffer(content, np.uint8)) is not None:
                continue
            for record in framing.walk_bytes(content, 0, len(content)):
                if record.code in (framing.SCHEMA, framing.CHANNEL):
                    _define(record.code, bytes(content[record.start : record.end]), found)
        except DamagedError as error:
            found.damage.append(f"{error} (at byte {span.start})")


def _keep_metadata(file: File, record: framing.Record, found: Catalogue) -> None:
    from mcap import records

    if record.length > framing.SMALL_RECORD:
        return
    try:
        metadata = parse(records.Metadata, file.read(record.start, record.length))
        found.metadata[metadata.name] = metadata.metadata
    except DamagedError as error:
        found.notices.append(Notice("DAMAGED_RECORD", f"{error}; left out"))


def truth_text(found: Catalogue) -> str | None:
    """The JSON text of the metadata record "algid", None without one, empty where the record is damaged."""
    from algid.log import KEY

    return found.metadata[KEY].get(KEY, "") if KEY in found.metadata else None


def channels_of(found: Catalogue, topic: str, type_name: str) -> frozenset[int]:
    """Ids of the channels that carry a topic with messages of one type."""
    return frozenset(
        number
        for number, channel in found.channels.items()
        if channel.topic == topic and schema_name(found, channel) == type_name
    )


def schema_name(found: Catalogue, channel: Any) -> str:
    """The type of a channel's messages, or nothing."""
    schema = found.schemas.get(channel.schema_id)
    return "" if schema is None else str(schema.name)
