"""ROS 1 bags and rosbag2 folders: which files belong to a bag, and the messages of those in SQLite or of ROS 1.

Messages come through the rosbags package (the extra ``algid[bags]``), one by one, so slower than MCAP by far:
sensor_msgs/JointState, or the fields that a profile names.
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
from algid.files import read_start
from algid.limits import LIMITS
from algid.log import Notice, Origin, Reading
from algid.readers.assemble import TableReader, reader_of
from algid.readers.joints import moving_joints, reading_of
from algid.readers.sniff import sniff
from algid.readers.table import BLOCK_ROWS, CHANNELS, JOINT_CHANNELS, VELOCITIES, SampleTable
from algid.readers.timebase import aligned, whole_topic
from algid.words import counted

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from algid.profile import Profile

_TYPE = "sensor_msgs/msg/JointState"
_LOOKED = 1 << 12
"""Messages whose other joints are looked at."""
_FIELDS = {"theta": "position", "tau": "effort", "omega": "velocity"}


@dataclass(frozen=True)
class Bag:
    """The files of a bag in their order, their kind ("mcap" or "db3"), and what is missing."""

    paths: tuple[Path, ...]
    kind: str
    notices: tuple[Notice, ...]


def bag_files(folder: Path) -> Bag:
    """The files of a rosbag2 folder.

    Raises
    ------
    LogError
        If there is none, a path leads out of the folder, or the bag is compressed by rosbag2 itself.
    """
    metadata = folder / "metadata.yaml"
    if metadata.is_file():
        names = _listed(metadata)
    else:  # the files themselves, by the numbers that end their names
        found = [*folder.glob("*.mcap"), *folder.glob("*.db3")]
        numbers = [(re.search(r"_(\d+)$", path.stem), path.name) for path in found]
        names = [name for _, name in sorted((int(number[1]) if number else 0, name) for number, name in numbers)]
    paths = [folder / name for name in names]
    there = [path for path in paths if path.is_file()]
    if not there:
        raise LogError(f"{folder}: none of the bag's files is there; expected {names[:3]}")
    kinds = {path.suffix for path in there}
    if len(kinds) > 1:
        raise LogError(f"{folder}: the bag mixes files of {', '.join(sorted(kinds))}; read one file of it")
    missing = [path.name for path in paths if path not in there]
    text = f"{len(missing)} of {counted(len(paths), 'file')} of the bag missing: {', '.join(missing[:3])}"
    notices = (Notice("MISSING_SPLIT", text, lossy=True),) if missing else ()
    return Bag(tuple(there), kinds.pop().lstrip("."), notices)


def _listed(metadata: Path) -> list[str]:
    """The names of files that a bag's metadata.yaml lists."""
    text = read_start(metadata, LIMITS.bag_metadata_bytes).decode("utf-8", errors="replace")
    mode = re.search(r"^\s*compression_mode:[ \t]*[\"']?(\w+)", text, re.MULTILINE)
    if mode and mode[1].upper() != "NONE":
        raise LogError(
            f"{metadata.parent}: the bag was compressed by rosbag2 (compression_mode {mode[1]}), unreadable; "
            "write it anew with ros2 bag convert and storage compression (mcap, zstd chunks)"
        )
    # the one list that matters, without a YAML package: a block, one name a line, or [one, two]
    block = re.search(r"^\s*relative_file_paths:\s*\n((?:\s*-\s*\S.*\n?)+)", text, re.MULTILINE)
    flow = re.search(r"^\s*relative_file_paths:\s*\[([^\]]*)\]", text, re.MULTILINE)
    if block is None and flow is None:
        raise LogError(f"{metadata}: no relative_file_paths; expected the metadata of a rosbag2 folder")
    lines = block[1].splitlines() if block else [one for one in flow[1].split(",") if one.strip()] if flow else []
    names = [line.strip().removeprefix("-").strip().strip("\"'") for line in lines]
    for name in names:
        if Path(name).name != name or name in ("", ".", ".."):
            raise LogError(f"{metadata}: {name[:80]!r} leads outside the bag's folder; expected a file in it")
    return names


def open_bag(path: Path, profile: Profile) -> TableReader:
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
    said = bag_files(path).notices if path.is_dir() else ()
    named = {name: profile.place(name) for name in CHANNELS if profile.channel(name).source}
    topic, sources, reading = profile.topic, dict[str, tuple[str, str]](), Reading(joints_told="profile")
    if not named.keys() >= set(JOINT_CHANNELS):
        topic, sources, reading, order = _usual(path, profile)
        said += order
    for name, (own, field) in named.items():
        home = own or topic
        if home is None:
            flag = f'--set {name}.topic=NAME (profile: topic = "NAME" of [{name}])'
            raise LogError(f"{path}: {name} is to be taken from {field!r} without a topic: {flag}")
        sources[name] = (home, str(field))
    if not (profile.velocity and sources.keys() >= set(VELOCITIES)):
        sources = {name: source for name, source in sources.items() if name not in VELOCITIES}
    clock = profile.clock or "header"
    homes = list(dict.fromkeys(home for home, _ in sources.values()))
    main, *others = (
        _Part(path, home, {name: field for name, (own, field) in sources.items() if own == home}, clock)
        for home in homes
    )
    mapping = {name: f"{home}: {field}" for name, (home, field) in sources.items()}
    mapping["t"] = f"{homes[0]}: header.stamp" if clock == "header" else "log time"
    origin = Origin(str(path), "bag", mapping, None, replace(reading, topics=tuple(homes), clock=clock))

    def tables(rows: int) -> Iterator[SampleTable]:
        if not others:
            return main.tables(rows)
        series = [whole_topic(str(path), one.topic, one.fields, one.tables(BLOCK_ROWS)) for one in others]
        return aligned(main.tables(rows), series)

    return reader_of(origin, tables, profile, {}, said)


def _usual(path: Path, profile: Profile) -> tuple[str, dict[str, tuple[str, str]], Reading, tuple[Notice, ...]]:
    """The topic of the first message of joint states that fits, its channels' sources, its joints, what to say."""
    joints = profile.joints
    seen: set[str] = set()
    for topic, _, message in _messages(path, profile.topic, _TYPE):
        names = list(message.name)
        fits = set(joints) <= set(names) if joints else len(names) == 2
        if fits and len(set(names)) == len(names) and len(message.position) == len(message.effort) == len(names):
            reading, said = reading_of(names, profile)
            chosen = reading.joints or ()
            quantities = ["theta", "tau", *(["omega"] if len(message.velocity) == len(names) else [])]
            sources = {
                f"{quantity}{number}": (topic, f"{_FIELDS[quantity]}[{joint}]")
                for quantity in quantities
                for number, joint in enumerate(chosen, start=1)
            }
            others = {name: f"position[{name}]" for name in names if name not in chosen}
            beside = moving_joints(others, lambda paths: _Part(path, topic, paths, "log").tables(_LOOKED))  # noqa: B023
            return topic, sources, reading, (*said, *beside)
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

    def _table(self, stamps: list[int], values: list[list[float]]) -> SampleTable:
        columns = np.array(values, np.float64).reshape(-1, len(self.fields)).T.copy()
        return SampleTable(np.array(stamps, np.int64), dict(zip(self.fields, columns, strict=True)))


def _value(message: Any, path: str) -> float | None:
    """The number at a path such as ``wrench.torque.z``, ``position[2]`` or ``effort[elbow]``."""
    found = message
    for part in re.findall(r"\[[^\]]*\]|[^.\[\]]+", path):
        if part.startswith("["):
            names, place = list(getattr(message, "name", ())), part[1:-1]
            index = names.index(place) if place in names else int(place) if place.isdecimal() else None
            found = found[index] if index is not None and index < len(found) else None
        else:
            found = getattr(found, part, None)
        if found is None:
            return None
    return float(found) if isinstance(found, (int, float, np.number)) else None


def _messages(path: Path, topic: str | None, kind: str | None = None) -> Iterator[tuple[str, int, Any]]:
    """Topic, recorder's time in ns and content of each message on `topic` and of the type `kind`, where given."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    try:
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            loose = bag_files(path).paths
        else:
            loose = (path,) if sniff(path) == "db3" else ()
        for file in loose:
            yield from _loose(file, topic, kind, store)
        if loose:
            return
        with AnyReader([path], default_typestore=store) as reader:
            wanted = [one for one in reader.connections if kind in (None, one.msgtype) and topic in (None, one.topic)]
            for connection, log_ns, raw in reader.messages(connections=wanted) if wanted else ():
                yield connection.topic, log_ns, reader.deserialize(raw, connection.msgtype)
    except (LogError, GeneratorExit):
        raise
    except Exception as error:  # whatever a damaged bag makes of a third package
        reason = str(error).split("\n", maxsplit=1)[0][:200]
        raise LogError(f"{path}: the bag cannot be read ({type(error).__name__}: {reason})") from error


def _loose(path: Path, topic: str | None, kind: str | None, store: Typestore) -> Iterator[tuple[str, int, Any]]:
    """Messages of a rosbag2 file without its folder's metadata: types that every ROS 2 knows."""
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
