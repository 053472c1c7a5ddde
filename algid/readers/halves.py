"""A log that stands in two files: angles in one and torques in another, joined on their stamps.

Torques are interpolated to the stamps of the angles, where both were recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.errors import LogError
from algid.log import Origin
from algid.notices import Notice, Remedy
from algid.readers.assemble import TableReader
from algid.readers.formats import format_of
from algid.readers.table import BLOCK_ROWS, SampleTable
from algid.readers.timebase import Series, aligned, in_order, whole_topic

if TYPE_CHECKING:
    from algid.profile import Profile

Opener = Callable[[Any, "Profile"], TableReader]
"""Opens one file, or columns in memory, as a profile says."""


def open_halves(log: Any, profile: Profile, open_one: Opener) -> TableReader:
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

    def tables(rows: int) -> Iterator[SampleTable]:
        torque_series = whole_topic(
            str(other), other.name, torques.origin.mapping, torques.tables(BLOCK_ROWS)
        )
        main = in_order(path, angles.tables(rows))
        return aligned(_overlap(path, main, torque_series), [torque_series])

    return TableReader(
        _joined(angles.origin, torques.origin, other, profile),
        tables,
        replace(
            angles.conversion,
            channels={**angles.conversion.channels, **torques.conversion.channels},
        ),
        (*angles.notices, *torques.notices),
        angles.rows,
    )


def _beside(log: Any, name: str) -> Path:
    """The file of the torques: beside the log, or as its name says."""
    near = [Path(log).parent / name] if isinstance(log, str | Path) else []
    places = list(dict.fromkeys([*near, Path(name)]))
    for place in places:
        if place.exists():
            return place
    raise LogError(
        f"{name}: there is no such file of torques, neither beside the log nor in the working "
        f"folder; {Remedy({'torque_file': None}, 'name it')}"
    )


def _torques(other: Path, profile: Profile, angles: Origin, open_one: Opener) -> TableReader:
    """The file of the torques; its joints follow the order of the angles' if both have names."""
    names = {entry.name for entry in format_of(other).entries(other)}
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


def _joined(angles: Origin, torques: Origin, other: Path, profile: Profile) -> Origin:
    """Where each channel of both files comes from, and how it was read."""
    sources = {
        name: f"{other.name}: {source}" for name, source in torques.mapping.items() if name != "t"
    }
    of_torques = {
        name: replace(one, source=sources[name]) if one.factor else one
        for name, one in torques.reading.channels.items()
    }
    reading = replace(
        angles.reading,
        channels={**angles.reading.channels, **of_torques},
        topics=(*angles.reading.topics, *torques.reading.topics),
        torque_file=str(other),
        start=profile.start,
        end=profile.end,
        segment=profile.segment,
    )
    return replace(angles, mapping={**angles.mapping, **sources}, reading=reading)


def _overlap(path: str, main: Iterator[SampleTable], other: Series) -> Iterator[SampleTable]:
    """The rows of `main` within the other file's time; the last table counts those outside."""
    first, last = int(other.table.stamp_ns[0]), int(other.table.stamp_ns[-1])
    rows, inside, held = 0, 0, None
    begin, end = None, 0
    for table in main:
        if held is not None:
            yield held
        if len(table):
            begin = int(table.stamp_ns[0]) if begin is None else begin
            end = int(table.stamp_ns[-1])
        within = (table.stamp_ns >= first) & (table.stamp_ns <= last)
        rows, inside = rows + len(table), inside + int(np.count_nonzero(within))
        held = table if within.all() else table.take(within)
    if rows and inside < 2:
        spans = [
            f"{low * 1e-9:.6f} to {high * 1e-9:.6f} s"
            for low, high in ((begin or 0, end), (first, last))
        ]
        raise LogError(
            f"{path}: its angles run from {spans[0]} and the torques of {other.topic} from "
            f"{spans[1]}: expected files that overlap in time, stamped by one clock; shift the "
            "times of one of them"
        )
    if held is not None:
        numbers = {"file": other.topic, "count": rows - inside}
        yield held.noting(
            *([Notice("OVERLAP", numbers=numbers, note=True)] if rows > inside else [])
        )
