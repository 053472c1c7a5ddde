"""Files of messages as every format opens them: channels, counts, and messages as bytes.

MCAP files, ROS 1 bags and rosbag2's SQLite files differ in how they hold messages; what is in a
message is read alike, and what is lost of them is counted alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.log import IntArray, Truth
from algid.notices import Notice

_PAD = 8


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages in unpacked bytes (M,): each payload's start (N,), size, and log time in ns."""

    content: NDArray[np.uint8]
    starts: IntArray
    sizes: IntArray
    log_ns: IntArray

    def __len__(self) -> int:
        return int(self.starts.size)

    @classmethod
    def of(cls, payloads: Sequence[bytes], log_ns: IntArray) -> Messages:
        """Messages with these payloads, behind some bytes that decoders want to have there."""
        sizes = np.fromiter(map(len, payloads), np.int64, len(payloads))
        ends = _PAD + np.cumsum(sizes)
        content = np.frombuffer(b"".join([bytes(_PAD), *payloads]), np.uint8)
        return cls(content, ends - sizes, sizes, log_ns)

    def take(self, rows: slice | NDArray[np.intp]) -> Messages:
        """Some of the messages."""
        return Messages(self.content, self.starts[rows], self.sizes[rows], self.log_ns[rows])


def gather(octets: NDArray[np.uint8], places: IntArray, kind: str) -> NDArray[np.generic]:
    """The numbers of type `kind` at byte `places` (N,), aligned or not."""
    width = np.dtype(kind).itemsize
    window: NDArray[np.generic] = np.ndarray(
        max(0, octets.size - width + 1), np.dtype(kind), octets.data, strides=(1,)
    )
    return window[places]


@dataclass(frozen=True)
class MessageBatch:
    """Messages of one span or of many small ones, or None and why those of one are lost.

    Of a torn chunk also how much is there.
    """

    messages: Messages | None
    checked: bool
    reason: str = ""
    torn: tuple[int, int] | None = None
    """Bytes of a torn chunk's records, unpacked: what is there, and what there should be."""
    rows: int = 0
    """Damaged rows of one message each, where it is not a chunk that is damaged."""


@dataclass
class Losses:
    """What was lost on the way, for the notices at the end."""

    spans: int = 0
    rows: int = 0
    reason: str = ""
    unchecked: bool = False
    found: int = 0
    torn: tuple[int, int, int] | None = None
    """Of a torn chunk: messages taken, and bytes of its records present and expected."""

    def add(self, batch: MessageBatch) -> None:
        """Count one batch."""
        if batch.messages is None:
            self.spans += not batch.rows
            self.rows += batch.rows
            self.reason = self.reason or batch.reason
        else:
            self.found += len(batch.messages)
            self.unchecked |= not batch.checked and len(batch.messages) > 0
            if batch.torn:
                self.torn = (len(batch.messages), *batch.torn)

    def notices(self, promised: int) -> list[Notice]:
        """What to say; `promised` is how many messages the file counts."""
        said = []
        if self.spans or self.rows:
            numbers: dict[str, Any] = {
                "case": "chunk" if self.spans else "row",
                "count": self.spans or self.rows,
                "why": self.reason,
                "missing": promised - self.found,
            }
            said.append(Notice("DAMAGED", numbers=numbers))
        elif promised != self.found:
            numbers = {"promised": promised, "found": self.found}
            said.append(Notice("DAMAGED", numbers={"case": "count"} | numbers))
        if self.torn:
            taken, held, size = self.torn
            numbers = {"taken": taken, "held": held, "bytes": size}
            numbers["lost"] = round(taken * (size - held) / held) if taken else 0  # by their bytes
            said.append(Notice("CUT_OFF", numbers={"case": "torn"} | numbers))
        if self.unchecked:
            said.append(Notice("NO_CHECKSUM", numbers={"case": "file"}))
        return said


@dataclass(frozen=True)
class MessageChannel:
    """A topic as one publisher writes it: its type, how messages are encoded, and their definition.

    `type` and `definition` are empty where the file does not tell them.
    """

    topic: str
    type: str
    encoding: str
    definition_encoding: str
    definition: bytes
    metadata: Mapping[str, str] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, eq=False)
class MessageFile:
    """A file of messages, known by what it defines; its messages are read when asked for.

    Attributes
    ----------
    path : str
        As messages name it.
    channels : mapping
        Channels by number.
    batches : callable
        The messages of some channels in file order; a damaged part yields its reason.
    counts : mapping
        Messages of each channel, as the file counts them, or as a walk over it found them.
    span_ns : pair of int, optional
        Log times of the first and the last message.
    notices : tuple of Notice
        What is to be said of the file.
    damage : list of str
        Places whose bytes are not what the format says.
    truth : Truth, optional
        What the file tells of a simulated arm.
    """

    path: str
    channels: Mapping[int, MessageChannel]
    batches: Callable[[frozenset[int]], Iterator[MessageBatch]]
    counts: Mapping[int, int]
    span_ns: tuple[int, int] | None = None
    notices: tuple[Notice, ...] = ()
    damage: list[str] = field(default_factory=list)
    truth: Truth | None = None


def channels_by_topic(file: MessageFile) -> dict[str, frozenset[int]]:
    """Channel numbers by topic: those defined and encoded as the first one that has messages."""
    groups: dict[str, tuple[MessageChannel, list[int]]] = {}
    for number in sorted(file.channels, key=lambda one: (not file.counts.get(one), one)):
        channel = file.channels[number]
        first, numbers = groups.setdefault(channel.topic, (channel, []))
        if first == channel:
            numbers.append(number)
    return {topic: frozenset(numbers) for topic, (_, numbers) in groups.items()}


def listed(file: MessageFile) -> str:
    """The topics of a file, with their types, for a message."""
    topics = [
        f"{channel.topic!r} ({channel.type or 'no schema'}, {channel.encoding!r})"
        for channel in file.channels.values()
    ]
    more = f" and {len(topics) - 12} more" if len(topics) > 12 else ""
    return (", ".join(topics[:12]) or "no topic") + more
