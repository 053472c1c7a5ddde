"""MCAP files of one schema, written by chunks: all messages of a chunk are rows of one array.

Messages that are alike but for their numbers and stamps have one length, so that a chunk and its
index are laid out at once. Every other record is written by the mcap library.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from algid.log import IntArray

_PREFIX = 9
"""Bytes before a record's content: its code and its length."""
_MESSAGE = [
    ("code", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
_INDEX = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


def message_bytes(content: np.dtype[np.void]) -> int:
    """The bytes of a message record of that content."""
    return np.dtype([*_MESSAGE, ("content", content)]).itemsize


@dataclass
class ChunkedFile:
    """An MCAP file in the making; `finish` ends it.

    Parameters
    ----------
    stream : binary file, at its start
    profile, library : str
        As the header states them.
    schema, channels : records of the mcap library
    """

    stream: IO[bytes]
    profile: str
    library: str
    schema: Schema
    channels: tuple[Channel, ...]
    _messages: dict[int, int] = field(default_factory=dict)
    _times: tuple[int, int] | None = None
    _chunks: list[ChunkIndex] = field(default_factory=list)
    _metadata: list[MetadataIndex] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.stream.write(MCAP0_MAGIC)
        self._write(Header(self.profile, self.library))

    def add(self, stamp_ns: IntArray, content: NDArray[np.void], place: int = 0) -> None:
        """Write a chunk of messages on the channel at a `place`.

        Their stamps (N,), none negative, and contents (N,).
        """
        channel = self.channels[place].id
        sent = self._messages.get(channel, 0)
        before = b"" if self._chunks else _bytes_of(self.schema, *self.channels)
        rows = np.zeros(len(content), np.dtype([*_MESSAGE, ("content", content.dtype)]))
        rows["code"], rows["length"] = Opcode.MESSAGE, rows.itemsize - _PREFIX
        rows["channel"] = channel
        rows["sequence"] = sent + np.arange(len(rows))
        rows["log_time"] = rows["publish_time"] = stamp_ns
        rows["content"] = content
        data = before + rows.tobytes()
        packed = zstandard.compress(data)
        first, last = int(stamp_ns.min()), int(stamp_ns.max())
        start, length = self._write(Chunk("zstd", packed, last, first, zlib.crc32(data), len(data)))
        index = np.zeros(len(rows), _INDEX)
        index["log_time"] = stamp_ns
        index["offset"] = len(before) + rows.itemsize * np.arange(len(rows))
        entries = index.tobytes()
        self.stream.write(_prefix(Opcode.MESSAGE_INDEX, 6 + len(entries)))
        self.stream.write(channel.to_bytes(2, "little"))
        self.stream.write(len(entries).to_bytes(4, "little") + entries)
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=start,
                compression="zstd",
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=_PREFIX + 6 + len(entries),
                message_index_offsets={channel: start + length},
                message_start_time=first,
                uncompressed_size=len(data),
            )
        )
        self._messages[channel] = sent + len(rows)
        known = self._times or (first, last)
        self._times = min(first, known[0]), max(last, known[1])

    def add_metadata(self, name: str, content: dict[str, str]) -> None:
        """Write a metadata record."""
        start, length = self._write(Metadata(name, content))
        self._metadata.append(MetadataIndex(start, length, name))

    def finish(self) -> None:
        """Write the summary and the footer."""
        self._write(DataEnd(0))
        start = self.stream.tell()
        groups: tuple[tuple[Opcode, list[Any]], ...] = (
            (Opcode.SCHEMA, [self.schema]),
            (Opcode.CHANNEL, list(self.channels)),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary, offsets = b"", []
        for code, records in groups:
            group = _bytes_of(*records)
            offsets.append(SummaryOffset(code, start + len(summary), len(group)))
            summary += group
        offsets_start = start + len(summary)
        summary += _bytes_of(*offsets)
        # the sum covers the footer up to itself
        covered = summary + _bytes_of(Footer(start, offsets_start, 0))[:-4]
        self.stream.write(summary)
        self._write(Footer(start, offsets_start, zlib.crc32(covered)))
        self.stream.write(MCAP0_MAGIC)

    def _statistics(self) -> Statistics:
        first, last = self._times or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self.channels),
            channel_message_counts=self._messages,
            chunk_count=len(self._chunks),
            message_count=sum(self._messages.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=1,
        )

    def _write(self, record: McapRecord) -> tuple[int, int]:
        """Where the record stands and how many bytes it has."""
        start, content = self.stream.tell(), _bytes_of(record)
        self.stream.write(content)
        return start, len(content)


def _bytes_of(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    content: bytes = builder.end()  # type: ignore[no-untyped-call]
    return content


def _prefix(code: Opcode, length: int) -> bytes:
    return code.to_bytes(1, "little") + length.to_bytes(8, "little")
