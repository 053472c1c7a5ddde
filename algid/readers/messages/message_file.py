"""Files of messages as every format opens them: channels, counts, and messages as bytes.

MCAP files, ROS 1 bags and rosbag2's SQLite files differ in how they hold messages; what is in a
message is read alike, and what is lost of them is counted alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from algid.log import IntArray, Truth
from algid.notices import Notice

_PAD = 8


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages in unpacked bytes (M,): each payload's start (N,), size, and log time in ns.

    `checked` where damage to them would have been seen.
    """

    content: NDArray[np.uint8]
    starts: IntArray
    sizes: IntArray
    log_ns: IntArray
    checked: bool = True

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
        starts, sizes, log_ns = self.starts[rows], self.sizes[rows], self.log_ns[rows]
        return Messages(self.content, starts, sizes, log_ns, self.checked)


def gather(octets: NDArray[np.uint8], places: IntArray, kind: str) -> NDArray[np.generic]:
    """The numbers of type `kind` at byte `places` (N,), aligned or not."""
    width = np.dtype(kind).itemsize
    window: NDArray[np.generic] = np.ndarray(
        max(0, octets.size - width + 1), np.dtype(kind), octets.data, strides=(1,)
    )
    return window[places]


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
        The messages of some channels in file order; or why a part of them is lost.
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
    batches: Callable[[frozenset[int]], Iterator[Messages | str]]
    counts: Mapping[int, int]
    span_ns: tuple[int, int] | None = None
    notices: tuple[Notice, ...] = ()
    damage: list[str] = field(default_factory=list)
    truth: Truth | None = None

    @cached_property
    def topics(self) -> dict[str, frozenset[int]]:
        """Channels by topic: those defined and encoded as the first one that has messages."""
        groups: dict[str, tuple[MessageChannel, list[int]]] = {}
        for number in sorted(self.channels, key=lambda one: (not self.counts.get(one), one)):
            channel = self.channels[number]
            first, numbers = groups.setdefault(channel.topic, (channel, []))
            if first == channel:
                numbers.append(number)
        return {topic: frozenset(numbers) for topic, (_, numbers) in groups.items()}

    def channel(self, topic: str) -> MessageChannel:
        """How the messages of a topic are encoded and defined."""
        return self.channels[min(self.topics[topic])]

    def count(self, topic: str) -> int:
        """Messages of a topic that the file counts."""
        return sum(self.counts.get(number, 0) for number in self.topics.get(topic, ()))

    def lacking(self, what: str) -> str:
        """That the file lacks what is looked for; damage to it may be why."""
        if self.damage:
            where = "; ".join(list(dict.fromkeys(self.damage))[:3])
            what = f"the file is damaged ({where}); copy it again; in what is left: {what}"
        return what

    def listed(self) -> str:
        """The topics with their types, for a message."""
        topics = [
            f"{channel.topic!r} ({channel.type or 'no schema'}, {channel.encoding!r})"
            for channel in self.channels.values()
        ]
        return ", ".join([*topics[:12], "…"][: len(topics)]) or "no topic"
