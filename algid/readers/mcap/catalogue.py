"""Contents of an MCAP file by place: from its summary if valid, else by walking through it.

The summary is trusted when its CRC, the counts of its statistics and the message indexes agree,
and when nothing but other records lies between the chunks that it lists. Everything else, a file
cut off for one, is walked from its start, record by record and past what is broken.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from algid.errors import LogError
from algid.limits import LIMITS
from algid.log import KEY, Truth, loads
from algid.notices import Notice
from algid.readers.mcap import framing
from algid.readers.mcap.framing import ChunkIndex, DamagedError, File, claimed, parse, unpack
from algid.readers.mcap.records import Records, records_in
from algid.readers.mcap.salvage import Gap, salvaged
from algid.words import counted

_SPAN = 1 << 23
_LOOSE, _TORN = -1, -2


@dataclass(frozen=True)
class Span:
    """Adjacent records of the file: a chunk with its message indexes, or loose records.

    `channels` are those that the index names; None where nobody knows. `torn`: a chunk that breaks
    off.
    """

    start: int
    length: int
    index_length: int = 0
    channels: frozenset[int] | None = None
    loose: bool = False
    torn: bool = False

    def records(self, file: File, content: bytes) -> Records:
        """The records within, out of the span's bytes and those of the indexes behind it.

        Raises
        ------
        DamagedError
            If they are not what the format says, or more than in any honest file.
        """
        if self.loose:
            return records_in(content[: self.length], works=file.works)
        inside, index = memoryview(content)[: self.length], memoryview(content)[self.length :]
        file.unpacks(claimed(inside))
        return records_in(unpack(inside, torn=self.torn), index, file.works)


@dataclass
class Catalogue:
    """Schemas and channels by id, spans in file order, messages by channel where counted.

    `damage` names the places where bytes were met that are not what the format says. `redefined`
    says from which byte on an id no longer means what it meant before.
    """

    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    counts: dict[int, int] | None = None
    span_ns: tuple[int, int] | None = None
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notices: list[Notice] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    redefined: dict[int, int] = field(default_factory=dict)
    beside: dict[frozenset[int], dict[int, int]] = field(default_factory=dict)
    """By channels read: redefinitions in chunks of other ones, found once for all passes."""
    _agreed: dict[tuple[int, bytes], Any] = field(default_factory=dict, repr=False)

    def copy(self) -> Catalogue:
        """A copy that reading may add damage and redefined ids to."""
        return replace(self, damage=list(self.damage), redefined=dict(self.redefined))

    def redefines(self, others: Iterable[tuple[int, bytes]], place: int) -> None:
        """Record the byte from which ids have another meaning, from code and content of `others`.

        Raises
        ------
        DamagedError
            If a record cannot be read.
        """
        for code, content in others:
            if code in (framing.SCHEMA, framing.CHANNEL):
                try:
                    self.checked(code, content)
                except RedefinedError as error:
                    for channel in error.channels:
                        self.redefined[channel] = min(place, self.redefined.get(channel, place))

    def truth(self, path: Path) -> Truth | None:
        """What the metadata record "algid" tells of the simulated arm, None without one.

        Raises
        ------
        LogError
            If the record is there and cannot be read.
        """
        if KEY not in self.metadata:
            return None
        try:
            return loads(self.metadata[KEY].get(KEY, "")).truth
        except ValueError as error:
            raise LogError(
                f"{path}: the truth in the file's metadata cannot be read ({error})"
            ) from error

    def define(self, code: int, content: bytes) -> None:
        """Take in the content of a schema's or a channel's record; the first of an id holds.

        Raises
        ------
        DamagedError
            If the record cannot be read.
        RedefinedError
            If its id has another meaning already.
        """
        one = self.checked(code, content)
        (self.schemas if code == framing.SCHEMA else self.channels).setdefault(one.id, one)

    def checked(self, code: int, content: bytes) -> Any:
        """A schema or a channel as its record says, that has no other meaning yet: see `define`."""
        from mcap import records

        if (code, content) in self._agreed:  # recorders repeat them in every chunk
            return self._agreed[code, content]
        kind, known = (
            (records.Schema, self.schemas)
            if code == framing.SCHEMA
            else (records.Channel, self.channels)
        )
        one = parse(kind, content)
        if known.get(one.id, one) != one:
            text = f"{kind.__name__.lower()} {one.id} is defined anew and differently"
            using = (
                channel.id for channel in self.channels.values() if channel.schema_id == one.id
            )
            raise RedefinedError(text, [one.id] if code == framing.CHANNEL else using)
        if one.id in known:
            self._agreed[code, content] = one
        return one


class RedefinedError(DamagedError):
    """A record that gives an id another meaning; `channels` are those concerned."""

    def __init__(self, text: str, channels: Iterable[int]) -> None:
        super().__init__(text)
        self.channels = tuple(channels)


def catalogue(file: File) -> Catalogue:
    """The catalogue of an opened file; `DamagedError` only where not even the start can be read."""
    if file.size < len(framing.MAGIC) or file.read(0, len(framing.MAGIC)) != framing.MAGIC:
        raise DamagedError("the file does not begin as MCAP does")
    notice, damage = Notice("NO_INDEX"), []
    try:
        index = _from_summary(file)
    except DamagedError as error:
        index = None
        damage = [f"its summary: {error}"]
        notice = Notice("DAMAGED_SUMMARY", numbers={"why": str(error)})
    if index is not None:
        return index
    walked = _walked(file)
    walked.notices.insert(0, notice)
    walked.damage[:0] = damage
    return walked


def _from_summary(file: File) -> Catalogue | None:
    """What a summary says that can be trusted, None where there is none that tells enough."""
    from mcap import records

    start, content = framing.summary(file)
    index, statistics, metadata = Catalogue(), None, []
    chunks: list[ChunkIndex] = []
    for record in framing.walk_bytes(content, 0, len(content)):
        body = content[record.start : record.end]
        if record.code in (framing.SCHEMA, framing.CHANNEL):
            index.define(record.code, body)
        elif record.code == framing.CHUNK_INDEX:
            chunks.append(framing.chunk_index(body))
        elif record.code == framing.STATISTICS:
            statistics = parse(records.Statistics, body)
        elif record.code == framing.METADATA_INDEX:
            metadata.append(parse(records.MetadataIndex, body))
    if statistics is None or not chunks or not index.channels:
        return None
    chunks.sort(key=lambda one: one.chunk_start_offset)
    _check_listed(file, chunks, statistics, index.channels, start)
    index.counts = dict(statistics.channel_message_counts)
    index.span_ns = (statistics.message_start_time, statistics.message_end_time)
    for chunk in chunks:
        channels = frozenset(chunk.message_index_offsets) if chunk.message_index_length else None
        place, length = chunk.chunk_start_offset + 9, chunk.chunk_length - 9
        index.spans.append(Span(place, length, chunk.message_index_length, channels))
    for one in metadata:
        if one.name == KEY and KEY not in index.metadata:
            _keep_metadata(
                file, framing.Record(framing.METADATA, one.offset + 9, one.length - 9), index
            )
    return index


def _check_listed(
    file: File, chunks: list[ChunkIndex], statistics: Any, channels: Collection[int], end: int
) -> None:
    """Check a summary's list against its own counts and the file, up to the summary at `end`.

    Chunks lie in the file and do not overlap, their indexes list as many messages as the
    statistics count, for every channel, all of which are among those defined, and no message,
    chunk or index stands beside those that are listed.

    Raises
    ------
    DamagedError
        If any of that is not so.
    """
    for chunk in chunks:
        if not (chunk.chunk_length > 9 and _end(chunk) <= file.size):
            raise DamagedError(f"it claims a chunk at byte {chunk.chunk_start_offset}")
    if statistics.chunk_count != len(chunks):
        raise DamagedError(f"it lists {len(chunks)} of {counted(statistics.chunk_count, 'chunk')}")
    if sum(len(chunk.message_index_offsets) for chunk in chunks) > LIMITS.message_indexes:
        raise DamagedError(f"it claims more than {LIMITS.message_indexes} message indexes")
    counts: dict[int, int] = {}
    for chunk in chunks:
        for channel, count in _indexed(file, chunk):
            counts[channel] = counts.get(channel, 0) + count
    if undefined := counts.keys() - channels:
        raise DamagedError(
            f"it lists messages of a channel {min(undefined)} that it does not define"
        )
    promised = {
        channel: count for channel, count in statistics.channel_message_counts.items() if count
    }
    if all(chunk.message_index_length for chunk in chunks) and counts != promised:
        raise DamagedError("its indexes and its statistics count different numbers of messages")
    indexed = {_end(chunk) for chunk in chunks if chunk.message_index_length}
    for start, stop in between(chunks, end):
        if start > stop:
            raise DamagedError(f"its chunks overlap at byte {stop}")
        for record in framing.walk(file, start, stop):
            hidden = record.code == framing.MESSAGE_INDEX and start in indexed
            if hidden or record.code in (framing.CHUNK, framing.MESSAGE):
                raise DamagedError(f"it does not list what stands at byte {record.start - 9}")


def _indexed(file: File, chunk: ChunkIndex) -> Iterator[tuple[int, int]]:
    """Channel and number of messages of each index behind a chunk.

    Raises
    ------
    DamagedError
        If one that is listed is not there, or one that is there is not listed: its messages would
        not be read.
    """
    listed = 0
    for channel, offset in chunk.message_index_offsets.items():
        code, length, named, size = struct.unpack("<BQHI", file.read(offset, 15))
        if code != framing.MESSAGE_INDEX or named != channel or size % 16:
            raise DamagedError(f"it claims a message index at byte {offset}")
        listed += 9 + length
        yield channel, size // 16
    if listed == chunk.message_index_length:
        return
    start = chunk.chunk_start_offset + chunk.chunk_length
    # what stands there though it is not listed
    for record in framing.walk(file, start, _end(chunk)):
        channel, size = struct.unpack("<HI", file.read(record.start, 6))
        if record.code != framing.MESSAGE_INDEX or (
            size and channel not in chunk.message_index_offsets
        ):
            raise DamagedError(f"it does not list what stands at byte {record.start - 9}")


def _end(chunk: ChunkIndex) -> int:
    """Where a chunk and its indexes end."""
    return chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length


def between(chunks: list[ChunkIndex], end: int) -> list[tuple[int, int]]:
    """Bytes [start, end) between chunks and their indexes, in file order up to the summary."""
    apart = []
    last = len(framing.MAGIC)
    for chunk in chunks:
        if chunk.chunk_start_offset != last:
            apart.append((last, chunk.chunk_start_offset))
        last = _end(chunk)
    if last != end:
        apart.append((last, end))
    return apart


def _walked(file: File) -> Catalogue:
    """Everything there is up to the end, or to where the file breaks off."""
    index, spans = Catalogue(), _Spans()
    gaps: list[Gap] = []
    ended = None
    try:
        for record in salvaged(file, len(framing.MAGIC)):
            if isinstance(record, Gap):
                gaps.append(record)
                if record.torn is not None:  # what there is of a chunk that breaks off
                    spans.append(record.torn.start, record.end - record.torn.start, _TORN)
            elif record.code == framing.DATA_END:
                ended = record.start
            elif (
                record.code in (framing.SCHEMA, framing.CHANNEL)
                and record.length <= LIMITS.record_bytes
            ):
                _define(index, record.code, file.read(record.start, record.length), record.start)
            elif record.code == framing.METADATA:
                _keep_metadata(file, record, index)
            elif spans.add(record):
                ended = None  # data behind the end of the data: there was none
    except DamagedError as error:
        gaps.append(Gap(file.size, file.size))
        index.damage.append(str(error))
    index.notices += _missing(file, gaps, ended, index)
    for span in spans.all():
        try:
            records = span.records(file, file.read(span.start, span.length + span.index_length))
        except DamagedError as error:  # reported when it is read
            index.damage.append(f"{error} (at byte {span.start})")
            index.spans.append(span)
            continue
        index.spans.append(replace(span, channels=records.channels_seen))
        for code, body in records.others:
            if code in (framing.SCHEMA, framing.CHANNEL):
                _define(index, code, body, span.start)
    return index


@dataclass
class _Spans:
    """Gathers spans out of the records of a file, in their order."""

    _places: list[list[int]] = field(default_factory=list)
    """Start and length, and the length of a chunk's index, _LOOSE or _TORN."""

    def add(self, record: framing.Record) -> bool:
        """Take in a record; whether it holds data."""
        last = self._places[-1] if self._places else [0, 0, 0]
        if record.code == framing.CHUNK:
            self.append(record.start, record.length, 0)
        elif record.code == framing.MESSAGE:
            if last[2] == _LOOSE and last[0] + last[1] == record.start - 9 and last[1] < _SPAN:
                last[1] += record.length + 9
            else:
                self.append(record.start - 9, record.length + 9, _LOOSE)
        elif (
            record.code == framing.MESSAGE_INDEX and last[2] >= 0 and sum(last) == record.start - 9
        ):
            last[2] += record.length + 9
        return record.code in (framing.CHUNK, framing.MESSAGE)

    def append(self, start: int, length: int, kind: int) -> None:
        """Take in a span of its own."""
        if len(self._places) == LIMITS.spans:
            raise DamagedError(
                f"more than {LIMITS.spans} chunks, or messages apart from each other"
            )
        self._places.append([start, length, kind])

    def all(self) -> list[Span]:
        """The spans so far."""
        spans = []
        for start, length, kind in self._places:
            loose, torn = kind == _LOOSE, kind == _TORN
            spans.append(Span(start, length, max(0, kind), loose=loose, torn=torn))
        return spans


def _missing(file: File, gaps: list[Gap], ended: int | None, found: Catalogue) -> list[Notice]:
    """What to say of gaps in the data, and of a file that breaks off.

    `ended` is where the data end, if they do.
    """
    inside = [gap for gap in gaps if ended is None or gap.start < ended]
    last = inside.pop() if inside and inside[-1].end == file.size else None
    said = []
    if inside:
        size = 0
        for gap in inside:
            size += gap.end - gap.start
            found.damage.append(f"no record at byte {gap.start}")
        numbers = {"bytes": size, "places": len(inside), "first": inside[0].start}
        said.append(Notice("BROKEN_RECORD", numbers=numbers, lossy=True))

    if last is not None:
        case = "chunk" if last.torn else "record"
        unfinished = {"case": case, "bytes": last.end - last.start}
        said.append(Notice("CUT_OFF", numbers=unfinished, lossy=True))
        found.damage.append(f"it breaks off at byte {last.start}")
    elif ended is None:
        said.append(Notice("CUT_OFF", numbers={"case": "end"}, lossy=True))
    return said


def _define(found: Catalogue, code: int, content: bytes, place: int) -> None:
    """Take in a schema or a channel.

    From `place` on nothing is read of what it gives another meaning.
    """
    try:
        found.define(code, content)
    except RedefinedError as error:
        for channel in error.channels:
            found.redefined.setdefault(channel, place)
    except DamagedError as error:
        found.notices.append(Notice("DAMAGED_RECORD", numbers={"why": str(error)}, lossy=True))
        found.damage.append(str(error))


def _keep_metadata(file: File, record: framing.Record, found: Catalogue) -> None:
    from mcap import records

    if record.length > LIMITS.record_bytes:
        return
    try:
        metadata = parse(records.Metadata, file.read(record.start, record.length))
        found.metadata.setdefault(metadata.name, metadata.metadata)
    except DamagedError as error:
        found.notices.append(Notice("DAMAGED_RECORD", numbers={"why": str(error)}))
