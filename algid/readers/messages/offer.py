"""What a log of messages offers: topics and fields by a profile, else by the first messages."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, product

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.text import repeated
from algid.notices import Notice, Remedy
from algid.profile import Profile
from algid.readers.clock import Series, aligned, in_order, whole_topic
from algid.readers.column_names import STEMS, ChannelChoice, choose
from algid.readers.messages.layout import NAMES, Decoder, MessageLayout
from algid.readers.messages.message_file import MessageFile
from algid.readers.messages.topic import codec_for, stated_of, topic_tables
from algid.readers.table import (
    REFERENCES,
    Clock,
    Offered,
    SampleTable,
    TopicField,
    in_pairs,
)

_SAMPLES = 64
TOPIC = Remedy({"topic": None})
_USUAL = "/joint_states"
_STEMS = frozenset(chain.from_iterable(STEMS.values()))
_WORD, _VALUES = re.compile(r"\w+"), ("value", "values")
_TELLING = (b"effort", b"tau_est", b"tau_J")
"""Names of torques in definitions: of ROS, Unitree, libfranka."""
_JOINT_REFERENCES = "/joint_references"
"""The topic of joint states that algid writes what the joints are to follow to."""
_REFERENCES = ("reference.positions", "desired.positions", "position")
"""In the state of a trajectory controller (ROS 2 since Iron, and before), and in joint states."""
_STAMPS = ("header.stamp", "stamp", "timestamp", "time", "header.timestamp")
_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("secs", "nsecs"))


@dataclass(frozen=True)
class MessageLog:
    """A log of messages: its format, and what opens its files in order.

    Several passes go over a log: an opened file is kept.
    """

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
        found := _find_joint_topic(file, profile, given)
    ):
        home, fields, (columns, joints), beside = found
        chosen = {name: one for name, one in columns.items() if name in profile.channels}
        if beside:
            numbers = {"case": "topic", "topic": home, "others": ", ".join(beside[:4])}
            other = Remedy({"topic": beside[0]}, "for the other")
            notices.append(Notice("JOINT_ORDER", numbers=numbers, remedies=(other,)))
    named = dict[str, TopicField]()
    own = [fields[chosen[name]].joint for name in ("theta1", "theta2") if name in chosen]
    if len(own) == 2 and all(own) and given.keys().isdisjoint(REFERENCES):
        named |= _references_of(file, own)
    for name, (topic, path) in given.items():
        if not (topic or home):
            raise LogError(f"{name} is taken from {path!r} without a topic: {TOPIC}")
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
        layouts = layouts_of(file, home)
        for channel, path in wanted.items():
            if not any(layout.find(path) for layout in layouts):
                known = [", ".join(one.paths[:12]) for one in layouts]
                held = next(filter(None, known), file.listed())
                setting = "topic" if home == profile.topic else f"{channel}.topic"
                other = Remedy({setting: None, f"{channel}.source": None})
                text = f"no message on {home!r} has {path!r} for {channel}; found {held}"
                raise LogError(file.lacking(f"{text}; name another: {other}"))
        stamps[home] = None
        if profile.clock != "log":
            around = next(iter(wanted.values())).partition("[")[0].rpartition(".")[0]
            stamps[home] = next(filter(None, (stamp_in(one, around) for one in layouts)), None)
        if profile.clock == "header" and stamps[home] is None:
            log_clock = Remedy({"clock": "log"})
            raise LogError(f"messages on {home!r} carry no stamp: {log_clock}")
        stated, lines = stated_of(file.channel(home), paths, layouts)
        units |= stated
        said += lines
    # topics have one clock: the recorder's where one of them has no stamps that move
    sampled = {fields[one].topic for name, one in chosen.items() if name not in REFERENCES}
    if len(sampled) > 1 and profile.clock is None:
        still = list[Notice]()
        for home in sampled:
            if own_stamp := stamps[home]:
                next(topic_tables(log.files, home, {}, own_stamp, None, still), None)
        if still or None in map(stamps.get, sampled):
            stamps = dict.fromkeys(stamps)
        notices += still
    # the main topic has the clock
    main, stamp = next(iter(stamps.items()))
    chosen["t"], time = "log time", TopicField("", is_clock=True)
    if stamp:
        chosen["t"] = stamp[0].rpartition(".")[0]
        time = TopicField(chosen["t"], main, is_clock=True)
    fields[chosen["t"]] = time

    def tables(
        sources: Mapping[str, str], _clock: Clock, told: list[Notice]
    ) -> Iterator[SampleTable]:
        """The samples of the first topic, each with what the others have at its time, in ns.

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
            return topic_tables(*own, told)

        main, *others = homes
        samples = read(main, told)
        if not others:
            return samples
        needed, followed = list[Series](), list[Series]()
        for one in others:
            only_followed = set(homes[one]) <= set(REFERENCES)
            own = list[Notice]() if only_followed else told  # it may be missing
            try:
                series = whole_topic(one, homes[one], read(one, own), own)
                (followed if only_followed else needed).append(series)
            except LogError as error:
                if not only_followed:
                    raise
                numbers = {"case": "reference", "topic": one, "why": str(error)}
                told.append(Notice("MESSAGES_LEFT_OUT", numbers=numbers))
        return aligned(in_order(samples, told), needed, told, followed)

    clock = "header" if stamp else "log"
    return Offered(
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


def _references_of(file: MessageFile, joints: Sequence[str]) -> dict[str, TopicField]:
    """By reference channel the field of what joints follow, if one topic alone tells it."""
    found: list[list[TopicField]] = []
    for topic in file.topics:
        kind = file.channel(topic).type
        if topic == _JOINT_REFERENCES or kind.endswith("/JointTrajectoryControllerState"):
            layout = _first_layout(file, topic)
            names = names_in(layout)
            for positions in _REFERENCES:
                paths = [f"{positions}[{names.index(one)}]" for one in joints if one in names]
                if len(paths) == len(joints) and all(map(layout.find, paths)):
                    found.append([TopicField(path, topic) for path in paths])
                    break
    return dict(zip(REFERENCES, found[0], strict=True)) if len(found) == 1 else {}


def _find_joint_topic(
    file: MessageFile, profile: Profile, given: Collection[str]
) -> tuple[str, dict[str, TopicField], ChannelChoice, list[str]] | None:
    """The one topic with joint states, its fields, those chosen, and other topics that hold two.

    None where there is none and a profile names the fields. Of channels that are `given` it need
    not hold the fields.

    Raises
    ------
    LogError
        If none holds two joints, several do, or one holds more and none was selected.
    """
    fitting: dict[str, tuple[dict[str, TopicField], ChannelChoice]] = {}
    refused, lacking = list[str](), dict[str, str]()
    needed = [name for name in profile.needed if name not in given]
    choose_two = Remedy({"joints": None}, "choose two")
    by_place = Remedy({"theta1.source": None}, "or name each field")
    for name in file.topics:
        channel = file.channel(name)
        known = channel.type.endswith(("/JointState", "/DynamicJointState"))
        known |= channel.encoding == "json" or any(map(channel.definition.__contains__, _TELLING))
        if name != profile.topic and (profile.topic or not known):
            continue
        try:
            for layout in layouts_of(file, name):
                try:
                    fields = fields_in(name, layout)
                    choice = _choice(fields, profile, given)
                except LookupError as error:
                    refused.insert(0, f"{name!r}: {error}; {choose_two}; {by_place} …")
                    continue
                if choice.columns.keys() >= set(needed):
                    fitting[name] = fields, choice
                    break
                if names_in(layout):
                    lacking[name] = f"{name!r} with {', '.join(layout.paths[:12])}"
        except LogError as error:  # another topic may still hold the joints
            refused.append(str(error))
    if _USUAL in fitting or len(fitting) == 1:
        topic = _USUAL if _USUAL in fitting else next(iter(fitting))
        return topic, *fitting.pop(topic), list(fitting)
    if fitting:
        raise LogError(f"joint states on {', '.join(fitting)}; choose: {TOPIC}")
    for refusal in refused:
        raise LogError(refusal)
    if all(profile.channel(name).source for name in profile.needed):
        return None
    wanted = f"the joints {profile.joints}" if profile.joints else "two joints"
    both = Remedy({"topic": None, "joints": None})
    each = Remedy({"tau1.topic": None, "tau1.source": None}, "or channel by channel")
    held = "; ".join([*lacking.values()][:4]) or file.listed()
    text = f"no topic holds {', '.join(needed)} of {wanted}; found {held}"
    raise LogError(file.lacking(f"{text}; name topics and fields: {both}; {each}"))


def _choice(
    fields: Mapping[str, TopicField], profile: Profile, given: Collection[str]
) -> ChannelChoice:
    """The fields that are chosen, of joints with a torque where some have none (grippers)."""
    names, tau = list(fields), STEMS["tau"]
    driven = {one.joint for name, one in fields.items() if name.rpartition("/")[2] in tau}
    if "tau1" in profile.needed and not ("tau1" in given or profile.passive):
        names = [name for name, one in fields.items() if not one.joint or one.joint in driven]
    return choose(names, profile.joints, given, profile.passive, profile.needed)


def fields_in(topic: str, layout: MessageLayout) -> dict[str, TopicField]:
    """The numbers of a message by names that tell: ``/joint_states/elbow/position``, ``tau1``.

    Raises
    ------
    LookupError
        If a joint is named twice.
    """
    fields, twice = dict[str, TopicField](), list[str]()
    for at, names in layout.texts.items():
        if at.rpartition(".")[2] in NAMES:
            twice += repeated(names)
    for place, path in zip(layout.numbers, layout.paths, strict=False):
        name, field = place, TopicField(place, topic)
        one = layout.named.get(path)
        if one and one.place == place:
            # of a structure's field, of an interface of a DynamicJointState, or of a list
            word = "_".join(each for each in _WORD.findall(one.behind) if each not in _VALUES)
            if one.label in NAMES and (one.behind or one.list in _STEMS):
                name = f"{topic}/{one.name}/{word or one.list}"
                field = TopicField(path, topic, one.name)
                twice += [one.name] * (name in fields)
        fields[name] = field
    if twice:
        raise LookupError(f"its messages name the joint {twice[0]!r} twice")
    return fields


def names_in(layout: MessageLayout) -> tuple[str, ...]:
    """The joints that a message of this layout names."""
    for path, texts in layout.texts.items():
        if path.rpartition(".")[2] in NAMES:
            return texts[: LIMITS.joints]
    return ()


def stamp_in(layout: MessageLayout, around: str) -> tuple[str, str] | None:
    """Where messages of this layout carry their own stamp: its seconds and nanoseconds.

    It is that of the structure `around` the numbers, or else of one that has it within.
    """
    for _ in range(LIMITS.definition_depth):
        for base, (seconds, nanoseconds) in product(_STAMPS, _PARTS):
            base = f"{around}.{base}".lstrip(".")
            pair = (f"{base}.{seconds}", f"{base}.{nanoseconds}")
            if all(map(layout.find, pair)):
                return pair
        if not around:
            break
        around = around.rpartition(".")[0]
    return None


def fields_shown(file: MessageFile, number: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Joints in a channel's first message, and its numbers' paths as a profile writes them."""
    layout = _first_layout(file, file.channels[number].topic)
    return names_in(layout), tuple(layout.paths)


def _first_layout(file: MessageFile, topic: str) -> MessageLayout:
    """The first layout of a topic's messages, an empty one where there is none."""
    with suppress(LogError):
        return next(iter(layouts_of(file, topic)), MessageLayout())
    return MessageLayout()


def layouts_of(file: MessageFile, topic: str) -> list[MessageLayout]:
    """Layouts of the topic's first messages that fit their schema.

    Raises
    ------
    LogError
        If none of them does.
    """
    if topic not in file.topics:
        return []
    decoder = Decoder({}, codec_for(file.channel(topic)))
    for messages in file.batches(file.topics[topic]):
        if isinstance(messages, str):
            file.damage.append(messages)
            continue
        for place in range(min(len(messages), _SAMPLES)):
            decoder.columns(messages.take(slice(place, place + 1)))
        if decoder.layouts:
            break
        if misfits := decoder.left_out.get("schema"):
            why = f"{misfits['first']}; it cannot be read"
            raise LogError(f"topic {topic!r}: {why}")
    return decoder.layouts
