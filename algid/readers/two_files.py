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
    with during("opening", other):
        # what is named may be the angles' alone; where nothing is, nobody asks what the file has
        names = {one.name for one in entries_at(other)} if profile.time or profile.topic else ()
        own = {key: None for key in ("time", "topic") if getattr(profile, key) not in names}
        torques = open_one(other, profile.half("tau").model_copy(update={"columns": None, **own}))
        wanted, there = (one.origin.reading.joints or () for one in (angles, torques))
        if wanted != there and set(wanted) == set(there):
            named = Remedy({"joints": list(wanted)}, "name both")
            raise LogError(f"its joints stand in another order than those of the log; {named}")

    def tables(told: list[Notice]) -> Iterator[SampleTable]:
        with during("reading", other):
            series = whole_topic(other.name, torques.origin.mapping, torques.tables(told), told)
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
    mapping, reading = dict(angles.origin.mapping), angles.origin.reading
    channels, theirs = dict(reading.channels), torques.origin.reading
    for name, channel in theirs.channels.items():
        mapping[name] = f"{other.name}: {torques.origin.mapping[name]}"
        channels[name] = replace(
            channel, source=mapping[name] if channel.factor else channel.source
        )
    reading = replace(
        reading, channels=channels, topics=reading.topics + theirs.topics, torque_file=str(other)
    )
    origin = replace(angles.origin, mapping=mapping, reading=reading)
    notices = angles.notices + torques.notices
    return TableReader(origin, tables, notices, angles.rows, laws=angles.laws)
