"""A log from files of messages: planned on the first file, then read as one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from algid.base.errors import LogError
from algid.log import Origin
from algid.notices import Notice
from algid.profile import Profile
from algid.readers.clock import Series, aligned, in_order, whole_topic
from algid.readers.joints import moving_joints
from algid.readers.log_reader import TableReader, make_reader
from algid.readers.messages.joint_topic import NothingFoundError, plan
from algid.readers.messages.message_file import MessageFile
from algid.readers.messages.topic import Topic
from algid.readers.table import BLOCK_ROWS, REFERENCES, SampleTable

_LOOKED = 1 << 14
"""Messages whose other joints are looked at."""


@dataclass(frozen=True)
class MessageLog:
    """A log of messages: what messages call it, its format, and what opens its files in order.

    Several passes go over a log: an opened file is kept.
    """

    path: str
    kind: str
    files: Sequence[Callable[[], MessageFile]]
    notices: tuple[Notice, ...] = ()


def open_messages(log: MessageLog, profile: Profile) -> TableReader:
    """A reader of the topics and fields that a profile, or the messages themselves, choose.

    Raises
    ------
    LogError
        If a message is encoded in an unknown way, or the file cannot be read or is damaged and
        holds no joints.
    NothingFoundError
        If no topic of a sound file holds the joints.
    """
    name, file = log.path, log.files[0]()
    try:
        wanted = plan(file, profile)
    except NothingFoundError as error:
        if not file.damage:
            raise
        places = list(dict.fromkeys(file.damage))
        where = "; ".join(places[:3]) + (f"; {len(places) - 3} more" if len(places) > 3 else "")
        text = f"the file is damaged ({where}); copy it again; in what is left: {error.lacking}"
        raise LogError(f"{file.path}: {text}") from error
    main = wanted.topics[0]
    beside = moving_joints(
        wanted.others, lambda paths: Topic(main.name, paths, None, "log").tables(file, _LOOKED)
    )
    origin = Origin(name, log.kind, wanted.mapping, file.truth, wanted.reading)

    def read(topic: Topic, rows: int) -> Iterator[SampleTable]:
        for opened in log.files:
            yield from topic.tables(opened(), rows)

    def tables(rows: int) -> Iterator[SampleTable]:
        samples = read(main, rows)
        if len(wanted.topics) == 1:
            return samples
        needed: list[Series] = []
        followed: list[Series] = []
        left_out: list[Notice] = []
        for one in wanted.topics[1:]:
            only_followed = set(one.paths) <= set(REFERENCES)
            try:
                series = whole_topic(name, one.name, one.paths, read(one, BLOCK_ROWS))
                (followed if only_followed else needed).append(series)
            except LogError as error:
                if not only_followed:
                    raise
                why = str(error).removeprefix(f"{name}: ")
                numbers = {"case": "reference", "topic": one.name, "why": why}
                left_out.append(Notice("MESSAGES_LEFT_OUT", numbers=numbers))
        return aligned(in_order(name, samples), needed, followed, left_out)

    notices = (*log.notices, *wanted.notices, *beside)
    rows = main.count(file)
    return make_reader(origin, tables, profile, wanted.units, notices, rows, wanted.said)
