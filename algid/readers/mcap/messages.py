"""Where a channel's messages lie within unpacked records: told by the message indexes, proved by the records.

An index has no checksum of its own, so it is believed only where the records it names, with the few others
in between, tile the chunk without a gap. Otherwise the records are walked one by one.
"""

from __future__ import annotations

import struct
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.log import IntArray
from algid.readers.mcap import framing
from algid.readers.mcap.framing import DamagedError

HEAD = 31
"""Bytes of a message record before its payload: code, length, channel, sequence, log and publish time."""
_MOST_GAPS = 256


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages in unpacked bytes (M,): where each payload (N,) starts, its size, and its log time in ns."""

    content: NDArray[np.uint8]
    starts: IntArray
    sizes: IntArray
    log_ns: IntArray

    def __len__(self) -> int:
        return int(self.starts.size)


def find(content: bytes, index: bytes, wanted: Collection[int]) -> Messages:
    """Messages of the channels `wanted` in unpacked records, in file order.

    Parameters
    ----------
    content : bytes
        Unpacked records.
    index : bytes
        The message index records that stand behind the chunk, or nothing.
    wanted : collection of int
        Channel ids.

    Raises
    ------
    DamagedError
        If the records do not tile the bytes.
    """
    octets = np.frombuffer(content, np.uint8)
    records = _indexed(octets, content, index)
    if records is None:
        records = alike(octets)
    if records is None:
        records = np.array(
            [
                record.start - 9
                for record in framing.walk_bytes(content, 0, len(content))
                if record.code == framing.MESSAGE
            ],
            np.int64,
        )
    if records.size == 0:
        return Messages(octets, records, records, records)
    lengths = gather(octets, records + 1, "<u8").astype(np.int64)
    if lengths.min() < HEAD - 9:
        raise DamagedError("a message is shorter than its head")
    channels = gather(octets, records + 9, "<u2")
    ours = np.isin(channels, list(wanted)) if len(wanted) > 1 else channels == next(iter(wanted))
    if not ours.all():
        records, lengths = records[ours], lengths[ours]
    log_ns = gather(octets, records + 15, "<i8").astype(np.int64, copy=False)
    return Messages(octets, records + HEAD, lengths - (HEAD - 9), log_ns)


def alike(octets: NDArray[np.uint8]) -> IntArray | None:
    """Offsets of the records where all of them are messages of one length, else None."""
    if octets.size < HEAD:
        return None
    length = 9 + int(gather(octets, np.ones(1, np.int64), "<u8")[0])
    if octets.size % length or length < HEAD:
        return None
    records = np.arange(0, octets.size, length, dtype=np.int64)
    same = gather(octets, records + 1, "<u8") == length - 9
    return records if bool(np.all(same) and np.all(octets[records] == framing.MESSAGE)) else None


def gather(octets: NDArray[np.uint8], places: IntArray, kind: str) -> NDArray[np.generic]:
    """The numbers of type `kind` at byte `places` (N,), aligned or not."""
    width = np.dtype(kind).itemsize
    window: NDArray[np.generic] = np.ndarray(max(0, octets.size - width + 1), np.dtype(kind), octets.data, strides=(1,))
    return window[places]


def _indexed(octets: NDArray[np.uint8], content: bytes, index: bytes) -> IntArray | None:
    """Offsets of all message records, sorted; None where the index does not fit the records."""
    listed = _entries(index)
    if not listed:
        return None
    records = np.concatenate([offsets for _, offsets in listed])
    if len(listed) > 1 or np.any(records[1:] <= records[:-1]):
        records.sort(kind="stable")
    if records.size == 0 or records[0] < 0 or records[-1] > octets.size - HEAD:
        return None
    if not np.all(octets[records] == framing.MESSAGE):
        return None
    ends = records + 9 + gather(octets, records + 1, "<u8").astype(np.int64)
    gaps = np.flatnonzero(ends[:-1] != records[1:])
    if gaps.size > _MOST_GAPS:
        return None
    borders = [(0, int(records[0])), *((int(ends[gap]), int(records[gap + 1])) for gap in gaps)]
    borders.append((int(ends[-1]), len(content)))
    return records if all(_no_message(content, *border) for border in borders) else None


def _entries(index: bytes) -> list[tuple[int, IntArray]]:
    """Channel and offsets of each message index record; nothing where they are damaged."""
    found = []
    try:
        for record in framing.walk_bytes(index, 0, len(index)):
            channel, size = struct.unpack_from("<HI", index, record.start)
            if record.code != framing.MESSAGE_INDEX or size != record.length - 6 or size % 16:
                return []
            pairs = np.frombuffer(index, "<i8", size // 8, record.start + 6)
            found.append((channel, pairs[1::2]))
    except (DamagedError, struct.error):
        return []
    return found


def _no_message(content: bytes, start: int, end: int) -> bool:
    """Whether only whole records that are no messages stand between two offsets."""
    if start > end:
        return False
    try:
        return all(record.code != framing.MESSAGE for record in framing.walk_bytes(content, start, end))
    except DamagedError:
        return False
