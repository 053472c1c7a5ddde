"""A log from files of messages: planned on the first file, then read as one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from algid.base.errors import LogError
from algid.notices import Notice, Remedy
from algid.profile import Profile
from algid.readers.clock import Series, aligned, in_order, whole_topic
from algid.readers.messages.joint_topic import (
    TOPIC,
    find_joint_topic,
    layouts_of,
    references_of,
    stamp_in,
    stated_of,
)
from algid.readers.messages.layout import MessageLayout
from algid.readers.messages.message_file import MessageFile
from algid.readers.messages.topic import topic_tables
from algid.readers.table import (
    REFERENCES,
    ROWS,
    Clock,
    Offered,
    SampleTable,
    TopicField,
    in_pairs,
)


@dataclass(frozen=True)
class MessageLog:
    """A log of messages: what messages call it, its format, and what opens its files in order.

    Several passes go over a log: an opened file is kept.
    """

    path: str
    kind: str
    files: Sequence[Callable[[], MessageFile]]
    notices: tuple[Notice, ...] = ()


def offer_messages(log: MessageLog, profile: Profile) -> Offered:
    """The fields of the topics that a profile, or the messages themselves, choose.

    Raises
    ------
    LogError
        If no topic holds the joints, several do, or a message cannot be read.
    """
    file = log.files[0]()
    given = {name: place for name in profile.channels if (place := profile.place(name))[1]}
    # where each channel comes from: the topic with joint states, then what the profile names
    fields, chosen = dict[str, TopicField](), dict[str, str]()
    notices, home, joints = [*log.notices], None, None
    if not set(profile.needed) <= given.keys() and (
        found := find_joint_topic(file, profile, given)
    ):
        home, fields, joints = found.topic, dict(found.fields), found.choice.joints
        columns = found.choice.columns.items()
        chosen = {name: one for name, one in columns if name in profile.channels}
        if found.beside:
            numbers = {"case": "topic", "topic": home, "others": ", ".join(found.beside[:4])}
            other = Remedy({"topic": found.beside[0]}, "for the other")
            notices.append(Notice("JOINT_ORDER", numbers=numbers, remedies=(other,)))
    named = dict[str, TopicField]()
    own = [fields[chosen[name]].joint for name in ("theta1", "theta2") if name in chosen]
    if len(own) == 2 and all(own) and given.keys().isdisjoint(REFERENCES):
        named |= references_of(file, own)
    for name, (topic, path) in given.items():
        if not (topic or home):
            raise LogError(f"{file.path}: {name} is taken from {path!r} without a topic: {TOPIC}")
        named[name] = TopicField(str(path), topic or home or "")
    for name, one in named.items():
        chosen[name] = f"{one.topic}/{one.column}/"  # a name in which nothing is a unit
        fields[chosen[name]] = one
    chosen = in_pairs(chosen, profile.velocity)
    units, said = dict[str, str](), list[str]()
    stamps = dict[str, tuple[str, str] | None]()
    for home in dict.fromkeys(fields[one].topic for one in chosen.values()):
        paths = {name: one.column for name, one in fields.items() if one.topic == home}
        wanted = {name: fields[one].column for name, one in chosen.items() if one in paths}
        layouts = list[MessageLayout]()
        for layout in layouts_of(file, home):
            layouts.append(layout)
            if layout.has(wanted.values()) and stamp_in(layout):
                break  # later messages tell nothing more
        _refuse_absent(file, home, wanted, layouts)
        stamps[home] = None
        if profile.clock != "log":
            stamps[home] = next(filter(None, map(stamp_in, layouts)), None)
        if profile.clock == "header" and stamps[home] is None:
            log_clock = Remedy({"clock": "log"})
            raise LogError(f"{file.path}: messages on {home!r} carry no stamp: {log_clock}")
        stated, lines = stated_of(file, home, paths, layouts)
        units |= stated
        said += lines
    # the main topic has the clock
    main, stamp = next(iter(stamps.items()))
    chosen["t"], time = "log time", TopicField("", is_clock=True)
    if stamp:
        chosen["t"] = stamp[0].rpartition(".")[0]
        time = TopicField(chosen["t"], main, is_clock=True)
    fields[chosen["t"]] = time

    def tables(
        sources: Mapping[str, str], _clock: Clock, told: list[Notice], most: int | None = None
    ) -> Iterator[SampleTable]:
        """The samples of the first topic, each with what the others have at its time.

        Tables have at least `most` rows, but for the last. All stamps are in ns.

        Raises
        ------
        LogError
            If another topic has no sample.
        """
        homes: dict[str, dict[str, str]] = {}
        for channel, source in sources.items():
            if channel != "t":
                homes.setdefault(fields[source].topic, {})[channel] = fields[source].column

        def read(name: str, told: list[Notice]) -> Iterator[SampleTable]:
            own = log.files, name, homes[name], stamps[name], profile.clock == "header" or None
            return topic_tables(*own, told, most or ROWS)

        main, *others = homes
        samples = read(main, told)
        if not others:
            return samples
        needed, followed = list[Series](), list[Series]()
        for one in others:
            only_followed = set(homes[one]) <= set(REFERENCES)
            own = list[Notice]() if only_followed else told  # it may be missing
            try:
                series = whole_topic(log.path, one, homes[one], read(one, own), own)
                (followed if only_followed else needed).append(series)
            except LogError as error:
                if not only_followed:
                    raise
                why = str(error).removeprefix(f"{log.path}: ")
                numbers = {"case": "reference", "topic": one, "why": why}
                told.append(Notice("MESSAGES_LEFT_OUT", numbers=numbers))
        return aligned(in_order(log.path, samples, told), needed, told, followed)

    clock = "header" if stamp else "log"
    return Offered(
        log.path,
        log.kind,
        fields,
        chosen,
        tables,
        file.truth,
        clock,
        joints,
        file.count(main),
        units,
        tuple(notices),
        tuple(said),
    )


def _refuse_absent(
    file: MessageFile, topic: str, paths: Mapping[str, str], layouts: Sequence[MessageLayout]
) -> None:
    """Raises `LogError` where none of the first messages has one of the paths by channel."""
    if not layouts:
        each = Remedy({"tau1.topic": None}, "for one channel")
        text = f"there is no message on topic {topic!r}; found {file.listed()}; name another"
        raise LogError(file.lacking(f"{text}: {TOPIC}; {each}"))
    for channel, path in paths.items():
        if not any(layout.find(path) for layout in layouts):
            known = next((list(one.numbers)[:12] for one in layouts if one.numbers), ["nothing"])
            raise LogError(
                f"{file.path}: messages on {topic!r} have no {path!r} for {channel}; found "
                f"{', '.join(known)}; {Remedy({f'{channel}.source': None}, 'name another')}"
            )
