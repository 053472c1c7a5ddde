"""Choice of the topics and fields to read: by a profile, else by the first messages."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.units import unit_of
from algid.base.words import counted, repeated
from algid.log import Reading
from algid.notices import Notice, Remedy
from algid.profile import Profile
from algid.readers.column_names import COMMANDED, CURRENTS, STEMS, choose, units_in_names
from algid.readers.joints import along_the_arm, reading_of
from algid.readers.messages.codec import codec_for
from algid.readers.messages.layout import MessageLayout, MisfitError
from algid.readers.messages.message_file import MessageFile, channels_by_topic, listed
from algid.readers.messages.topic import Topic
from algid.readers.stated import in_json_schema, lines_of, units_in
from algid.readers.table import REFERENCES, VELOCITIES

_SAMPLES = 64
_TOPIC = Remedy({"topic": None})
_JOINTS = Remedy({"joints": None})
_USUAL = "/joint_states"
_TELLING = (b"effort", b"tau_est", b"tau_J")
"""Names of torques in definitions: of ROS, Unitree, libfranka."""
_JOINT_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
_DYNAMIC_JOINT_STATE = ("control_msgs/msg/DynamicJointState", "control_msgs/DynamicJointState")
_TRAJECTORY_STATE = (
    "control_msgs/msg/JointTrajectoryControllerState",
    "control_msgs/JointTrajectoryControllerState",
)
_JOINT_REFERENCES = "/joint_references"
"""The topic of joint states that algid writes what the joints are to follow to."""
_REFERENCES = ("reference.positions", "desired.positions", "position")
"""In the state of a trajectory controller (ROS 2 since Iron, and before), and in joint states."""
_QUANTITIES = {"theta": "position", "tau": "effort", "omega": "velocity"}
_STAMPS = ("header.stamp", "stamp", "timestamp", "time", "header.timestamp")
_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("secs", "nsecs"))


class NothingFoundError(LogError):
    """There is no such topic or message; damage to the file may be why.

    `lacking` is the text without the file's name.
    """

    def __init__(self, path: str, lacking: str) -> None:
        super().__init__(f"{path}: {lacking}")
        self.lacking = lacking


@dataclass(frozen=True)
class Plan:
    """The topics to read, the main one first, where each channel comes from, and what was decided.

    `others` has by joint the path of its position, of those that the main topic names and nobody
    asked for. `said` is what definitions, schemas and metadata state in words.
    """

    topics: tuple[Topic, ...]
    mapping: dict[str, str]
    reading: Reading
    notices: tuple[Notice, ...]
    units: dict[str, str]
    others: dict[str, str]
    said: tuple[str, ...]


@dataclass(frozen=True)
class JointTopic:
    """A topic with joint states: its two joints, whether they are named, and its fields.

    `beside` are other topics that hold two joints too.
    """

    topic: str
    joints: tuple[str, str]
    named: bool
    paths: dict[str, str]
    units: dict[str, str] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)
    beside: tuple[str, ...] = ()


def plan(file: MessageFile, profile: Profile) -> Plan:
    """What to read out of a file.

    Raises
    ------
    LogError
        If no topic holds the joints, several do, or a message cannot be read.
    """
    given: dict[str, tuple[str | None, str]] = {}
    for channel in profile.channels:
        topic, path = profile.place(channel)
        if path:
            given[channel] = (topic, path)
    found = None
    if not set(profile.needed) <= given.keys():
        found = find_joint_topic(file, profile)
    sources: dict[str, tuple[str, str]] = {}
    units: dict[str, str] = {}
    reading, notices = Reading(joints_told="profile"), list[Notice]()
    if found is not None:
        for channel, path in found.paths.items():
            if channel in profile.channels:
                sources[channel] = (found.topic, path)
        reading, order = reading_of(found.joints, profile)
        notices += order if found.named else ()
        if found.beside:
            numbers = {"topic": found.topic, "others": ", ".join(found.beside[:4])}
            other = Remedy({"topic": found.beside[0]}, "for the other")
            choice = {"case": "topic"} | numbers
            notices.append(Notice("JOINT_ORDER", numbers=choice, remedies=(other,)))
        if found.named and reading.joints and given.keys().isdisjoint(REFERENCES):
            sources |= _references(file, reading.joints)
        units = {name: unit for name, unit in found.units.items() if name not in given}
    for channel, (own, path) in given.items():
        place = own or (found.topic if found else None)
        if place is None:
            raise LogError(
                f"{file.path}: {channel} is taken from {path!r} without a topic: {_TOPIC}"
            )
        sources[channel] = (place, path)
    for pair in (VELOCITIES, REFERENCES):  # both joints', or none
        if not sources.keys() >= set(pair) or (
            pair == VELOCITIES and profile.velocity == "observer"
        ):
            for name in pair:
                sources.pop(name, None)
    homes = tuple(dict.fromkeys(topic for topic, _ in sources.values()))
    topics = tuple(_topic(file, home, sources, profile) for home in homes)
    mapping = {channel: f"{topic}: {path}" for channel, (topic, path) in sources.items()}
    main, clock = topics[0], "log"
    mapping["t"] = "log time"
    if profile.clock != "log" and main.stamp is not None:
        mapping["t"], clock = f"{main.name}: {main.stamp[0].rpartition('.')[0]}", "header"
    said: list[str] = []
    for one in topics:
        stated, lines = _stated(file, one)
        units = stated | units
        said += lines
    others = found.others if found is not None and found.topic == main.name else {}
    reading = replace(reading, topics=homes, clock=clock)
    return Plan(topics, mapping, reading, tuple(notices), units, others, tuple(said))


def _stated(file: MessageFile, topic: Topic) -> tuple[dict[str, str], list[str]]:
    """By channel the unit that a topic's schema or metadata state; what else is stated, as text."""
    channel = file.channels[min(channels_by_topic(file)[topic.name])]
    text = channel.definition.decode("utf-8", errors="replace")
    metadata, lines = dict(channel.metadata), list(lines_of(channel.metadata))
    if channel.encoding == "json":
        units, descriptions = in_json_schema(text)
        metadata |= units
        lines += descriptions
        for layout in islice(_layouts(file, topic.name), 1):
            lines += [f"{path}: {label}" for path, label in layout.labels.items() if "unit" in path]
    elif channel.definition_encoding.startswith("ros"):
        lines += [line for line in text.splitlines() if "#" in line or "//" in line]
    fields = {name: path.partition("[")[0] for name, path in topic.paths.items()}
    by_field = units_in(metadata, list(dict.fromkeys(fields.values())))
    named = {name: by_field[path] for name, path in fields.items() if path in by_field}
    return {name: unit_of(unit) or unit for name, unit in named.items()}, lines


def _references(file: MessageFile, joints: tuple[str, str]) -> dict[str, tuple[str, str]]:
    """By reference channel topic and path of what joints follow, if one topic alone tells it."""
    by_topic = {}
    for topic, numbers in channels_by_topic(file).items():
        kind = file.channels[min(numbers)].type
        if kind not in _TRAJECTORY_STATE and (
            topic != _JOINT_REFERENCES or kind not in _JOINT_STATE
        ):
            continue
        try:
            layout = next(_layouts(file, topic), MessageLayout())
        except LogError:  # the log is read without it
            continue
        names = names_in(layout)
        for positions in _REFERENCES if set(joints) <= set(names) else ():
            paths = [f"{positions}[{names.index(joint)}]" for joint in joints]
            if layout.has(paths):
                by_topic[topic] = {
                    name: (topic, path) for name, path in zip(REFERENCES, paths, strict=True)
                }
                break
    return by_topic.popitem()[1] if len(by_topic) == 1 else {}


def _topic(
    file: MessageFile, name: str, sources: dict[str, tuple[str, str]], profile: Profile
) -> Topic:
    """A topic by its name, with its own `sources`."""
    paths = {channel: path for channel, (home, path) in sources.items() if home == name}
    missing, known, stamp = dict(paths), list[str](), None
    for layout in _layouts(file, name):
        missing = {channel: path for channel, path in missing.items() if not layout.find(path)}
        known = known or list(layout.numbers)[:12] or ["nothing"]
        stamp = stamp or _stamp_in(layout)
    if not known:
        each = Remedy({"tau1.topic": None}, "for one channel")
        raise NothingFoundError(
            file.path,
            f"there is no message on topic {name!r}; found {listed(file)}; name another: {_TOPIC}; "
            f"{each}",
        )
    for channel, path in missing.items():
        raise LogError(
            f"{file.path}: messages on {name!r} have no {path!r} for {channel}; found "
            f"{', '.join(known)}; {Remedy({f'{channel}.source': None}, 'name another')}"
        )
    if profile.clock == "header" and stamp is None:
        log_clock = Remedy({"clock": "log"})
        raise LogError(f"{file.path}: messages on {name!r} carry no stamp: {log_clock}")
    return Topic(name, paths, stamp, profile.clock)


def find_joint_topic(file: MessageFile, profile: Profile) -> JointTopic | None:
    """The one topic with joint states; None where there is none and a profile names the fields.

    Raises
    ------
    LogError
        If several hold two joints, or one holds more and none was selected.
    NothingFoundError
        If none holds them.
    """
    fitting: dict[str, JointTopic] = {}
    lacking: dict[str, None] = {}
    crowded, refused = list[LogError](), list[LogError]()
    needed = [what for what in _QUANTITIES if f"{what}1" in profile.needed]
    words = [_QUANTITIES[what] for what in needed]
    for name, numbers in channels_by_topic(file).items():
        channel = file.channels[min(numbers)]
        known = channel.type in _JOINT_STATE + _DYNAMIC_JOINT_STATE or channel.encoding == "json"
        known = known or any(word in channel.definition for word in _TELLING)
        if name != profile.topic and (profile.topic or not known):
            continue
        there: dict[str, None] = {}
        try:
            for layout in _layouts(file, name):
                names = names_in(layout)
                joints = _joints_in(layout, needed)
                if found := _joint_topic_in(name, layout, joints, profile):
                    fitting[name] = found
                    break
                if twice := repeated(names):
                    text = f"messages on {name!r} name the joint {twice[0]!r} twice"
                    by_place = Remedy(
                        {"theta1.source": "position[0]"}, "name the fields by their places"
                    )
                    refused.append(LogError(f"{file.path}: {text}; {by_place} …"))
                if len(joints) > 2 or (joints and profile.joints):
                    there |= dict.fromkeys(joints)
                elif len(joints) < 2 and names:
                    empty = [word for word in words if not layout.find(f"{word}[{len(names) - 1}]")]
                    stay = f", whose {' and '.join(empty)} stay empty" if empty else ""
                    lacking[f"{name!r} with the joints {', '.join(names[:8])}{stay}"] = None
        except LogError as error:  # another topic may still hold the joints
            refused.append(error)
        if there and name not in fitting:
            text = f"{name!r} has {counted(len(there), 'joint')} ({', '.join(list(there)[:12])})"
            crowded.append(LogError(f"{file.path}: {text}; choose: {_JOINTS}"))
    if _USUAL in fitting:
        found = fitting.pop(_USUAL)
        return replace(found, beside=tuple(fitting))
    if len(fitting) == 1:
        return fitting.popitem()[1]
    if fitting:
        raise LogError(f"{file.path}: joint states on {', '.join(fitting)}; choose: {_TOPIC}")
    for refusal in crowded + refused:
        raise refusal
    if all(profile.channel(name).source for name in profile.needed):
        return None
    wanted = f"{' and '.join(f'{word}s' for word in words)} of two joints"
    if profile.joints:
        wanted = f"the joints {profile.joints}"
    both = Remedy({"topic": None, "joints": None})
    each = Remedy({"tau1.topic": None, "tau1.source": None}, "or channel by channel")
    held = "; ".join(list(lacking)[:4]) or listed(file)
    raise NothingFoundError(
        file.path,
        f"no topic holds {wanted}; found {held}; name topics and fields: {both}; {each}",
    )


def _joint_topic_in(
    topic: str, layout: MessageLayout, joints: list[str], profile: Profile
) -> JointTopic | None:
    """The two joints to read and their fields.

    None if one is missing, or if there are more than two and none was selected.
    """
    chosen = None
    if profile.joints is not None:
        if set(profile.joints) <= set(joints):
            chosen = profile.joints
    elif len(joints) == 2:
        chosen, _ = along_the_arm(joints)
    names = names_in(layout)
    if chosen:
        paths, others = {}, {}
        for quantity in _QUANTITIES:
            for number, joint in enumerate(chosen, start=1):
                if path := _path(layout, joint, quantity):
                    paths[f"{quantity}{number}"] = path
        for name in [name for name in names if name not in chosen][: LIMITS.other_joints]:
            if path := _path(layout, name, "theta"):
                others[name] = path
        there = (joints[0], joints[1]) if len(joints) == 2 else chosen
        return JointTopic(topic, there, bool(names), paths, others=others)
    if joints or repeated(names):
        return None
    # plain numbers by their names: {"q1": …, "tau1": …} or {"q": […], "tau": […]}
    try:
        choice = choose(_paths(layout, ()), profile.joints, needed=profile.needed)
    except LookupError:
        return None
    paths = {}
    for name, path in choice.columns.items():
        if name != "t" and layout.find(path):
            paths[name] = path
    if not set(profile.needed) <= paths.keys():
        return None
    units = units_in_names(paths, {})
    return JointTopic(topic, choice.joints or ("1", "2"), choice.joints is not None, paths, units)


def names_in(layout: MessageLayout) -> tuple[str, ...]:
    """The joints that a message of this layout names."""
    for path, texts in layout.texts.items():
        if path in ("name", "names", "joint_names"):
            return texts[: LIMITS.joints]
    return ()


def _joints_in(layout: MessageLayout, quantities: Collection[str]) -> list[str]:
    """Joints for which a message of this layout has all `quantities`."""
    names = names_in(layout) or tuple(map(str, range(LIMITS.joint_cells)))
    return [name for name in names if all(_path(layout, name, one) for one in quantities)]


def _path(layout: MessageLayout, joint: str, quantity: str) -> str | None:
    """Path of a joint's number in this layout: in a list beside its name, or in its interfaces."""
    word = _QUANTITIES[quantity]
    paths = [f"{word}[{joint}]", f"interface_values[{joint}].values[{word}]"]
    if not joint.isdigit():  # beside a list of names other lists may stand: {"joint_names", "q"}
        for stem in STEMS[quantity]:
            there = stem in layout.numbers or f"{stem}[0]" in layout.numbers
            if there and stem not in COMMANDED | CURRENTS:
                paths.append(f"{stem}[{joint}]")
    return next((path for path in paths if layout.find(path) is not None), None)


def _stamp_in(layout: MessageLayout) -> tuple[str, str] | None:
    """Where messages of this layout carry their own stamp: its seconds and nanoseconds."""
    for base in _STAMPS:
        for seconds, nanoseconds in _PARTS:
            pair = (f"{base}.{seconds}", f"{base}.{nanoseconds}")
            if layout.has(pair):
                return pair
    return None


def fields_shown(file: MessageFile, number: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Joints in a channel's first message, and its numbers' paths as a profile writes them."""
    try:
        layout = next(_layouts(file, file.channels[number].topic), MessageLayout())
    except LogError:
        return (), ()
    joints = names_in(layout)
    return joints, tuple(_paths(layout, joints))


def _paths(layout: MessageLayout, joints: Sequence[str]) -> Iterator[str]:
    """The paths of a message's numbers: of a field one, none, or one a place."""
    for name, numbers in layout.numbers.items():
        count = numbers.count
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


def _layouts(file: MessageFile, topic: str) -> Iterator[MessageLayout]:
    """Layouts of the topic's first messages that fit their schema.

    Raises
    ------
    LogError
        If none of them does.
    """
    channels = channels_by_topic(file).get(topic)
    if not channels:
        return
    codec = codec_for(file.path, file.channels[min(channels)])
    for batch in file.batches(channels):
        messages = batch.messages
        if messages is None:
            file.damage.append(batch.reason)
        if messages is None or not len(messages):
            continue
        fitting, misfit = 0, None
        records = codec.records(messages.take(slice(_SAMPLES)))
        for start, size in zip(records.starts, records.sizes, strict=True):
            end = start + min(size, LIMITS.message_bytes)
            try:
                layout = codec.parse(records.content[start:end].tobytes())
            except MisfitError as error:
                misfit = error
                continue
            fitting += 1
            yield layout
        if misfit and not fitting:
            raise LogError(f"{file.path}: topic {topic!r}: {misfit}; it cannot be read") from misfit
        return
