"""Choice of the topics and fields to read: by a profile, else by the first messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING, Any

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.units import unit_of
from algid.base.words import counted
from algid.log import Reading
from algid.notices import Notice, Remedy
from algid.readers.joints import along_the_arm, order_notice
from algid.readers.messages.codec import walk_for
from algid.readers.messages.columnar import MisfitError, Shape
from algid.readers.messages.message_file import MessageFile, channels_by_type, channels_of, listed
from algid.readers.messages.topic import (
    DYNAMIC_JOINT_STATE,
    JOINT_REFERENCES,
    JOINT_STATE,
    TRAJECTORY_STATE,
    Fields,
    Topic,
    joint_fields,
    joint_names,
    names_in,
    other_positions,
    reference_fields,
    repeated_name,
    stamp_paths,
)
from algid.readers.names import CURRENTS, choose, take_apart
from algid.readers.stated import in_json_schema, lines_of, units_in
from algid.readers.table import CHANNELS, JOINT_CHANNELS, REFERENCES, VELOCITIES

if TYPE_CHECKING:
    from algid.profile import Profile

_SAMPLES = 64
_TOPIC = Remedy({"topic": None})
_JOINTS = Remedy({"joints": None})
_USUAL = "/joint_states"
_TELLING = (b"effort", b"tau_est", b"tau_J")
"""Names of torques in definitions: of ROS, Unitree, libfranka."""


class NothingFoundError(LogError):
    """There is no such topic or message; damage to the file may be why.

    `lacking` is the text without the file's name.
    """

    def __init__(self, text: str, lacking: str = "") -> None:
        super().__init__(text)
        self.lacking = lacking or text


@dataclass(frozen=True)
class Plan:
    """The topics to read, the main one first, where each channel comes from, and what was decided.

    `others` has by joint the path of its position, of those that the main topic names and nobody
    asked for.
    """

    topics: tuple[Topic, ...]
    mapping: dict[str, str]
    reading: Reading
    notices: tuple[Notice, ...]
    units: dict[str, str]
    others: dict[str, str] = field(default_factory=dict)
    said: tuple[str, ...] = ()
    """What definitions, schemas and metadata state in words."""


def plan(file: MessageFile, profile: Profile | None) -> Plan:
    """What to read out of a file.

    Raises
    ------
    LogError
        If no topic holds the joints, several do, or a message cannot be read.
    """
    read, needed = _channels(profile)
    named: dict[str, tuple[str | None, str]] = {}
    if profile is not None:
        for channel in read:
            topic, path = profile.place(channel)
            if path:
                named[channel] = (topic, path)
    usual = None
    if not set(needed) <= named.keys():
        usual = _find_joint_topic(file, profile)
    sources: dict[str, tuple[str, str]] = {}
    units: dict[str, str] = {}
    reading = Reading(joints_told="profile")
    notices: tuple[Notice, ...] = ()
    home = None if profile is None else profile.topic
    if usual is not None:
        home = usual.topic
        for channel, path in usual.paths.items():
            if channel in read:
                sources[channel] = (usual.topic, path)
        reading, notices = _reading(usual, profile)
        notices += _choice_notice(usual)
        if usual.named and reading.joints and named.keys().isdisjoint(REFERENCES):
            sources |= _reference(file, reading.joints)
        units = {name: unit for name, unit in usual.units.items() if name not in named}
    for channel, (own, path) in named.items():
        place = own or home
        if place is None:
            raise LogError(
                f"{file.path}: {channel} is taken from {path!r} without a topic: {_TOPIC}"
            )
        sources[channel] = (place, path)
    _leave_out_halves(sources)
    if profile is not None and not profile.velocity:
        for name in VELOCITIES:
            sources.pop(name, None)
    mapping = {}
    homes = []
    for channel, (topic, path) in sources.items():
        mapping[channel] = f"{topic}: {path}"
        if topic not in homes:
            homes.append(topic)
    topics = tuple(_topic(file, one, sources, profile) for one in homes)
    main = topics[0]
    if main.clock == "log" or main.fields.stamp is None:
        mapping["t"] = "log time"
        reading = replace(reading, topics=tuple(homes), clock="log")
    else:
        seconds, _ = main.fields.stamp
        mapping["t"] = f"{main.name}: {seconds.rpartition('.')[0]}"
        reading = replace(reading, topics=tuple(homes), clock="header")
    others: dict[str, str] = {}
    if usual is not None and usual.topic == main.name:
        others = usual.others
    said: list[str] = []
    for one in topics:
        stated, lines = _stated(file, one)
        units = stated | units
        said += lines
    return Plan(topics, mapping, reading, notices, units, others, tuple(said))


def _stated(file: MessageFile, topic: Topic) -> tuple[dict[str, str], list[str]]:
    """By channel the unit that a topic's schema or metadata state; what else is stated, as text."""
    channel = file.channels[min(channels_of(file, topic.name, topic.type))]
    text = channel.definition.decode("utf-8", errors="replace")
    metadata, lines = dict(channel.metadata), list(lines_of(channel.metadata))
    if channel.encoding == "json":
        units, descriptions = in_json_schema(text)
        metadata |= units
        lines += descriptions
        for shape in islice(_shapes(file, topic.name, topic.type), 1):
            lines += [f"{path}: {label}" for path, label in shape.labels.items() if "unit" in path]
    elif channel.definition_encoding.startswith("ros"):
        lines += [line for line in text.splitlines() if "#" in line or "//" in line]
    fields = {name: path.partition("[")[0] for name, path in topic.fields.paths.items()}
    by_field = units_in(metadata, list(dict.fromkeys(fields.values())))
    units = {name: by_field[path] for name, path in fields.items() if path in by_field}
    return {name: unit_of(unit) or unit for name, unit in units.items()}, lines


def _reading(usual: _JointTopic, profile: Profile | None) -> tuple[Reading, tuple[Notice, ...]]:
    """Which joints of the topic are read, by the user or along the arm, and what to say of it."""
    if profile is not None and profile.joints is not None:
        return Reading(joints=profile.joints, joints_told=profile.told_by("joints")), ()
    joints, by = along_the_arm(usual.joints)
    reading = Reading(joints=joints, joints_told=by)
    if not usual.named:
        return reading, ()
    return reading, order_notice(usual.joints, joints, by)


def _leave_out_halves(by_channel: dict[str, Any]) -> None:
    """Leave out velocities, and references, of which one joint's is missing."""
    for both in (VELOCITIES, REFERENCES):
        if not by_channel.keys() >= set(both):
            for name in both:
                by_channel.pop(name, None)


def _channels(profile: Profile | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The channels to read, and those of them without which there is no log."""
    if profile is None:
        return CHANNELS, JOINT_CHANNELS
    return profile.channels, profile.needed


def _reference(file: MessageFile, joints: tuple[str, str]) -> dict[str, tuple[str, str]]:
    """By reference channel topic and path of what joints follow, if one topic alone tells it."""
    by_topic = {}
    for topic, kind in channels_by_type(file):
        if kind not in TRAJECTORY_STATE and (topic != JOINT_REFERENCES or kind not in JOINT_STATE):
            continue
        try:
            shape = next(_shapes(file, topic, kind), None)
        except LogError:  # the log is read without it
            continue
        if shape is not None:
            paths = reference_fields(shape, joints)
            if paths:
                by_topic[topic] = {name: (topic, path) for name, path in paths.items()}
    if len(by_topic) != 1:
        return {}
    return by_topic.popitem()[1]


def _choice_notice(usual: _JointTopic) -> tuple[Notice, ...]:
    """What to say where other topics hold two joints too."""
    if not usual.beside:
        return ()
    numbers = {"topic": usual.topic, "others": ", ".join(usual.beside[:4])}
    other = Remedy({"topic": usual.beside[0]}, "for the other")
    return (Notice("JOINT_ORDER", numbers={"case": "topic"} | numbers, remedies=(other,)),)


def _topic(
    file: MessageFile, name: str, sources: dict[str, tuple[str, str]], profile: Profile | None
) -> Topic:
    """A topic by its name, with its own `sources`, of the type that lacks the fewest of them."""
    paths = {}
    for channel, (home, path) in sources.items():
        if home == name:
            paths[channel] = path
    best: tuple[str, list[str], list[str], tuple[str, str] | None] | None = None
    for topic, kind in channels_by_type(file):
        if topic != name:
            continue
        missing, known, stamp, messages = list(paths), list[str](), None, 0
        for shape in _shapes(file, topic, kind):
            messages += 1
            missing = [channel for channel in missing if not shape.find(paths[channel])]
            known = known or list(shape.numbers)[:12]
            stamp = stamp or stamp_paths(shape)
        if messages and (best is None or len(missing) < len(best[1])):
            best = (kind, missing, known, stamp)
    if best is None:
        text = (
            f"there is no message on topic {name!r}; found {listed(file)}; name another: {_TOPIC}"
        )
        one = Remedy({"tau1.topic": None}, "for one channel")
        raise NothingFoundError(f"{file.path}: {text}; {one}", f"{text}; {one}")
    kind, missing, known, stamp = best
    if missing:
        channel = missing[0]
        raise LogError(
            f"{file.path}: messages on {name!r} have no {paths[channel]!r} for {channel}; found "
            f"{', '.join(known)}; {Remedy({f'{channel}.source': None}, 'name another')}"
        )
    clock = None if profile is None else profile.clock
    if clock == "header" and stamp is None:
        log_clock = Remedy({"clock": "log"})
        raise LogError(f"{file.path}: messages on {name!r} carry no stamp: {log_clock}")
    return Topic(name, kind, Fields(paths, stamp), clock)


@dataclass(frozen=True)
class _JointTopic:
    """A topic with joint states: its two joints, whether they are named, and its fields."""

    topic: str
    joints: tuple[str, str]
    named: bool
    paths: dict[str, str]
    units: dict[str, str] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)
    beside: tuple[str, ...] = ()
    """Other topics that hold two joints too."""


def _find_joint_topic(file: MessageFile, profile: Profile | None) -> _JointTopic | None:
    """The one topic with joint states; None where there is none and a profile names the fields."""
    fitting: dict[str, _JointTopic] = {}
    many: dict[str, dict[str, None]] = {}
    lacking: list[str] = []
    refused: list[LogError] = []
    _, needed = _channels(profile)
    for name, kind in _candidates(file, profile):
        try:
            for shape in _shapes(file, name, kind):
                joints, names = joint_names(shape, needed), names_in(shape)
                if usual := _joint_topic_in(name, shape, joints, profile):
                    fitting.setdefault(name, usual)
                    break
                if repeated := repeated_name(shape):
                    text = f"messages on {name!r} name the joint {repeated!r} twice"
                    by_place = Remedy(
                        {"theta1.source": "position[0]"}, "name the fields by their places"
                    )
                    refused.append(LogError(f"{file.path}: {text}; {by_place} …"))
                if len(joints) > 2 or (joints and profile and profile.joints):
                    many.setdefault(name, {}).update(dict.fromkeys(joints))
                elif len(joints) < 2 and names:
                    lacking.append(f"{name!r} {_lacking(shape, names, needed)}")
        except LogError as error:  # another topic may still hold the joints
            refused.append(error)
    if _USUAL in fitting:
        usual = fitting.pop(_USUAL)
        return replace(usual, beside=tuple(fitting))
    if len(fitting) == 1:
        return fitting.popitem()[1]
    if fitting:
        raise LogError(f"{file.path}: joint states on {', '.join(fitting)}; choose: {_TOPIC}")
    if many:
        name, own = next(iter(many.items()))
        text = f"{name!r} has {counted(len(own), 'joint')} ({', '.join(list(own)[:12])})"
        raise LogError(f"{file.path}: {text}; choose: {_JOINTS}")
    if refused:
        raise refused[0]
    if profile is not None and all(profile.channel(name).source for name in needed):
        return None
    wanted = f"{' and '.join(f'{what}s' for what in _words(needed))} of two joints"
    if profile is not None and profile.joints:
        wanted = f"the joints {profile.joints}"
    both = Remedy({"topic": None, "joints": None})
    each = Remedy({"tau1.topic": None, "tau1.source": None}, "or channel by channel")
    there = "; ".join(list(dict.fromkeys(lacking))[:4]) or listed(file)
    why = f"no topic holds {wanted}; found {there}; name topics and fields: {both}; {each}"
    raise NothingFoundError(f"{file.path}: {why}", why)


def _lacking(shape: Shape, names: Sequence[str], needed: Sequence[str]) -> str:
    """Which joints a message names, and which of their quantities it leaves empty."""
    last = len(names) - 1
    text = f"with the joints {', '.join(names[:8])}"
    empty = [what for what in _words(needed) if shape.find(f"{what}[{last}]") is None]
    if empty:
        text += f", whose {' and '.join(empty)} stay empty"
    return text


def _words(channels: Sequence[str]) -> list[str]:
    """What a joint state calls the quantities of the channels."""
    words = {"theta": "position", "tau": "effort"}
    return [word for quantity, word in words.items() if f"{quantity}1" in channels]


def _joint_topic_in(
    topic: str, shape: Shape, joints: list[str], profile: Profile | None
) -> _JointTopic | None:
    """The two joints to read and their fields.

    None if one is missing, or if there are more than two and none was selected.
    """
    wanted = None if profile is None else profile.joints
    chosen = None
    if wanted is not None:
        if set(wanted) <= set(joints):
            chosen = wanted
    elif len(joints) == 2:
        chosen, _ = along_the_arm(joints)
    if chosen:
        there = (joints[0], joints[1]) if len(joints) == 2 else chosen
        named = bool(names_in(shape))
        return _JointTopic(
            topic, there, named, joint_fields(shape, chosen), others=other_positions(shape, chosen)
        )
    if joints or repeated_name(shape):
        return None
    _, needed = _channels(profile)
    # plain numbers by their names: {"q1": …, "tau1": …} or {"q": […], "tau": […]}
    try:
        choice = choose(_paths(shape, ()), wanted, needed=needed)
    except LookupError:
        return None
    path_of = {}
    for name, path in choice.columns.items():
        if name != "t" and shape.find(path):
            path_of[name] = path
        elif name in needed:
            return None
    _leave_out_halves(path_of)
    if not set(needed) <= path_of.keys():
        return None
    units = dict(choice.units)
    for name, path in path_of.items():
        if take_apart(path).stem in CURRENTS:
            units[name] = "A"
    return _JointTopic(
        topic, choice.joints or ("1", "2"), choice.joints is not None, path_of, units
    )


def _candidates(file: MessageFile, profile: Profile | None) -> list[tuple[str, str]]:
    """Topics, each with a type of its messages, that may hold joint states.

    A profile's alone, where it names one.

    Raises
    ------
    LogError
        Where several topics may hold them and no profile names one.
    """
    places = channels_by_type(file)
    if profile and profile.topic:
        return [place for place in places if place[0] == profile.topic]
    some = []
    for place, numbers in places.items():
        channel = file.channels[min(numbers)]
        known = channel.type in JOINT_STATE + DYNAMIC_JOINT_STATE
        known = known or any(word in channel.definition for word in _TELLING)
        if known or channel.encoding == "json":
            some.append(place)
    if len(some) > LIMITS.topics:
        raise LogError(
            f"{file.path}: {counted(len(some), 'topic')} may hold joint states: {_TOPIC}"
        )
    return some


def fields_shown(file: MessageFile, number: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Joints in a channel's first message, and its numbers' paths as a profile writes them."""
    channel = file.channels[number]
    try:
        shape = next(_shapes(file, channel.topic, channel.type), None)
    except LogError:
        return (), ()
    if shape is None:
        return (), ()
    joints = names_in(shape)
    return joints, tuple(_paths(shape, joints))


def _paths(shape: Shape, joints: tuple[str, ...]) -> Iterator[str]:
    """The paths of a message's numbers: of a field one, none, or one a place."""
    for name, field_shape in shape.numbers.items():
        count = field_shape.count
        if count == 0:
            yield f"{name} (empty)"
        elif count == 1:
            yield name
        elif count == len(joints):
            for joint in joints:
                yield f"{name}[{joint}]"
        else:
            for place in range(min(count, LIMITS.joint_cells)):
                yield f"{name}[{place}]"


def _shapes(file: MessageFile, topic: str, type_name: str) -> Iterator[Shape]:
    """Shapes of the topic's first messages that fit their schema.

    Raises
    ------
    LogError
        If none of them does.
    """
    channels = channels_of(file, topic, type_name)
    if not channels:
        return
    channel = file.channels[min(channels)]
    walk = walk_for(file.path, channel)
    for batch in file.batches(channels):
        messages = batch.messages
        if messages is None:
            file.damage.append(batch.reason)
        if messages is None or not len(messages):
            continue
        fitting, misfit = 0, None
        for start, size in zip(messages.starts[:_SAMPLES], messages.sizes[:_SAMPLES], strict=True):
            end = start + min(size, LIMITS.message_bytes)
            try:
                shape = walk(messages.content[start:end].tobytes())
            except MisfitError as error:
                misfit = error
                continue
            fitting += 1
            yield shape
        if misfit and not fitting:
            raise LogError(f"{file.path}: topic {topic!r}: {misfit}; it cannot be read") from misfit
        return
