"""Choice of the topics and fields to read: by a profile, else by the first messages."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.units import unit_of
from algid.base.words import counted, repeated
from algid.notices import Remedy
from algid.profile import Profile
from algid.readers.column_names import COMMANDED, CURRENTS, STEMS, choose, units_in_names
from algid.readers.joints import along_the_arm
from algid.readers.messages.codec import codec_for
from algid.readers.messages.layout import MessageLayout, MisfitError
from algid.readers.messages.message_file import MessageFile
from algid.readers.messages.topic import Topic
from algid.readers.stated import in_json_schema, lines_of, units_in
from algid.readers.table import REFERENCES

_SAMPLES = 64
TOPIC = Remedy({"topic": None})
_USUAL = "/joint_states"
_TELLING = (b"effort", b"tau_est", b"tau_J")
"""Names of torques in definitions: of ROS, Unitree, libfranka."""
_JOINT_REFERENCES = "/joint_references"
"""The topic of joint states that algid writes what the joints are to follow to."""
_REFERENCES = ("reference.positions", "desired.positions", "position")
"""In the state of a trajectory controller (ROS 2 since Iron, and before), and in joint states."""
_QUANTITIES = {"theta": "position", "tau": "effort", "omega": "velocity"}
_STAMPS = ("header.stamp", "stamp", "timestamp", "time", "header.timestamp")
_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("secs", "nsecs"))


def _nothing(file: MessageFile, lacking: str) -> str:
    """That a file lacks what is looked for; damage to it may be why."""
    if file.damage:
        where = "; ".join(list(dict.fromkeys(file.damage))[:3])
        lacking = f"the file is damaged ({where}); copy it again; in what is left: {lacking}"
    return f"{file.path}: {lacking}"


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


def topic_of(
    file: MessageFile,
    name: str,
    paths: dict[str, str],
    layouts: Sequence[MessageLayout],
    profile: Profile,
) -> Topic:
    """A topic to read, of whose first messages one has each of the `paths`."""
    if not layouts:
        each = Remedy({"tau1.topic": None}, "for one channel")
        lacking = f"there is no message on topic {name!r}; found {file.listed()}; name another"
        raise LogError(_nothing(file, f"{lacking}: {TOPIC}; {each}"))
    for channel, path in paths.items():
        if not any(layout.find(path) for layout in layouts):
            known = next((list(one.numbers)[:12] for one in layouts if one.numbers), ["nothing"])
            raise LogError(
                f"{file.path}: messages on {name!r} have no {path!r} for {channel}; found "
                f"{', '.join(known)}; {Remedy({f'{channel}.source': None}, 'name another')}"
            )
    stamp = next(filter(None, map(stamp_in, layouts)), None)
    if profile.clock == "header" and stamp is None:
        log_clock = Remedy({"clock": "log"})
        raise LogError(f"{file.path}: messages on {name!r} carry no stamp: {log_clock}")
    return Topic(name, paths, stamp, profile.clock)


def stated_of(
    file: MessageFile, topic: str, paths: dict[str, str], layouts: Sequence[MessageLayout]
) -> tuple[dict[str, str], list[str]]:
    """By channel the unit that a topic's schema or metadata state; what else is stated, as text."""
    channel = file.channel(topic)
    text = channel.definition.decode("utf-8", errors="replace")
    metadata, lines = dict(channel.metadata), list(lines_of(channel.metadata))
    if channel.encoding == "json":
        own, descriptions = in_json_schema(text)
        metadata |= own
        lines += descriptions
        labels = layouts[0].labels.items()
        lines += [f"{path}: {label}" for path, label in labels if "unit" in path]
    elif channel.definition_encoding.startswith("ros"):
        lines += [line for line in text.splitlines() if "#" in line or "//" in line]
    fields = {name: path.partition("[")[0] for name, path in paths.items()}
    by_field = units_in(metadata, list(dict.fromkeys(fields.values())))
    units = {name: by_field.get(path) for name, path in fields.items()}
    return {name: unit_of(unit) or unit for name, unit in units.items() if unit}, lines


def references_of(file: MessageFile, joints: tuple[str, str]) -> dict[str, tuple[str | None, str]]:
    """By reference channel topic and path of what joints follow, if one topic alone tells it."""
    found: list[list[tuple[str | None, str]]] = []
    for topic in file.topics:
        kind = file.channel(topic).type
        if topic == _JOINT_REFERENCES or kind.endswith("/JointTrajectoryControllerState"):
            layout = MessageLayout()
            with suppress(LogError):  # the log is read without it
                layout = next(layouts_of(file, topic), layout)
            names = names_in(layout)
            for positions in _REFERENCES:
                paths = [f"{positions}[{names.index(one)}]" for one in joints if one in names]
                if len(paths) == len(joints) and layout.has(paths):
                    found.append([(topic, path) for path in paths])
                    break
    return dict(zip(REFERENCES, found[0], strict=True)) if len(found) == 1 else {}


def find_joint_topic(file: MessageFile, profile: Profile) -> JointTopic | None:
    """The one topic with joint states; None where there is none and a profile names the fields.

    Raises
    ------
    LogError
        If none holds two joints, several do, or one holds more and none was selected.
    """
    fitting: dict[str, JointTopic] = {}
    crowded, refused, lacking = list[str](), list[str](), list[str]()
    needed = [what for what in _QUANTITIES if f"{what}1" in profile.needed]
    words = [_QUANTITIES[what] for what in needed]
    for name in file.topics:
        channel = file.channel(name)
        known = channel.type.endswith(("/JointState", "/DynamicJointState"))
        known |= channel.encoding == "json" or any(map(channel.definition.__contains__, _TELLING))
        if name != profile.topic and (profile.topic or not known):
            continue
        most, named = list[str](), MessageLayout()
        try:
            for layout in layouts_of(file, name):
                joints = _joints_in(layout, needed)
                if found := _joint_topic_in(name, layout, joints, profile):
                    fitting[name] = found
                    break
                most = max(most, joints, key=len)
                named = layout if names_in(layout) else named
        except LogError as error:  # another topic may still hold the joints
            refused.append(str(error))
        names = names_in(named)
        if name in fitting:
            continue
        if twice := repeated(names):
            by_place = Remedy({"theta1.source": "position[0]"}, "name the fields by their places")
            text = f"messages on {name!r} name the joint {twice[0]!r} twice; {by_place} …"
            refused.append(f"{file.path}: {text}")
        if len(most) > 2 or (most and profile.joints):
            text = f"{name!r} has {counted(len(most), 'joint')} ({', '.join(most[:12])})"
            crowded.append(f"{file.path}: {text}; choose: {Remedy({'joints': None})}")
        elif names:
            empty = [word for word in words if not named.find(f"{word}[{len(names) - 1}]")]
            stay = f", whose {' and '.join(empty)} stay empty" if empty else ""
            lacking.append(f"{name!r} with the joints {', '.join(names[:8])}{stay}")
    if _USUAL in fitting or len(fitting) == 1:
        found = fitting.pop(_USUAL, None) or fitting.popitem()[1]
        return replace(found, beside=tuple(fitting))
    if fitting:
        raise LogError(f"{file.path}: joint states on {', '.join(fitting)}; choose: {TOPIC}")
    for refusal in crowded + refused:
        raise LogError(refusal)
    if all(profile.channel(name).source for name in profile.needed):
        return None
    wanted = f"{' and '.join(f'{word}s' for word in words)} of two joints"
    if profile.joints:
        wanted = f"the joints {profile.joints}"
    both = Remedy({"topic": None, "joints": None})
    each = Remedy({"tau1.topic": None, "tau1.source": None}, "or channel by channel")
    held = "; ".join(lacking[:4]) or file.listed()
    text = f"no topic holds {wanted}; found {held}; name topics and fields: {both}; {each}"
    raise LogError(_nothing(file, text))


def _joint_topic_in(
    topic: str, layout: MessageLayout, joints: list[str], profile: Profile
) -> JointTopic | None:
    """The two joints to read and their fields.

    None if one is missing, or if there are more than two and none was selected.
    """
    names, chosen = names_in(layout), profile.joints
    if chosen is None and len(joints) == 2:
        chosen, _ = along_the_arm(joints)
    if chosen and set(chosen) <= set(joints):
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
    columns = choice.columns.items()
    paths = {name: path for name, path in columns if name != "t" and layout.find(path)}
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
    return next(filter(layout.find, paths), None)


def stamp_in(layout: MessageLayout) -> tuple[str, str] | None:
    """Where messages of this layout carry their own stamp: its seconds and nanoseconds."""
    for base in _STAMPS:
        for seconds, nanoseconds in _PARTS:
            pair = (f"{base}.{seconds}", f"{base}.{nanoseconds}")
            if layout.has(pair):
                return pair
    return None


def fields_shown(file: MessageFile, number: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Joints in a channel's first message, and its numbers' paths as a profile writes them."""
    layout = MessageLayout()
    with suppress(LogError):
        layout = next(layouts_of(file, file.channels[number].topic), layout)
    joints = names_in(layout)
    return joints, tuple(_paths(layout, joints))


def _paths(layout: MessageLayout, joints: Sequence[str]) -> Iterator[str]:
    """The paths of a message's numbers: of a field one, none, or one a place."""
    for name, numbers in layout.numbers.items():
        if numbers.count == 1:
            yield name
            continue
        if not numbers.count:
            yield f"{name} (empty)"
        places = range(min(numbers.count, LIMITS.joint_cells))
        for place in joints if numbers.count == len(joints) else places:
            yield f"{name}[{place}]"


def layouts_of(file: MessageFile, topic: str) -> Iterator[MessageLayout]:
    """Layouts of the topic's first messages that fit their schema.

    Raises
    ------
    LogError
        If none of them does.
    """
    if topic not in file.topics:
        return
    codec = codec_for(file.path, file.channel(topic))
    for messages in file.batches(file.topics[topic]):
        if isinstance(messages, str):
            file.damage.append(messages)
            continue
        records = codec.records(messages.take(slice(_SAMPLES)))
        misfits = []
        for start, size in zip(records.starts, records.sizes, strict=True):
            end = start + min(size, LIMITS.message_bytes)
            try:
                layout = codec.parse(records.content[start:end].tobytes())
            except MisfitError as error:
                misfits.append(error)
                continue
            yield layout
        if misfits and len(misfits) == len(records):
            why = f"{misfits[-1]}; it cannot be read"
            raise LogError(f"{file.path}: topic {topic!r}: {why}") from misfits[-1]
        if len(records):
            return
