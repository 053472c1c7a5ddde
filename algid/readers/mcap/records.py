"""Places of a channel's messages in unpacked records: by message index, proved by the records.

An index has no checksum of its own, so it is believed only where the records it names, with the
few others in between, tile the chunk without a gap. Otherwise the records are walked one by one.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.limits import LIMITS
from algid.log import IntArray
from algid.readers.mcap import framing
from algid.readers.mcap.framing import BrokenOffError, DamagedError
from algid.readers.messages.batch import Messages, beside, gather

HEAD = 31
"""Bytes of a message record before the payload: code, length, channel, sequence, two times."""
_LEAST = HEAD - 9
_HEAD = np.dtype(
    [("code", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_ns", "<i8")]
)
_HEAD_BYTES = f"V{_HEAD.itemsize}"
"""As bytes they are gathered at once, as numbers one by one."""
_SMALL = 1 << 13
"""Bytes; NumPy takes as long to look at an index as a walk over so many."""
_FEW = 256
_SOME = (1 << 16) - 1
"""Messages between two looks at how much work they are."""


@dataclass(frozen=True, eq=False)
class Records:
    """Unpacked bytes (N,), offsets and heads of message records (M,), other records.

    Of those code and content.
    """

    content: NDArray[np.uint8]
    offsets: IntArray
    heads: NDArray[np.void]
    others: tuple[tuple[int, bytes], ...] = ()

    @property
    def channels_seen(self) -> frozenset[int]:
        """The channels that have messages here."""
        if not self.offsets.size:
            return frozenset()
        channels = self.heads["channel"]
        return frozenset(
            channels.tolist() if channels.size < _FEW else np.unique(channels).tolist()
        )

    def of(self, wanted: Collection[int]) -> Messages:
        """The messages of the channels `wanted`, in file order, apart from the records."""
        channels = self.heads["channel"]
        ours = np.flatnonzero(
            np.isin(channels, list(wanted))
            if len(wanted) > 1
            else channels == next(iter(wanted), -1)
        )
        sizes = self.heads["length"][ours].astype(np.int64) - (HEAD - 9)
        log_ns = self.heads["log_ns"][ours].astype(np.int64)
        return Messages(self.content, self.offsets[ours] + HEAD, sizes, log_ns).apart()


def joined(several: Sequence[Records]) -> Records:
    """The records of many small chunks as those of one.

    What stands between messages is left out.
    """
    if len(several) == 1:
        return several[0]
    contents, offsets, heads, size = [], [], [], 0
    for one in several:
        contents.append(one.content)
        offsets.append(one.offsets + size)
        heads.append(one.heads)
        size += one.content.size
    return Records(np.concatenate(contents), np.concatenate(offsets), np.concatenate(heads))


def heads_at(octets: NDArray[np.uint8], offsets: IntArray) -> NDArray[np.void]:
    """The heads (M,) of the message records at `offsets`, each with `HEAD` bytes at least."""
    return gather(octets, offsets, _HEAD_BYTES).view(_HEAD)


def records_in(
    content: bytes, index: bytes | memoryview = b"", works: Callable[[int], bool] = lambda _: True
) -> Records:
    """The records within unpacked bytes.

    Parameters
    ----------
    content : bytes
    index : bytes
        The message index records that stand behind the chunk, or nothing.
    works : callable
        Counts steps of some microsecond; False where these are too many.

    Raises
    ------
    DamagedError
        If the records do not tile the bytes, a message is shorter than its head, or they are more
        than in any honest file.
    """
    octets = np.frombuffer(content, np.uint8)
    if len(content) < _SMALL:  # sooner walked than compared with its index
        return _walked(octets, content, works)
    records = _indexed(octets, content, index)
    if records is None and (same := alike(octets)) is not None:
        records = Records(octets, same, heads_at(octets, same))
    return records or _walked(octets, content, works)


def _walked(octets: NDArray[np.uint8], content: bytes, works: Callable[[int], bool]) -> Records:
    """The records one by one: written out, since a chunk may hold millions."""
    offsets, others = array("q"), list[tuple[int, bytes]]()
    unpack, head, last, place = framing.FRAME.unpack_from, framing.FRAME.size, len(content), 0
    while place < last:
        start = place + head
        if start > last:
            raise BrokenOffError(place)
        code, length = unpack(content, place)
        if start + length > last:
            raise BrokenOffError(place)
        if code == framing.MESSAGE:
            if length < _LEAST:
                raise DamagedError("a message is shorter than its head")
            offsets.append(place)
        else:
            others.append((code, content[start : start + length]))
            if len(others) > LIMITS.other_records:
                raise DamagedError(f"more than {LIMITS.other_records} records that are no messages")
        if code == framing.MESSAGE and not len(offsets) & _SOME and not works(_SOME // 2):
            raise DamagedError("more small messages than in any honest file of this size")
        place = start + length
    places = np.frombuffer(offsets, np.int64) if offsets else np.empty(0, np.int64)
    return Records(octets, places, heads_at(octets, places), tuple(others))


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


def _indexed(
    octets: NDArray[np.uint8], content: bytes, index: bytes | memoryview
) -> Records | None:
    """The records as a message index tells them; None where it does not fit them."""
    listed = entries(index)
    if not listed:
        return None
    records = np.concatenate([offsets for _, offsets in listed])
    if len(listed) > 1 or np.any(records[1:] <= records[:-1]):
        records.sort(kind="stable")
    if records.size == 0 or records[0] < 0 or records[-1] > octets.size - HEAD:
        return None
    heads = heads_at(octets, records)
    lengths = heads["length"]
    if (
        not np.all(heads["code"] == framing.MESSAGE)
        or lengths.max() > octets.size
        or lengths.min() < _LEAST
    ):
        return None
    borders = beside(records, records + 9 + lengths.astype(np.int64), len(content))
    if borders is None:
        return None
    others: list[tuple[int, bytes]] = []
    try:
        for start, end in borders:
            for record in framing.walk_bytes(content, start, end):
                if record.code == framing.MESSAGE:
                    return None
                others.append((record.code, content[record.start : record.end]))
    except DamagedError:
        return None
    return Records(octets, records, heads, tuple(others))


def entries(index: bytes | memoryview) -> list[tuple[int, IntArray]]:
    """Channel and offsets of each message index record; nothing where they are damaged."""
    parts = []
    try:
        for record in framing.walk_bytes(index, 0, len(index)):
            channel, size = struct.unpack_from("<HI", index, record.start)
            if record.code != framing.MESSAGE_INDEX or size != record.length - 6 or size % 16:
                return []
            pairs = np.frombuffer(index, "<i8", size // 8, record.start + 6)
            parts.append((channel, pairs[1::2]))
    except (DamagedError, struct.error):
        return []
    return parts
