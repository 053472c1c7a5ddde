"""MCAP files of one schema, written by chunks: all messages of a chunk are rows of one array.

Messages that are alike but for their numbers and stamps have one length, so that a chunk and its
index are laid out at once. Every other record is written by the mcap library.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import IO

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
HEAD_BYTES = np.dtype(_MESSAGE).itemsize
"""Of a message record before its content."""
_INDEX = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


@dataclass
class ChunkedFile:
    """An MCAP file of a ROS 2 recorder in the making, at the start of a binary `stream`."""

    stream: IO[bytes]
    schema: Schema
    _channels: dict[int, Channel] = field(default_factory=dict)
    _messages: Counter[int] = field(default_factory=Counter)
    _chunks: list[ChunkIndex] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.stream.write(MCAP0_MAGIC + _bytes_of(Header("ros2", "algid")))

    def add(self, channel: Channel, stamp_ns: IntArray, content: NDArray[np.void]) -> None:
        """Write a chunk of messages: their stamps (N,), none negative, and contents (N,)."""
        before = b"" if channel.id in self._channels else _bytes_of(self.schema, channel)
        rows = np.zeros(len(content), np.dtype([*_MESSAGE, ("content", content.dtype)]))
        rows["code"], rows["length"] = Opcode.MESSAGE, rows.itemsize - _PREFIX
        rows["channel"] = channel.id
        rows["sequence"] = self._messages[channel.id] + np.arange(len(rows))
        rows["log_time"] = rows["publish_time"] = stamp_ns
        rows["content"] = content
        index = np.zeros(len(rows), _INDEX)
        index["log_time"] = stamp_ns
        index["offset"] = len(before) + rows.itemsize * np.arange(len(rows))
        data, entries = before + rows.tobytes(), index.tobytes()
        head = struct.pack(
            "<BQHI", Opcode.MESSAGE_INDEX, 6 + len(entries), channel.id, len(entries)
        )
        packed = zstandard.compress(data)
        first, last = int(stamp_ns.min()), int(stamp_ns.max())
        start = self.stream.tell()
        chunk = _bytes_of(Chunk("zstd", packed, last, first, zlib.crc32(data), len(data)))
        self.stream.write(chunk)
        self.stream.write(head + entries)
        self._chunks.append(
            ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=start,
                compression="zstd",
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=len(head) + len(entries),
                message_index_offsets={channel.id: start + len(chunk)},
                message_start_time=first,
                uncompressed_size=len(data),
            )
        )
        self._channels[channel.id] = channel
        self._messages[channel.id] += len(rows)

    def finish(self, metadata: Mapping[str, dict[str, str]]) -> None:
        """Write the metadata records by name, the summary and the footer."""
        listed = []
        for name, content in metadata.items():
            record = _bytes_of(Metadata(name, content))
            listed.append(MetadataIndex(self.stream.tell(), len(record), name))
            self.stream.write(record)
        self.stream.write(_bytes_of(DataEnd(0)))
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._messages),
            chunk_count=len(self._chunks),
            message_count=self._messages.total(),
            message_end_time=max((one.message_end_time for one in self._chunks), default=0),
            message_start_time=min((one.message_start_time for one in self._chunks), default=0),
            metadata_count=len(listed),
            schema_count=1,
        )
        channels = self._channels.values()
        summary = _bytes_of(self.schema, *channels, statistics, *self._chunks, *listed)
        # the sum covers the footer up to itself
        start = self.stream.tell()
        covered = summary + _bytes_of(Footer(start, 0, 0))[:-4]
        self.stream.write(summary + _bytes_of(Footer(start, 0, zlib.crc32(covered))) + MCAP0_MAGIC)


def _bytes_of(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    content: bytes = builder.end()  # type: ignore[no-untyped-call]
    return content
