"""A log that stands in two files: angles in one and torques in another, joined on their stamps.

Torques are interpolated to the stamps of the angles, where both were recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.base.errors import LogError
from algid.base.faults import during
from algid.notices import Notice, Remedy
from algid.readers.clock import aligned, in_order, whole_topic
from algid.readers.formats import entries_at
from algid.readers.log_reader import TableReader
from algid.readers.table import SampleTable

if TYPE_CHECKING:
    from algid.profile import Profile


def torque_file_of(log: Any, name: str) -> Path | None:
    """The file of a log's torques: beside it, else in the working folder; None where none is."""
    beside = [Path(log).parent / name] if isinstance(log, str | Path) else []
    return next((place for place in (*beside, Path(name)) if place.exists()), None)


def open_with_torque_file(
    log: Any, profile: Profile, open_one: Callable[[Any, Profile], TableReader]
) -> TableReader:
    """Open a log whose torques stand in the profile's `torque_file`.

    Parameters
    ----------
    log : str, Path or columns
        What holds the angles.
    profile : Profile
        Its names are looked for in the file that they belong to.
    open_one : callable
        Opens one file, or columns in memory, as a profile says.

    Raises
    ------
    LogError
        If one of the two cannot be read, lacks its channels, or they do not overlap in time.
    """
    name = profile.torque_file or ""
    other = torque_file_of(log, name)
    if other is None:
        raise LogError(
            f"{name}: there is no such file of torques, neither beside the log nor in the working "
            f"folder; {Remedy({'torque_file': None}, 'name it')}"
        )
    angles = open_one(log, profile.half("theta", "omega", "q_des"))
    wanted = angles.origin.reading.joints
    with during("opening", other):
        stated = profile.time or profile.topic  # else nobody asks what the file has
        names = {entry.name for entry in entries_at(other)} if stated else set[str]()
        of_angles = {"columns": None}
        for key in ("time", "topic"):
            if getattr(profile, key) not in names:
                of_angles[key] = None
        half = profile.half("tau").model_copy(update=of_angles)
        torques = open_one(other, half)
        there = torques.origin.reading.joints
        if wanted and there and wanted != there and set(wanted) == set(there):
            torques = open_one(other, half.model_copy(update={"joints": wanted}))

    def tables(told: list[Notice]) -> Iterator[SampleTable]:
        mapping = torques.origin.mapping
        with during("reading", other):
            series = whole_topic(other.name, mapping, torques.tables(told), told)
        first, last = series.table.stamp_ns[[0, -1]]

        def within() -> Iterator[SampleTable]:
            outside = 0
            for table in in_order(angles.tables(told), told):
                kept = table.only((table.stamp_ns >= first) & (table.stamp_ns <= last))
                outside += len(table) - len(kept)
                yield kept
            if outside:
                numbers = {"case": "file", "file": other.name, "count": outside}
                told.append(Notice("ALIGNED", numbers=numbers))

        return aligned(within(), [series], told)

    # where each channel of both comes from, and how it was read
    theirs = torques.origin.mapping.items()
    sources = {name: f"{other.name}: {one}" for name, one in theirs if name != "t"}
    channels = dict(angles.origin.reading.channels)
    for name, channel in torques.origin.reading.channels.items():
        own = sources[name] if channel.factor else channel.source
        channels[name] = replace(channel, source=own)
    reading = replace(
        angles.origin.reading,
        channels=channels,
        topics=angles.origin.reading.topics + torques.origin.reading.topics,
        torque_file=str(other),
    )
    origin = replace(angles.origin, mapping=angles.origin.mapping | sources, reading=reading)
    notices = angles.notices + torques.notices
    return TableReader(origin, tables, notices, angles.rows, laws=angles.laws)
