"""ROS 1 bags (format 2.0): chunks of records, walked from the start.

A record is a header of fields ``name=value`` and data, each with its length before it. Chunks hold
the messages; behind each stand the indexes of its messages by connection, at the end of the file
the connections (topics) and what is in which chunk. All that is redundant: the file's own records
are what is believed, and a chunk is passed over only where everything that is said of it agrees. A
bag has no checksums.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from algid.errors import LogError
from algid.limits import LIMITS
from algid.notices import Notice
from algid.readers.bags.records import (
    BAG,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MESSAGE,
    SIZE,
    BagError,
    BagRecord,
    ChunkMessages,
    Others,
    connection,
    fields_of,
    indexed,
    nanoseconds,
    unpacked,
    walked,
)
from algid.readers.messages.batch import MessageBatch, Messages
from algid.readers.messages.source import MessageChannel, Source
from algid.readers.opened import OpenedFile
from algid.words import counted

MAGIC = b"#ROSBAG V2.0\n"
_PEEK = 1 << 9
"""Bytes that are read at once of a record: its header as a rule."""
_INDEX_ENTRY, _INFO_ENTRY = 12, 8
_LOOSE_BYTES = 1 << 23


@dataclass(frozen=True)
class BagPart:
    """A chunk, or records outside of any: where its data start and end, and what its indexes list.

    `indexes` has by connection where its index stands and how many messages that lists; `torn`:
    the file ends within.
    """

    start: int
    end: int
    packing: str
    size: int
    torn: bool = False
    loose: bool = False
    indexes: dict[int, tuple[int, int]] = field(default_factory=dict)

    @property
    def counts(self) -> dict[int, int]:
        """The messages by connection, of those that have any."""
        return {number: count for number, (_, count) in self.indexes.items() if count}


@dataclass
class BagLayout:
    """Result of a walk over a bag: connections, parts in file order, and whether all agrees."""

    channels: dict[int, MessageChannel] = field(default_factory=dict)
    parts: list[BagPart] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    agreed: bool = True
    span_ns: tuple[int, int] | None = None


Bags = dict[tuple[Path, int, int], BagLayout]
"""Layouts by path, size and time of change: several passes go over a log."""


@contextmanager
def bag_messages(path: Path, known: Bags | None = None) -> Iterator[Ros1Source]:
    """The messages of a ROS 1 bag.

    Raises
    ------
    LogError
        If the file is no such bag, or it is encrypted.
    """
    with _File(path) as file:
        key = (path, file.size, file.changed_ns)
        layout = None if known is None else known.get(key)
        try:
            layout = layout or _layout(file)
        except BagError as error:
            raise LogError(
                f"{path}: the bag cannot be read ({error}); copy it again, or rosbag reindex"
            ) from error
        if known is not None:
            known[key] = layout
        yield Ros1Source(file, layout)


class _File(OpenedFile):
    """An opened bag."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, BagError)

    def record(self, place: int) -> BagRecord:
        """The record at an offset; its data may reach past the end."""
        head = self.read(place, min(_PEEK, self.size - place))
        if len(head) < 2 * SIZE.size:
            raise BagError("a record breaks off")
        (length,) = SIZE.unpack_from(head)
        if length > LIMITS.bag_header_bytes:
            raise BagError(f"what stands at byte {place} is no record")
        start = place + length + 2 * SIZE.size
        if len(head) < start - place:
            head = self.read(place, start - place)
        (size,) = SIZE.unpack_from(head, SIZE.size + length)
        return BagRecord(fields_of(head[SIZE.size : SIZE.size + length]), start, start + size)


def _layout(file: _File) -> BagLayout:
    """What there is in a bag, up to its end or to where it breaks off."""
    if file.size < len(MAGIC) or file.read(0, len(MAGIC)) != MAGIC:
        raise BagError("it does not begin as one of format 2.0 does")
    walk = _Outline(file)
    place = len(MAGIC)
    for _ in range(LIMITS.bag_records):
        if place >= file.size:
            return walk.layout()
        try:
            record = file.record(place)
            walk.add(record, place)
        except BagError as error:
            walk.broken(place, str(error))
            return walk.layout()
        place = record.end
    raise BagError(f"it has more than {LIMITS.bag_records} records outside its chunks")


class _Outline:
    """Gathers a bag's layout out of its records, in their order."""

    def __init__(self, file: _File) -> None:
        self._file = file
        self._found = BagLayout()
        self._head: BagRecord | None = None
        self._starts: list[int] = []
        """Where the record of each part starts."""
        self._indexed_counts: dict[int, dict[int, int]] = {}
        """What the end of the file tells: by a chunk's start the messages of each connection."""
        self._times: list[int] = []
        self._tail: int | None = None
        self._claimed = 0

    def add(self, record: BagRecord, place: int) -> None:
        """Take in the record at byte `place`.

        Raises
        ------
        BagError
            If it is not what its kind asks for, or reaches past the end of the file.
        LogError
            If the bag is encrypted.
        """
        code = record.code
        if code == CHUNK:
            self._chunk(record, place)
        elif code == INDEX and self._found.parts:
            self._index(record)
        elif code == CONNECTION and not self._is_open():
            self._tail = place if self._tail is None else self._tail
            self._connection(record)
        elif code in (CONNECTION, MESSAGE):
            self._loose(record, place)
        elif code == CHUNK_INFO:
            self._info(record)
        elif code == BAG:
            self._head = record
            if encryptor := record.text("encryptor"):
                raise LogError(
                    f"{self._file.path}: the bag is encrypted ({encryptor[:40]}); decrypt it first"
                )
        if record.end > self._file.size:
            raise BagError("a record breaks off")

    def _chunk(self, record: BagRecord, place: int) -> None:
        size = record.number("size")
        if max(size, record.end - record.start) > LIMITS.bag_record_bytes:
            raise BagError(
                f"a chunk claims {counted(size, 'byte')}, more than {LIMITS.bag_record_bytes}"
            )
        self._claimed += size
        if self._claimed > LIMITS.free_unpacked_bytes + LIMITS.unpacked_a_byte * self._file.size:
            raise BagError(f"its chunks claim {counted(self._claimed, 'byte')} so far")
        end = min(record.end, self._file.size)
        part = BagPart(record.start, end, record.text("compression"), size, torn=record.end > end)
        self._found.parts.append(part)
        self._starts.append(place)

    def _index(self, record: BagRecord) -> None:
        indexes, number = self._found.parts[-1].indexes, record.number("conn")
        count = record.number("count")
        if record.end - record.start != count * _INDEX_ENTRY or number in indexes:
            self._found.agreed = False
        else:
            indexes[number] = (record.start, count)

    def _is_open(self) -> bool:
        """Whether records stand outside of chunks: after a chunk's head that was never closed."""
        last = self._found.parts[-1] if self._found.parts else None
        return last is not None and (last.loose or last.start == last.end)

    def _loose(self, record: BagRecord, place: int) -> None:
        last = self._found.parts[-1] if self._found.parts else None
        end = min(record.end, self._file.size)
        if (
            last is not None
            and last.loose
            and last.end == place
            and last.end - last.start < _LOOSE_BYTES
        ):
            self._found.parts[-1] = replace(last, end=end, size=end - last.start)
        else:
            self._found.parts.append(
                BagPart(place, end, "none", end - place, torn=True, loose=True)
            )
            self._starts.append(place)
        self._found.agreed = False

    def _connection(self, record: BagRecord) -> None:
        number, channel = connection(
            record.fields, self._file.read(record.start, record.end - record.start)
        )
        if self._found.channels.setdefault(number, channel) != channel:
            raise BagError(f"connection {number} is defined anew and differently")

    def _info(self, record: BagRecord) -> None:
        data = self._file.read(record.start, record.end - record.start)
        pairs = struct.iter_unpack("<II", data) if len(data) % _INFO_ENTRY == 0 else ()
        self._indexed_counts[record.number("chunk_pos", 8)] = {
            number: count for number, count in pairs if count
        }
        for name in ("start_time", "end_time"):
            self._times.append(nanoseconds(record.number(name, 8)))

    def broken(self, place: int, why: str) -> None:
        """Note that nothing is read from byte `place` on."""
        rest = self._file.size - place
        numbers = {"case": "bag", "place": place, "why": why, "bytes": rest}
        self._found.notices.append(Notice("CUT_OFF", numbers=numbers, lossy=True))
        self._found.damage.append(f"{why} at byte {place}")

    def layout(self) -> BagLayout:
        """What was found, once the walk is at its end."""
        summary = self._found
        wrong, lost = self._wrong()
        if wrong and not summary.notices:
            if lost:
                numbers = {"case": "index", "why": wrong}
                summary.notices.append(Notice("CUT_OFF", numbers=numbers, lossy=True))
            else:
                summary.notices.append(Notice("DAMAGED_INDEX", numbers={"why": wrong}))
        summary.agreed = summary.agreed and not wrong and not summary.notices
        summary.span_ns = (min(self._times), max(self._times)) if self._times else None
        return summary

    def _wrong(self) -> tuple[str, bool]:
        """What the bag tells of itself otherwise than it is, and whether something is missing."""
        head, summary = self._head, self._found
        if head is None or head.number("index_pos", 8) == 0:
            return "it was not closed, so what its recorder still held is lost", True
        own = {}
        for start, part in zip(self._starts, summary.parts, strict=True):
            own[start] = part.counts
        chunks, connections = head.number("chunk_count"), head.number("conn_count")
        if chunks != len(summary.parts):
            return (
                f"it tells of {counted(chunks, 'chunk')} and has {len(summary.parts)}",
                chunks > len(summary.parts),
            )
        if connections != len(summary.channels):
            return (
                f"it tells of {counted(connections, 'connection')} and has {len(summary.channels)}",
                False,
            )
        if self._tail is not None and head.number("index_pos", 8) != self._tail:
            return f"it tells of an index at byte {head.number('index_pos', 8)}", False
        return (
            "chunks hold other messages than it tells" if own != self._indexed_counts else ""
        ), False


class Ros1Source(Source):
    """The messages of a bag that is open."""

    def __init__(self, file: _File, layout: BagLayout) -> None:
        self.path = str(file.path)
        self.channels = self._channels = dict(layout.channels)
        self.notices, self.damage = layout.notices, list(layout.damage)
        self.span_ns = layout.span_ns
        self._file, self._layout = file, layout
        self._left = LIMITS.free_work + LIMITS.work_a_byte * file.size
        if layout.agreed:
            self.counts = dict.fromkeys(self.channels, 0)
            for part in layout.parts:
                for number, count in part.counts.items():
                    self.counts[number] = self.counts.get(number, 0) + count
        else:
            self._define_inside()

    def _define_inside(self) -> None:
        """Take in the connections that chunks define.

        What contradicts them is reported when it is read.
        """
        for part in self._layout.parts:
            try:
                self._define(self._records(part)[1])
            except BagError:
                continue

    def _define(self, others: Others) -> None:
        for fields, data in others:
            number, channel = connection(fields, data)
            if self._channels.setdefault(number, channel) != channel:
                raise BagError(f"connection {number} is defined anew and differently")

    def works(self, steps: int) -> bool:
        """Count steps of some microsecond each.

        False where no honest file of this size asks for so many.
        """
        self._left -= steps
        return self._left >= 0

    def batches(self, channels: frozenset[int]) -> Iterator[MessageBatch]:
        """The messages of `channels` in file order; a damaged chunk yields its reason.

        Nothing is read behind a connection that is given another meaning.
        """  # noqa: DOC501  # what is raised is caught here: it is why the chunk is lost
        redefined = ""
        for part in self._layout.parts:
            if self._layout.agreed and not channels & part.indexes.keys():
                continue
            counts = part.counts
            promised = sum(counts.get(number, 0) for number in channels)
            place = f"(at byte {part.start})"
            try:
                records, others = self._records(part)
                try:
                    self._define(others)
                except BagError as error:
                    redefined = redefined or str(error)
                if redefined:
                    raise BagError(redefined)
            except BagError as error:
                yield MessageBatch(None, checked=True, reason=f"{error} {place}", lost=promised)
                continue
            messages = _of(records, channels)
            yield MessageBatch(messages, checked=True)
            if promised > len(messages):
                reason = (
                    f"its index lists {counted(promised, 'message')} and it holds "
                    f"{len(messages)} {place}"
                )
                yield MessageBatch(None, checked=True, reason=reason, lost=promised - len(messages))

    def _records(self, part: BagPart) -> tuple[ChunkMessages, Others]:
        """The messages of a part, and its connections."""
        content = unpacked(
            self._file.read(part.start, part.end - part.start),
            part.packing,
            part.size,
            torn=part.torn,
        )
        offsets = [
            np.frombuffer(self._file.read(start, count * _INDEX_ENTRY), "<u4")[2::3]
            for start, count in part.indexes.values()
        ]
        listed = (
            np.sort(np.concatenate(offsets)).astype(np.int64) if offsets else np.empty(0, np.int64)
        )
        return indexed(content, listed) or walked(content, self.works, torn=part.torn)


def _of(found: ChunkMessages, channels: frozenset[int]) -> Messages:
    """The messages of `channels` alone."""
    all_of, ours = found.messages, np.isin(found.connections, list(channels))
    return Messages(all_of.content, all_of.starts[ours], all_of.sizes[ours], all_of.log_ns[ours])
