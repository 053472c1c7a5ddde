"""A log that stands in two files: angles in one and torques in another, joined on their stamps.

Torques are interpolated to the stamps of the angles, where both were recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.base.errors import LogError
from algid.log import Origin
from algid.notices import Notice, Remedy
from algid.readers.clock import Series, aligned, in_order, whole_topic
from algid.readers.formats import entries_at
from algid.readers.log_reader import TableReader
from algid.readers.table import SampleTable

if TYPE_CHECKING:
    from algid.profile import Profile

Opener = Callable[[Any, "Profile"], TableReader]
"""Opens one file, or columns in memory, as a profile says."""


def open_with_torque_file(log: Any, profile: Profile, open_one: Opener) -> TableReader:
    """Open a log whose torques stand in the profile's `torque_file`.

    Parameters
    ----------
    log : str, Path or columns
        What holds the angles.
    profile : Profile
        Its names are looked for in the file that they belong to.
    open_one : callable

    Raises
    ------
    LogError
        If one of the two cannot be read, lacks its channels, or they do not overlap in time.
    """
    other = _beside(log, profile.torque_file or "")
    angles = open_one(log, profile.half("theta", "omega", "q_des"))
    torques = _torques(other, profile, angles.origin, open_one)
    path = angles.origin.path

    def tables(told: list[Notice]) -> Iterator[SampleTable]:
        torque_series = whole_topic(
            str(other), other.name, torques.origin.mapping, torques.tables(told), told
        )
        main = in_order(path, angles.tables(told), told)
        return aligned(_overlap(main, torque_series, told), [torque_series], told)

    origin = _joined(angles.origin, torques.origin, other)
    notices = angles.notices + torques.notices
    return TableReader(origin, tables, notices, angles.rows, laws=angles.laws)


def _beside(log: Any, name: str) -> Path:
    """The file of the torques: beside the log, or as its name says."""
    places = [Path(name)]
    if isinstance(log, str | Path):
        places.insert(0, Path(log).parent / name)
    for place in places:
        if place.exists():
            return place
    raise LogError(
        f"{name}: there is no such file of torques, neither beside the log nor in the working "
        f"folder; {Remedy({'torque_file': None}, 'name it')}"
    )


def _torques(other: Path, profile: Profile, angles: Origin, open_one: Opener) -> TableReader:
    """The file of the torques; its joints follow the order of the angles' if both have names."""
    stated = profile.time or profile.topic  # else nobody asks what the file has
    names = {entry.name for entry in entries_at(other)} if stated else set[str]()
    of_angles = {"columns": None}
    for key in ("time", "topic"):
        if getattr(profile, key) not in names:
            of_angles[key] = None
    half = profile.half("tau").model_copy(update=of_angles)
    reader = open_one(other, half)
    wanted, there = angles.reading.joints, reader.origin.reading.joints
    if wanted and there and wanted != there and set(wanted) == set(there):
        return open_one(other, half.model_copy(update={"joints": wanted}))
    return reader


def _joined(angles: Origin, torques: Origin, other: Path) -> Origin:
    """Where each channel of both files comes from, and how it was read."""
    sources = {name: f"{other.name}: {one}" for name, one in torques.mapping.items() if name != "t"}
    channels = dict(angles.reading.channels)
    for name, channel in torques.reading.channels.items():
        own = sources[name] if channel.factor else channel.source
        channels[name] = replace(channel, source=own)
    reading = replace(
        angles.reading,
        channels=channels,
        topics=angles.reading.topics + torques.reading.topics,
        torque_file=str(other),
    )
    return replace(angles, mapping=angles.mapping | sources, reading=reading)


def _overlap(
    main: Iterator[SampleTable], other: Series, told: list[Notice]
) -> Iterator[SampleTable]:
    """The rows of `main` within the other file's time; those outside are counted at the end."""
    first, last = other.table.stamp_ns[[0, -1]]
    outside = 0
    for table in main:
        within = (table.stamp_ns >= first) & (table.stamp_ns <= last)
        kept = table.only(within)
        outside += len(table) - len(kept)
        yield kept
    if outside:
        numbers = {"case": "file", "file": other.topic, "count": outside}
        told.append(Notice("ALIGNED", numbers=numbers))
