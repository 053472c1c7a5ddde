"""Interface of every file of messages: channels, message counts, and batches of messages.

MCAP files, ROS 1 bags and rosbag2's SQLite files differ in how they hold messages; what is in a
message is read alike.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
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


class Source(ABC):
    """An opened file of messages.

    Attributes
    ----------
    path : str
        As messages name it.
    channels : mapping
        Channels by number.
    counts : mapping, optional
        Messages of each channel, as the file counts them.
    span_ns : pair of int, optional
        Log times of the first and the last message.
    notices : sequence of Notice
        What is to be said of the file.
    damage : list of str
        Places whose bytes are not what the format says.
    """

    path: str
    channels: Mapping[int, MessageChannel]
    counts: Mapping[int, int] | None = None
    span_ns: tuple[int, int] | None = None
    notices: Sequence[Notice]
    damage: list[str]

    @abstractmethod
    def batches(self, channels: frozenset[int]) -> Iterator[MessageBatch]:
        """The messages of `channels` in file order; a damaged part yields its reason."""

    @abstractmethod
    def works(self, steps: int) -> bool:
        """Count steps of some microsecond each.

        False where no honest file of this size asks for so many.
        """

    # Most files have nothing to check.
    def check(self, channels: frozenset[int]) -> None:  # noqa: B027
        """Look for what would redefine `channels`, before all of their messages are read."""

    def used(self) -> frozenset[int]:
        """The channels that have messages, as far as the file tells."""
        if self.counts is None:
            return frozenset(self.channels)
        return frozenset(number for number in self.channels if self.counts.get(number))

    def truth(self) -> Truth | None:
        """What the file tells of a simulated arm.

        Raises
        ------
        LogError
            If it cannot be read.
        """
        return None


def channels_of(source: Source, topic: str, type_name: str) -> frozenset[int]:
    """Numbers of the channels with a topic and type whose definition is that of the first one."""
    return kinds(source).get((topic, type_name), frozenset())


def kinds(source: Source) -> dict[tuple[str, str], frozenset[int]]:
    """Channel numbers by topic and type: those defined and encoded as the first of them."""
    groups: dict[tuple[str, str], tuple[MessageChannel, list[int]]] = {}
    for number, channel in sorted(source.channels.items()):
        first, numbers = groups.setdefault((channel.topic, channel.type), (channel, []))
        if first == channel:
            numbers.append(number)
    return {name: frozenset(numbers) for name, (_, numbers) in groups.items()}


def listed(source: Source) -> str:
    """The topics of a file, with their types, for a message."""
    topics = [
        f"{channel.topic!r} ({channel.type or 'no schema'}, {channel.encoding!r})"
        for channel in source.channels.values()
    ]
    more = f" and {len(topics) - 12} more" if len(topics) > 12 else ""
    return (", ".join(topics[:12]) or "no topic") + more
