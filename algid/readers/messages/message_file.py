"""The opened file of messages that every format makes: channels, counts, batches of messages.

MCAP files, ROS 1 bags and rosbag2's SQLite files differ in how they hold messages; what is in a
message is read alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from algid.log import Truth
from algid.notices import Notice
from algid.readers.messages.batch import MessageBatch


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
