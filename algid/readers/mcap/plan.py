"""Which topics and fields to read: told by a profile, else found by looking at the first messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from algid.errors import LogError
from algid.log import Notice, Reading
from algid.readers.joints import along_the_arm, order_notice
from algid.readers.mcap.catalogue import Catalogue, channels_of, kinds, schema_name
from algid.readers.mcap.codec import walk_for
from algid.readers.mcap.columnar import LARGEST_MESSAGE, MisfitError, Shape
from algid.readers.mcap.framing import File
from algid.readers.mcap.load import batches
from algid.readers.mcap.topic import (
    DYNAMIC_JOINT_STATE,
    JOINT_STATE,
    Fields,
    Topic,
    joint_fields,
    joint_names,
    names_in,
    other_positions,
    repeated_name,
    stamp_paths,
)
from algid.readers.names import CURRENTS, choose, take_apart
from algid.readers.table import JOINT_CHANNELS, VELOCITIES
from algid.words import counted

if TYPE_CHECKING:
    from algid.profile import Profile

_SAMPLES = 64
_MOST_CANDIDATES = 256
_LETTERS_A_STEP, _BYTES_A_STEP = 4, 4
"""Letters of a definition, and bytes of a message, that are read in a step of work."""
_USUAL = "/joint_states"


class NothingFoundError(LogError):
    """There is no such topic or message; damage to the file may be why."""


@dataclass(frozen=True)
class Plan:
    """The topics to read, the main one first, where each channel comes from, and what was decided.

    `others` has by joint the path of its position, of those that the main topic names and nobody asked for.
    """

    topics: tuple[Topic, ...]
    mapping: dict[str, str]
    reading: Reading
    notices: tuple[Notice, ...]
    units: dict[str, str]
    others: dict[str, str] = field(default_factory=dict)


def plan(file: File, found: Catalogue, profile: Profile | None) -> Plan:
    """What to read out of a file.

    Raises
    ------
    LogError
        If no topic holds the joints, several do, or a message cannot be read.
    """
    named = _named(profile)
    usual = _usual_topic(file, found, profile) if len(named) < len(JOINT_CHANNELS) else None
    sources: dict[str, tuple[str, str]] = {}
    reading = Reading(joints_told="profile")
    notices: tuple[Notice, ...] = ()
    if usual is not None:
        sources = {channel: (usual.topic, path) for channel, path in usual.paths.items()}
        reading, notices = _joints_reading(usual, profile)
    for channel, (topic, path) in named.items():
        home = topic or (usual.topic if usual else None) or (profile.topic if profile else None)
        if home is None:
            raise LogError(
                f"{file.path}: {channel} is taken from {path!r} without a topic: --topic NAME (profile: topic = …)"
            )
        sources[channel] = (home, path)
    if (profile and not profile.velocity) or not all(name in sources for name in VELOCITIES):
        sources = {name: source for name, source in sources.items() if name not in VELOCITIES}
    mapping = {channel: f"{topic}: {path}" for channel, (topic, path) in sources.items()}
    homes = list(dict.fromkeys(sources[name][0] for name in sources))
    topics = tuple(_topic(file, found, home, sources, profile) for home in homes)
    clock = topics[0].fields.stamp if topics[0].clock != "log" else None
    mapping["t"] = f"{homes[0]}: {clock[0].rpartition('.')[0]}" if clock else "log time"
    reading = replace(reading, topics=tuple(homes), clock="header" if clock else "log")
    units = {} if usual is None else {name: one for name, one in usual.units.items() if name not in named}
    others = usual.others if usual is not None and usual.topic == topics[0].name else {}
    return Plan(topics, mapping, reading, notices, units, others)


def _joints_reading(usual: _Usual, profile: Profile | None) -> tuple[Reading, tuple[Notice, ...]]:
    """Who said which joint is the first, and what to tell of it."""
    if profile is not None and profile.joints is not None:
        return Reading(joints=profile.joints, joints_told=profile.told_by("joints")), ()
    joints, told = along_the_arm(usual.joints)
    said = order_notice(usual.joints, joints, told) if usual.named else ()
    return Reading(joints=joints, joints_told=told), said


def _named(profile: Profile | None) -> dict[str, tuple[str | None, str]]:
    if profile is None:
        return {}
    places = {name: profile.place(name) for name in (*JOINT_CHANNELS, *VELOCITIES)}
    return {name: (topic, source) for name, (topic, source) in places.items() if source}


def _topic(
    file: File, found: Catalogue, name: str, sources: dict[str, tuple[str, str]], profile: Profile | None
) -> Topic:
    paths = {channel: path for channel, (topic, path) in sources.items() if topic == name}
    types = {type_name: _shown(file, found, name, type_name, paths) for type_name in _types(found, name)}
    types = {type_name: shown for type_name, shown in types.items() if shown.messages}
    if not types:
        mend = '--topic NAME, or --set CHANNEL.topic=NAME for one channel (profile: topic = "NAME")'
        told = f"there is no message on topic {name!r}; found {listed(found)}; name another: {mend}"
        raise NothingFoundError(f"{file.path}: {told}")
    type_name = min(types, key=lambda one: len(types[one].missing))
    shown = types[type_name]
    for channel in shown.missing:
        raise LogError(
            f"{file.path}: messages on {name!r} have no {paths[channel]!r} for {channel}; found "
            f"{', '.join(shown.known)}; name another: --set {channel}.source=FIELD (profile: source of [{channel}])"
        )
    clock = profile.clock if profile else None
    if clock == "header" and shown.stamp is None:
        raise LogError(f'{file.path}: messages on {name!r} carry no stamp: --clock log (profile: clock = "log")')
    return Topic(name, type_name, Fields(paths, shown.stamp), clock)


@dataclass(frozen=True)
class _Shown:
    """What the first messages of a topic and type show: the channels they miss, some of their paths, their stamp."""

    messages: int
    missing: tuple[str, ...]
    known: list[str]
    stamp: tuple[str, str] | None


def _shown(file: File, found: Catalogue, topic: str, type_name: str, paths: dict[str, str]) -> _Shown:
    missing, known, stamp, messages = tuple(paths), list[str](), None, 0
    for shape in _shapes(file, found, topic, type_name):
        messages += 1
        missing = tuple(channel for channel in missing if not shape.find(paths[channel]))
        known = known or [*shape.numbers][:12]
        stamp = stamp or stamp_paths(shape)
    return _Shown(messages, missing, known, stamp)


@dataclass(frozen=True)
class _Usual:
    """A topic with joint states: its two joints as they stand there, whether they have names, and its fields."""

    topic: str
    joints: tuple[str, str]
    named: bool
    paths: dict[str, str]
    units: dict[str, str] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)


def _flat(topic: str, shape: Shape, profile: Profile | None) -> _Usual | None:
    """A message of plain numbers, ``{"q1": …, "tau1": …}`` or ``{"q": […], "tau": […]}``, by their names."""
    paths = [path for name, one in shape.numbers.items() for path in _paths_of(name, one.count, ())]
    try:
        choice = choose(paths, profile.joints if profile else None)
    except LookupError:
        return None
    found = {name: path for name, path in choice.columns.items() if name != "t"}
    if not all(name in found for name in VELOCITIES):
        found = {name: path for name, path in found.items() if name not in VELOCITIES}
    if not set(JOINT_CHANNELS) <= found.keys() or not all(shape.find(path) for path in found.values()):
        return None
    currents = {name: "A" for name, path in found.items() if take_apart(path).stem in CURRENTS}
    joints = choice.joints or ("1", "2")
    return _Usual(topic, joints, choice.joints is not None, found, {**choice.units, **currents})


def _usual_topic(file: File, found: Catalogue, profile: Profile | None) -> _Usual | None:
    """The one topic with joint states."""
    fitting: dict[str, _Usual] = {}
    many: dict[str, list[str]] = {}
    lacking: list[str] = []
    refused: list[LogError] = []
    for name, type_name in _candidates(file, found, profile):
        try:
            for shape in _shapes(file, found, name, type_name):
                joints = joint_names(shape)
                chosen = _joints(joints, profile)
                if chosen:
                    there = (joints[0], joints[1]) if len(joints) == 2 else chosen
                    usual = _Usual(name, there, bool(names_in(shape)), joint_fields(shape, chosen))
                    fitting.setdefault(name, replace(usual, others=other_positions(shape, chosen)))
                    break
                if repeated := repeated_name(shape):
                    refused.append(_repeated(file, name, repeated))
                elif not joints and (flat := _flat(name, shape, profile)):
                    fitting.setdefault(name, flat)
                    break
                if len(joints) > 2 or (joints and profile and profile.joints):
                    many[name] = joints
                elif not joints and (lack := _lack(name, shape)) and lack not in lacking:
                    lacking.append(lack)
        except LogError as error:  # another topic may still hold the joints
            refused.append(error)
    if _USUAL in fitting:
        return fitting[_USUAL]
    if len(fitting) == 1:
        return next(iter(fitting.values()))
    if fitting:
        raise LogError(
            f'{file.path}: joint states on {", ".join(fitting)}; choose: --topic NAME (profile: topic = "NAME")'
        )
    if many:
        name, joints = next(iter(many.items()))
        told = ", ".join(joints[:12])
        raise LogError(
            f"{file.path}: {name!r} has {counted(len(joints), 'joint')} ({told}); choose: "
            "--joints A,B (profile: joints = […])"
        )
    if refused:
        raise refused[0]
    if profile is not None and all(profile.channel(name).source for name in JOINT_CHANNELS):
        return None
    wanted = f"the joints {profile.joints}" if profile and profile.joints else "positions and efforts of two joints"
    mend = "--topic NAME --joints A,B, or --set tau1.topic=NAME --set tau1.source=FIELD … (profile: topic, joints, …)"
    told = "; ".join(lacking[:4]) or listed(found)
    raise NothingFoundError(f"{file.path}: no topic holds {wanted}; found {told}; name topics and fields: {mend}")


def _lack(topic: str, shape: Shape) -> str | None:
    """What a message with named joints lacks."""
    joints = names_in(shape)
    if not joints:
        return None
    empty = [what for what in ("position", "effort") if shape.find(f"{what}[0]") is None]
    return f"{topic!r} with the joints {', '.join(joints[:8])}, whose {' and '.join(empty) or 'fields'} stay empty"


def fields_shown(file: File, found: Catalogue, number: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Joints that the first message of a channel names, and its numbers' paths as a profile's source takes them."""
    channel = found.channels[number]
    try:
        shape = next(_shapes(file, found, channel.topic, schema_name(found, channel)), None)
    except LogError:
        return (), ()
    if shape is None:
        return (), ()
    joints = names_in(shape)
    return joints, tuple(path for name, one in shape.numbers.items() for path in _paths_of(name, one.count, joints))


def _paths_of(name: str, count: int, joints: tuple[str, ...]) -> list[str]:
    """The paths of a field's numbers: one, none, or one a place."""
    if count < 2:
        return [name if count else f"{name} (empty)"]
    return [f"{name}[{place}]" for place in (joints if len(joints) == count else range(min(count, 64)))]


def _joints(names: list[str], profile: Profile | None) -> tuple[str, str] | None:
    if profile is not None and profile.joints is not None:
        return profile.joints if set(profile.joints) <= set(names) else None
    return along_the_arm(names)[0] if len(names) == 2 else None


def _repeated(file: File, topic: str, joint: str) -> LogError:
    return LogError(
        f"{file.path}: messages on {topic!r} name the joint {joint!r} twice; name the fields by their places, "
        '--set theta1.source="position[0]" … (profile: source = "position[0]" of [theta1] …)'
    )


def _candidates(file: File, found: Catalogue, profile: Profile | None) -> list[tuple[str, str]]:
    """Topics, each with a type of its messages, that may hold joint states; a profile's alone, where it names one."""
    places = kinds(found)
    if profile and profile.topic:
        return [place for place in places if place[0] == profile.topic]
    some = [place for place, numbers in places.items() if _may_hold(found, min(numbers))]
    if len(some) > _MOST_CANDIDATES:
        raise LogError(
            f"{file.path}: {counted(len(some), 'topic')} may hold joint states: --topic NAME (profile: topic = …)"
        )
    return some


def _may_hold(found: Catalogue, number: int) -> bool:
    channel = found.channels[number]
    schema = found.schemas.get(channel.schema_id)
    known = schema is not None and (schema.name in JOINT_STATE + DYNAMIC_JOINT_STATE or b"effort" in schema.data)
    return known or channel.message_encoding == "json"


def _types(found: Catalogue, topic: str) -> list[str]:
    return [type_name for name, type_name in kinds(found) if name == topic]


def _shapes(file: File, found: Catalogue, topic: str, type_name: str) -> Iterator[Shape]:
    """Shapes of the topic's first messages that fit their schema.

    Raises
    ------
    LogError
        If none of them does, or they ask for more work than those of any recorder.
    """
    channels = channels_of(found, topic, type_name)
    if not channels:
        return
    channel: Any = found.channels[min(channels)]
    schema = found.schemas.get(channel.schema_id)
    _work(file, topic, len(schema.data) // _LETTERS_A_STEP if schema else 0)
    walk = walk_for(str(file.path), channel, schema)
    for batch in batches(file, found, channels):
        messages = batch.messages
        if messages is None:
            found.damage.append(batch.reason)
        if messages is None or not len(messages):
            continue
        fitting, misfit = 0, None
        for start, size in zip(messages.starts[:_SAMPLES], messages.sizes[:_SAMPLES], strict=True):
            _work(file, topic, size // _BYTES_A_STEP)
            try:
                shape = walk(messages.content[start : start + min(size, LARGEST_MESSAGE)].tobytes())
            except MisfitError as error:
                misfit = error
                continue
            fitting += 1
            _work(file, topic, shape.parts)
            yield shape
        if misfit and not fitting:
            raise LogError(f"{file.path}: topic {topic!r}: {misfit}; it cannot be read") from misfit
        return


def _work(file: File, topic: str, steps: int) -> None:
    if not file.works(steps):
        raise LogError(f"{file.path}: topic {topic!r}: messages or definitions of more parts than any recorder's")


def listed(found: Catalogue) -> str:
    """The topics of a file, with their types, for a message."""
    topics = [
        f"{channel.topic!r} ({schema_name(found, channel) or 'no schema'}, {channel.message_encoding!r})"
        for channel in found.channels.values()
    ]
    more = f" and {len(topics) - 12} more" if len(topics) > 12 else ""
    return (", ".join(topics[:12]) or "no topic") + more
