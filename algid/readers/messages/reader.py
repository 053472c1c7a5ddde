"""A log from files of messages: planned on the first file, then read as one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from algid.base.errors import LogError
from algid.log import Origin, Reading
from algid.notices import Notice, Remedy
from algid.profile import Profile
from algid.readers.clock import Series, aligned, in_order, whole_topic
from algid.readers.joints import moving_joints, reading_of
from algid.readers.log_reader import TableReader, make_reader
from algid.readers.messages.joint_topic import (
    TOPIC,
    find_joint_topic,
    layouts_of,
    references_of,
    stamp_in,
    stated_of,
    topic_of,
)
from algid.readers.messages.layout import MessageLayout
from algid.readers.messages.message_file import MessageFile
from algid.readers.messages.topic import Topic
from algid.readers.table import REFERENCES, ROWS, SampleTable, in_pairs

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
        If no topic holds the joints, several do, or a message cannot be read.
    """
    file = log.files[0]()
    given: dict[str, tuple[str | None, str]] = {}
    for name in profile.channels:
        topic, path = profile.place(name)
        if path:
            given[name] = (topic, path)
    # where each channel comes from: the topic with joint states, then what the profile names
    sources: dict[str, tuple[str | None, str]] = {}
    units: dict[str, str] = {}
    reading, notices, found = Reading(joints_told="profile"), list[Notice](), None
    if not set(profile.needed) <= given.keys() and (found := find_joint_topic(file, profile)):
        for name, path in found.paths.items():
            if name in profile.channels:
                sources[name] = (found.topic, path)
        units = {name: unit for name, unit in found.units.items() if name not in given}
        reading, order = reading_of(found.joints, profile)
        if found.named:
            notices += order
            if reading.joints and given.keys().isdisjoint(REFERENCES):
                sources |= references_of(file, reading.joints)
        if found.beside:
            numbers = {"case": "topic", "topic": found.topic, "others": ", ".join(found.beside[:4])}
            other = Remedy({"topic": found.beside[0]}, "for the other")
            notices.append(Notice("JOINT_ORDER", numbers=numbers, remedies=(other,)))
    sources |= given
    sources = in_pairs(sources, profile.velocity)
    homes: dict[str, dict[str, str]] = {}  # paths by topic, the main one first
    mapping = {}
    for name, (own, path) in sources.items():
        home = own or (found.topic if found else None)
        if home is None:
            raise LogError(f"{file.path}: {name} is taken from {path!r} without a topic: {TOPIC}")
        homes.setdefault(home, {})[name] = path
        mapping[name] = f"{home}: {path}"
    topics, said = list[Topic](), list[str]()
    for home, paths in homes.items():
        layouts = list[MessageLayout]()
        for layout in layouts_of(file, home):
            layouts.append(layout)
            if layout.has(paths.values()) and stamp_in(layout):
                break  # later messages tell nothing more
        topics.append(topic_of(file, home, paths, layouts, profile))
        stated, lines = stated_of(file, home, paths, layouts)
        units = stated | units
        said += lines
    # the main topic has the clock, and the joints that are not read
    main, clock = topics[0], "log"
    mapping["t"] = "log time"
    if profile.clock != "log" and main.stamp is not None:
        mapping["t"], clock = f"{main.name}: {main.stamp[0].rpartition('.')[0]}", "header"
    others = found.others if found is not None and found.topic == main.name else {}
    reading = replace(reading, topics=tuple(homes), clock=clock)
    beside = moving_joints(
        others, lambda paths: Topic(main.name, paths, None, "log").tables(file, [], _LOOKED)
    )
    origin = Origin(log.path, log.kind, mapping, file.truth, reading)

    told = (*log.notices, *notices, *beside)
    tables = partial(_tables, log, topics)
    return make_reader(origin, tables, profile, units, told, file.count(main.name), said)


def _tables(log: MessageLog, topics: Sequence[Topic], told: list[Notice]) -> Iterator[SampleTable]:
    """The samples of the first topic, each with what the others have at its time."""

    def read(topic: Topic, told: list[Notice]) -> Iterator[SampleTable]:
        for opened in log.files:
            yield from topic.tables(opened(), told, ROWS)

    samples = read(topics[0], told)
    if len(topics) == 1:
        return samples
    needed, followed = list[Series](), list[Series]()
    for one in topics[1:]:
        only_followed = set(one.paths) <= set(REFERENCES)
        own = list[Notice]() if only_followed else told  # it may be missing
        try:
            series = whole_topic(log.path, one.name, one.paths, read(one, own), own)
            (followed if only_followed else needed).append(series)
        except LogError as error:
            if not only_followed:
                raise
            why = str(error).removeprefix(f"{log.path}: ")
            numbers = {"case": "reference", "topic": one.name, "why": why}
            told.append(Notice("MESSAGES_LEFT_OUT", numbers=numbers))
    return aligned(in_order(log.path, samples, told), needed, told, followed)
