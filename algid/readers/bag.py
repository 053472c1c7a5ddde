"""ROS 1 bags and rosbag2 logs in SQLite, through the rosbags package (the extra ``algid[bags]``).

Message by message, so slower than MCAP by far; sensor_msgs/JointState, or the fields that a profile names.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.errors import LogError
from algid.log import Notice, Origin, Reading
from algid.readers.align import Series, aligned
from algid.readers.assemble import TableReader, reader_of
from algid.readers.joints import along_the_arm, order_notice
from algid.readers.order import Sorter
from algid.readers.others import moving_joints
from algid.readers.rosbag2 import bag_files
from algid.readers.sniff import SQLITE
from algid.readers.table import BLOCK_ROWS, CHANNELS, JOINT_CHANNELS, VELOCITIES, SampleTable, stack
from algid.words import counted

if TYPE_CHECKING:
    from algid.profile import Profile

_TYPE = "sensor_msgs/msg/JointState"
_LOOKED = 1 << 12
"""Messages whose other joints are looked at."""
_FIELDS = {"theta": "position", "tau": "effort", "omega": "velocity"}


def open_bag(path: Path, profile: Profile | None = None, notices: tuple[Notice, ...] = ()) -> TableReader:
    """Open a ROS 1 bag, a rosbag2 folder with SQLite files, or one of these by itself.

    Raises
    ------
    LogError
        If rosbags is not installed, the bag is damaged, or no topic holds the joint states of two joints.
    """
    try:
        import rosbags.highlevel  # noqa: F401
    except ImportError as error:
        raise LogError(
            f"{path}: bags need the rosbags package: pip install 'algid[bags]', or convert it to MCAP"
        ) from error
    named = {name: profile.place(name) for name in CHANNELS if profile and profile.channel(name).source}
    sources: dict[str, tuple[str, str]] = {}
    reading, said = Reading(joints_told="profile"), notices
    topic = profile.topic if profile else None
    if not set(JOINT_CHANNELS) <= named.keys():
        usual = _usual(path, profile)
        topic, sources, reading = usual.topic, usual.sources, usual.reading
        said += usual.notices
    for name, (own, field) in named.items():
        home = own or topic
        if home is None:
            told = f'--set {name}.topic=NAME (profile: topic = "NAME" of [{name}])'
            raise LogError(f"{path}: {name} is to be taken from {field!r} without a topic: {told}")
        sources[name] = (home, str(field))
    if (profile and not profile.velocity) or not all(name in sources for name in VELOCITIES):
        sources = {name: source for name, source in sources.items() if name not in VELOCITIES}
    clock = (profile.clock if profile else None) or "header"
    homes = list(dict.fromkeys(home for home, _ in sources.values()))
    parts = [_Part(path, home, {name: field for name, (own, field) in sources.items() if own == home}, clock)
             for home in homes]  # fmt: skip
    mapping = {name: f"{home}: {field}" for name, (home, field) in sources.items()}
    mapping["t"] = f"{homes[0]}: header.stamp" if clock == "header" else "log time"
    origin = Origin(str(path), "bag", mapping, None, replace(reading, topics=tuple(homes), clock=clock))

    def tables(rows: int) -> Iterator[SampleTable]:
        main, *others = parts
        return aligned(main.tables(rows), [other.series() for other in others]) if others else main.tables(rows)

    return reader_of(origin, tables, profile, {}, said)


@dataclass(frozen=True)
class _Usual:
    """A topic of joint states: the sources of its channels, and how its joints were chosen."""

    topic: str
    sources: dict[str, tuple[str, str]]
    reading: Reading
    notices: tuple[Notice, ...]


def _usual(path: Path, profile: Profile | None) -> _Usual:
    """Topic and joints of the first message that fits."""
    joints = profile.joints if profile else None
    seen: set[str] = set()
    for topic, _, message in _messages(path, profile.topic if profile else None, _TYPE):
        names = list(message.name)
        fits = set(joints) <= set(names) if joints else len(names) == 2
        if fits and len(set(names)) == len(names) and len(message.position) == len(message.effort) == len(names):
            said: tuple[Notice, ...] = ()
            if joints and profile:
                reading = Reading(joints=joints, joints_told=profile.told_by("joints"))
            else:
                chosen, told = along_the_arm(names)
                reading, said = Reading(joints=chosen, joints_told=told), order_notice(names, chosen, told)
            quantities = ["theta", "tau", *(["omega"] if len(message.velocity) == len(names) else [])]
            sources = {
                f"{quantity}{number}": (topic, f"{_FIELDS[quantity]}[{joint}]")
                for quantity in quantities
                for number, joint in enumerate(reading.joints or (), start=1)
            }
            others = {name: f"position[{name}]" for name in names if name not in (reading.joints or ())}
            beside = moving_joints(others, lambda paths: _Part(path, topic, paths, "log").tables(_LOOKED))  # noqa: B023
            return _Usual(topic, sources, reading, said + beside)
        twice = ", two of one name" if len(set(names)) < len(names) else ""
        lacking = "" if len(message.effort) else ", whose effort is empty"
        seen.add(f"{topic!r} with the joints {', '.join(names[:8])}{twice}{lacking}")
        if len(seen) > 20:
            break
    found = "; ".join(sorted(seen)) or "no JointState"
    wanted = f"the joints {', '.join(joints)}" if joints else "two joints"
    raise LogError(
        f"{path}: no topic holds positions and efforts of {wanted}; found {found}; choose: --topic NAME --joints A,B "
        '(profile: topic = "NAME", joints = ["A", "B"])'
    )


@dataclass(frozen=True)
class _Part:
    """One topic and the paths of the fields to take from its messages."""

    path: Path
    topic: str
    fields: Mapping[str, str]
    clock: str

    def tables(self, rows: int) -> Iterator[SampleTable]:
        """Tables of `rows` rows; messages without the fields are left out and counted."""
        stamps: list[int] = []
        values: list[list[float]] = []
        skipped = 0
        for _, log_ns, message in _messages(self.path, self.topic):
            picked = [_value(message, field) for field in self.fields.values()]
            if any(value is None for value in picked):
                skipped += 1
                continue
            header = getattr(message, "header", None) if self.clock == "header" else None
            stamps.append(log_ns if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec)
            values.append([float(value) for value in picked if value is not None])
            if len(stamps) >= rows:
                yield self._table(stamps, values)
                stamps, values = [], []
        last = self._table(stamps, values)
        text = f"{counted(skipped, 'message')} on {self.topic!r} left out for want of both joints"
        yield last.noting(Notice("OTHER_MESSAGES", text)) if skipped else last

    def series(self) -> Series:
        """The topic as a whole, in time order."""
        parts = [table for table in Sorter(str(self.path)).run(self.tables(BLOCK_ROWS)) if len(table)]
        if not parts:
            mend = "--set NAME.topic=…, --set NAME.source=… (profile: topic and source of [NAME])"
            raise LogError(f"{self.path}: topic {self.topic!r} holds no {', '.join(self.fields.values())}; {mend}")
        return Series(self.topic, stack(parts))

    def _table(self, stamps: list[int], values: list[list[float]]) -> SampleTable:
        columns = np.array(values, np.float64).reshape(-1, len(self.fields)).T.copy()
        return SampleTable(np.array(stamps, np.int64), dict(zip(self.fields, columns, strict=True)))


def _value(message: Any, path: str) -> float | None:
    """The number at a path such as ``wrench.torque.z``, ``position[2]`` or ``effort[elbow]``."""
    found = message
    for part in re.findall(r"\[[^\]]*\]|[^.\[\]]+", path):
        if part.startswith("["):
            names, place = list(getattr(message, "name", ())), part[1:-1]
            index = names.index(place) if place in names else int(place) if place.isdigit() else None
            found = found[index] if index is not None and index < len(found) else None
        else:
            found = getattr(found, part, None)
        if found is None:
            return None
    return float(found) if isinstance(found, (int, float, np.number)) else None


def _messages(path: Path, topic: str | None, kind: str | None = None) -> Iterator[tuple[str, int, Any]]:
    """Topic, recorder's time in ns and content of each message on `topic` and of the type `kind`, where given."""
    try:
        for file in _loose_files(path):
            yield from _loose(file, topic, kind)
        if not _loose_files(path):
            yield from _bagged(path, topic, kind)
    except (LogError, GeneratorExit):
        raise
    except Exception as error:  # whatever a damaged bag makes of a third package
        told = str(error).split("\n", maxsplit=1)[0][:200]
        raise LogError(f"{path}: the bag cannot be read ({type(error).__name__}: {told})") from error


def _loose_files(path: Path) -> list[Path]:
    """SQLite files without a folder's metadata: the file itself, or those of a folder in their order."""
    if path.is_dir():
        return [] if (path / "metadata.yaml").is_file() else list(bag_files(path).paths)
    with path.open("rb") as stream:
        return [path] if stream.read(len(SQLITE)) == SQLITE else []


def _bagged(path: Path, topic: str | None, kind: str | None) -> Iterator[tuple[str, int, Any]]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        wanted = [one for one in reader.connections if kind in (None, one.msgtype) and topic in (None, one.topic)]
        for connection, log_ns, raw in reader.messages(connections=wanted) if wanted else ():
            yield connection.topic, log_ns, reader.deserialize(raw, connection.msgtype)


def _loose(path: Path, topic: str | None, kind: str | None) -> Iterator[tuple[str, int, Any]]:
    """Messages of a rosbag2 file without its folder's metadata: types that every ROS 2 knows."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as base:
        topics = {
            number: (name, type_name)
            for number, name, type_name in base.execute("SELECT id, name, type FROM topics")
            if kind in (None, type_name) and topic in (None, name)
        }
        asked = ",".join("?" * len(topics))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({asked}) ORDER BY timestamp, id"
        for number, log_ns, data in base.execute(query, tuple(topics)):
            name, type_name = topics[number]
            yield name, log_ns, store.deserialize_cdr(data, type_name)
