"""ROS 1 bags and rosbag2 folders in SQLite, through the rosbags package (the extra ``algid[bags]``).

Message by message, so slower than MCAP by far; only sensor_msgs/JointState.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from algid.errors import LogError
from algid.log import Notice, Origin, Reading, Teller
from algid.readers.assemble import TableReader, reader_of
from algid.readers.joints import along_the_arm, order_notice
from algid.readers.table import JOINT_CHANNELS, VELOCITIES, Table

if TYPE_CHECKING:
    from algid.profile import Profile

_TYPE = "sensor_msgs/msg/JointState"
_FIELDS = {"theta": "position", "tau": "effort", "omega": "velocity"}


def open_bag(path: Path, profile: Profile | None = None, notices: tuple[Notice, ...] = ()) -> TableReader:
    """Open a ROS 1 bag or a rosbag2 folder with SQLite files.

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
    bag = _Bag(path, profile.topic if profile else None, profile.joints if profile else None)
    bag.look()
    velocity = bag.velocity and (profile is None or profile.velocity)
    names = JOINT_CHANNELS + (VELOCITIES if velocity else ())
    mapping = {name: f"{bag.topic}: {_FIELDS[name[:-1]]}[{bag.joint(name)}]" for name in names}
    told: Teller = profile.told_by("joints") if profile and profile.joints else bag.told
    reading = Reading(joints=bag.joints, joints_told=told, topics=(str(bag.topic),), clock="header")
    origin = Origin(str(path), "bag", {**mapping, "t": f"{bag.topic}: header.stamp"}, None, reading)
    return reader_of(origin, lambda rows: bag.tables(names, rows), profile, {}, (*notices, *bag.notices))


@dataclass
class _Bag:
    """A bag, the topic and the joints to read."""

    path: Path
    topic: str | None
    joints: tuple[str, str] | None
    velocity: bool = field(default=False)
    told: Literal["names", "order"] = field(default="names")
    notices: tuple[Notice, ...] = field(default=())

    def joint(self, channel: str) -> str:
        return (self.joints or ("", ""))[int(channel[-1]) - 1]

    def look(self) -> None:
        """Choose topic and joints by the first message that fits."""
        seen: set[str] = set()
        for topic, message in self._messages():
            names = list(message.name)
            fits = set(self.joints) <= set(names) if self.joints else len(names) == 2
            if fits and len(message.position) == len(message.effort) == len(names):
                self.topic = topic
                if self.joints is None:
                    self.joints, self.told = along_the_arm(names)
                    self.notices = order_notice(names, self.joints, self.told)
                self.velocity = len(message.velocity) == len(names)
                return
            seen.add(f"{topic!r} with {len(names)} joints")
            if len(seen) > 20:
                break
        found = ", ".join(sorted(seen)) or "no JointState"
        raise LogError(f"{self.path}: no topic holds two joints' states; found {found}; choose joints in a profile")

    def tables(self, names: tuple[str, ...], rows: int) -> Iterator[Table]:
        """Tables of `rows` rows; messages without the joints are left out and counted."""
        stamps: list[int] = []
        values: list[list[float]] = []
        skipped = 0
        for _, message in self._messages():
            picked = self._picked(message, names)
            if picked is None:
                skipped += 1
                continue
            stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
            values.append(picked)
            if len(stamps) >= rows:
                yield _table(stamps, values, names)
                stamps, values = [], []
        last = _table(stamps, values, names)
        text = f"{skipped} messages on {self.topic!r} do not hold both joints and were left out"
        yield last.noting(Notice("OTHER_MESSAGES", text)) if skipped else last

    def _picked(self, message: Any, names: tuple[str, ...]) -> list[float] | None:
        joints = list(message.name)
        picked = []
        for name in names:
            numbers, joint = getattr(message, _FIELDS[name[:-1]]), self.joint(name)
            place = joints.index(joint) if joint in joints else len(numbers)
            if place >= len(numbers):
                return None
            picked.append(float(numbers[place]))
        return picked

    def _messages(self) -> Iterator[tuple[str, Any]]:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        try:
            with AnyReader([self.path], default_typestore=get_typestore(Stores.LATEST)) as reader:
                wanted = [
                    connection
                    for connection in reader.connections
                    if connection.msgtype == _TYPE and self.topic in (None, connection.topic)
                ]
                for connection, _, raw in reader.messages(connections=wanted) if wanted else ():
                    yield connection.topic, reader.deserialize(raw, connection.msgtype)
        except LogError:
            raise
        except Exception as error:  # whatever a damaged bag makes of a third package
            told = str(error).split("\n", maxsplit=1)[0][:200]
            raise LogError(f"{self.path}: the bag cannot be read ({type(error).__name__}: {told})") from error


def _table(stamps: list[int], values: list[list[float]], names: tuple[str, ...]) -> Table:
    columns = np.array(values, np.float64).reshape(-1, len(names)).T.copy()
    return Table(np.array(stamps, np.int64), dict(zip(names, columns, strict=True)))
