"""The joints' topic and the fields of its messages, by a profile or found in the messages.

One topic's numbers as tables: the channels that carry it, its fields, its clock.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.log import IntArray
from algid.notices import Notice, Remedy
from algid.readers.messages.batch import Losses
from algid.readers.messages.codec import decoder_for
from algid.readers.messages.columnar import Decoder, Shape
from algid.readers.messages.message_file import MessageFile, channels_of
from algid.readers.names import COMMANDED, CURRENTS, STEMS
from algid.readers.stated import several
from algid.readers.table import REFERENCES, VELOCITIES, SampleTable, stack

JOINT_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
DYNAMIC_JOINT_STATE = ("control_msgs/msg/DynamicJointState", "control_msgs/DynamicJointState")
TRAJECTORY_STATE = (
    "control_msgs/msg/JointTrajectoryControllerState",
    "control_msgs/JointTrajectoryControllerState",
)
JOINT_REFERENCES = "/joint_references"
"""The topic of joint states that algid writes what the joints are to follow to."""
_REFERENCES = ("reference.positions", "desired.positions", "position")
"""In the state of a trajectory controller (ROS 2 since Iron, and before), and in joint states."""
_QUANTITIES = {"theta": "position", "tau": "effort", "omega": "velocity"}
_NO_TORQUES = COMMANDED | CURRENTS
_STAMPS = ("header.stamp", "stamp", "timestamp", "time", "header.timestamp")
_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"), ("secs", "nsecs"))


@dataclass(frozen=True)
class Fields:
    """By canonical channel the path of its number.

    And the paths of a stamp's seconds and nanoseconds.
    """

    paths: Mapping[str, str]
    stamp: tuple[str, str] | None


def stamp_paths(shape: Shape) -> tuple[str, str] | None:
    """Where messages of this shape carry their own stamp."""
    for base in _STAMPS:
        for seconds, nanoseconds in _PARTS:
            pair = (f"{base}.{seconds}", f"{base}.{nanoseconds}")
            if shape.has(pair):
                return pair
    return None


def joint_names(shape: Shape, channels: Collection[str]) -> list[str]:
    """Joints for which a message of this shape has all `channels`, such as position and effort."""
    names = names_in(shape) or tuple(map(str, range(LIMITS.joint_cells)))
    quantities = {name[:-1] for name in channels}
    joints = []
    for name in names:
        if all(_path(shape, name, quantity) for quantity in quantities):
            joints.append(name)
    return joints


def other_positions(shape: Shape, joints: tuple[str, str]) -> dict[str, str]:
    """By joint the path of its position, of those that a message names beside `joints`."""
    names = [name for name in names_in(shape) if name not in joints]
    paths = {}
    for name in names[: LIMITS.other_joints]:
        path = _path(shape, name, "theta")
        if path is not None:
            paths[name] = path
    return paths


def repeated_name(shape: Shape) -> str | None:
    """A joint that a message of this shape names twice, if any."""
    names = names_in(shape)
    for name in names:
        if names.count(name) > 1:
            return name
    return None


def names_in(shape: Shape) -> tuple[str, ...]:
    """The joints that a message of this shape names."""
    for path, texts in shape.texts.items():
        if path in ("name", "names", "joint_names"):
            return texts[: LIMITS.joints]
    return ()


def joint_fields(shape: Shape, joints: tuple[str, str]) -> dict[str, str]:
    """By canonical channel the path of its number for two joints.

    Without velocities where one lacks them.
    """
    paths = {}
    for quantity in _QUANTITIES:
        for number, joint in enumerate(joints, start=1):
            path = _path(shape, joint, quantity)
            if path is not None:
                paths[f"{quantity}{number}"] = path
    if not paths.keys() >= set(VELOCITIES):
        for name in VELOCITIES:
            paths.pop(name, None)
    return paths


def reference_fields(shape: Shape, joints: tuple[str, str]) -> dict[str, str]:
    """By reference channel the path of its number; none where a message of this shape lacks one.

    In a trajectory controller's state, or in the positions of joints to follow.
    """
    names = names_in(shape)
    if not set(joints) <= set(names):
        return {}
    for positions in _REFERENCES:
        paths = [f"{positions}[{names.index(joint)}]" for joint in joints]
        if shape.has(paths):
            return dict(zip(REFERENCES, paths, strict=True))
    return {}


def _path(shape: Shape, joint: str, quantity: str) -> str | None:
    """Path of a joint's number in this shape: in a list beside its name, or in its interfaces."""
    field = _QUANTITIES[quantity]
    paths = [f"{field}[{joint}]", f"interface_values[{joint}].values[{field}]"]
    if not joint.isdigit():  # beside a list of names other lists may stand: {"joint_names", "q"}
        for stem in STEMS[quantity]:
            if (stem in shape.numbers or f"{stem}[0]" in shape.numbers) and stem not in _NO_TORQUES:
                paths.append(f"{stem}[{joint}]")
    return next((path for path in paths if shape.find(path) is not None), None)


_STAMP = ("sec", "nanosec")


@dataclass
class Topic:
    """A topic of one file.

    Parameters
    ----------
    name : str
    type : str
        The type of its messages; channels of another type on the same topic are not read.
    fields : Fields
    clock : "header", "log" or None
        None: the header's stamps, unless they stand still.
    """

    name: str
    type: str
    fields: Fields
    clock: str | None
    _chosen: str | None = field(default=None)

    def tables(self, file: MessageFile, rows: int) -> Iterator[SampleTable]:
        """The topic's samples in tables of about `rows` rows.

        Raises
        ------
        LogError
            If half of the messages do not fit their schema, or their stamps are none.
        """
        path = file.path
        channels = channels_of(file, self.name, self.type)
        if not channels:
            missing = Notice(
                "MESSAGES_LEFT_OUT", numbers={"case": "file", "file": path, "topic": self.name}
            )
            yield SampleTable(np.empty(0, np.int64), {}, (missing,))
            return
        wanted = dict(self.fields.paths)
        if self.fields.stamp is not None and self.clock != "log":
            wanted |= dict(zip(_STAMP, self.fields.stamp, strict=True))
        decoder = decoder_for(path, file.channels[min(channels)], wanted)
        losses = Losses()
        parts: list[SampleTable] = []
        size = 0
        for batch in file.batches(channels):
            losses.add(batch)
            if batch.messages is None or not len(batch.messages):
                continue
            held, columns = decoder.columns(batch.messages)
            if decoder.misfits > losses.found / 2:
                raise LogError(
                    f"{path}: topic {self.name!r}: {decoder.misfit}; it cannot be read without "
                    "guessing"
                )
            log_ns = batch.messages.log_ns
            stamps = log_ns if held.all() else log_ns[held]
            parts.append(SampleTable(stamps, columns))  # type: ignore[arg-type]
            size += len(parts[-1])
            if size >= rows:
                yield self._clocked(path, parts)
                parts, size = [], 0
        last = self._clocked(path, parts) if parts else SampleTable(np.empty(0, np.int64), {})
        notices = [*file.notices, *losses.notices(self.count(file))]
        notices += self._left_out(decoder, file, channels)
        yield last.noting(*notices)

    def count(self, file: MessageFile) -> int:
        """Messages of the topic that the file counts."""
        channels = channels_of(file, self.name, self.type)
        return sum(file.counts.get(channel, 0) for channel in channels)

    def _clocked(self, path: str, parts: list[SampleTable]) -> SampleTable:
        """The tables as one, with the stamps of the chosen clock and float64 columns."""
        table = stack(parts)
        columns = dict(table.columns)
        notices: tuple[Notice, ...] = ()
        stamps = table.stamp_ns
        if _STAMP[0] in columns:
            seconds, nanoseconds = map(columns.pop, _STAMP)
            header = self._nanoseconds(path, seconds, nanoseconds)
            if self._chosen is None and len(table):
                self._chosen = "header"
                if self.clock != "header" and len(table) > 1 and not np.any(header != header[0]):
                    self._chosen = "log"
                    numbers = {"topic": self.name, "stamp": int(header[0])}
                    notices = (Notice("UNEVEN_STAMPS", numbers={"case": "still"} | numbers),)
            if self._chosen == "header":
                stamps = header
        if stamps is table.stamp_ns and len(table) and stamps.min() < 0:
            header_clock = Remedy({"clock": "header"}, "take the header's stamps")
            raise LogError(
                f"{path}: topic {self.name!r}: a log time of 2^63 ns or more; expected ns since "
                f"1970; {header_clock}"
            )
        floats = {name: np.asarray(values, np.float64) for name, values in columns.items()}
        return SampleTable(stamps, floats, table.notices + notices)

    def _nanoseconds(self, path: str, seconds: NDArray[Any], nanoseconds: NDArray[Any]) -> IntArray:
        """Stamps (N,) of headers in ns."""
        for values, largest in (
            (seconds, LIMITS.stamp_seconds),
            (nanoseconds, LIMITS.largest_time_ns),
        ):
            wrong = np.flatnonzero(~(np.abs(values.astype(np.float64)) < largest))
            if wrong.size:
                log_clock = Remedy({"clock": "log"}, "take the recorder's times")
                raise LogError(
                    f"{path}: topic {self.name!r}: a header stamp with {values[wrong[0]]} for "
                    f"seconds or nanoseconds; expected whole numbers below 2^63 ns; {log_clock}"
                )
        whole = np.floor(seconds)
        if seconds.dtype.kind == "f":
            nanoseconds = nanoseconds + np.rint((seconds - whole) * 1e9)
        return whole.astype(np.int64) * 1_000_000_000 + nanoseconds.astype(np.int64)

    def _left_out(
        self, decoder: Decoder, file: MessageFile, channels: frozenset[int]
    ) -> list[Notice]:
        """Notices of messages that lack a field, do not fit, or are otherwise typed or encoded."""
        said = []
        if decoder.lacking:
            lacks = ", ".join(dict.fromkeys(decoder.wanted.get(n, n) for n in decoder.lacks))
            numbers = {"count": decoder.lacking, "topic": self.name, "fields": lacks}
            said.append(Notice("MESSAGES_LEFT_OUT", numbers={"case": "fields"} | numbers))
        if decoder.skipped:
            numbers = {"count": decoder.skipped, "topic": self.name}
            said.append(Notice("MESSAGES_LEFT_OUT", numbers={"case": "joints"} | numbers))
        if decoder.misfits:
            numbers = {"count": decoder.misfits, "topic": self.name, "first": str(decoder.misfit)}
            said.append(Notice("MESSAGES_LEFT_OUT", numbers={"case": "schema"} | numbers))
        said += [
            several(path, values) for path, values in decoder.labels.items() if len(values) > 1
        ]
        types = set()
        for number, channel in file.channels.items():
            if number not in channels and channel.topic == self.name and file.counts.get(number):
                types.add(channel.type or "no schema")
        if types:
            numbers = {"topic": self.name, "types": ", ".join(sorted(types)[:4])}
            said.append(Notice("MESSAGES_LEFT_OUT", numbers={"case": "type"} | numbers))
        return said
