"""Logs opened from files and from memory, and which of them may go together."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from algid.base.errors import LogError
from algid.base.files import sha256_of
from algid.base.runtime import ahead
from algid.identification.recordings import SHORT, Recording, Role
from algid.log import Log
from algid.notices import Notice
from algid.readers.clock import check_step
from algid.readers.memory import FrameOrArrays, is_columns, refuse_others
from algid.results import LogSummary, Result

if TYPE_CHECKING:
    from algid.profile import Profile


@dataclass(frozen=True)
class Staged:
    """A log that was fetched from an object store: its copy on this machine, and its URL."""

    path: Path
    url: str


LogLike = str | Path | Log | Staged | FrameOrArrays


def open_source(
    log: LogLike,
    role: Role,
    profile: Profile | None = None,
    gravity: float = 9.81,
    effort: str | None = None,
    *,
    changing: bool = False,
) -> Recording:
    """Open a log from a file or from memory.

    Parameters
    ----------
    log : path, `Log`, `Staged`, or columns as `algid.readers.memory` takes them
    role : 'unloaded' or 'loaded'
    profile : Profile
        What the log's names, units and signs mean.
    gravity : float, m/s^2, for the named checks
    changing : bool
        Whether the payload may change: then the log is refused for no payload that its metadata
        name.

    Raises
    ------
    LogError
        If the log cannot be opened, or its metadata name another payload than its role.
    """
    from algid.readers import open_log

    if not isinstance(log, Log | Staged):
        refuse_others(log)
    if is_columns(log):
        log = open_log(log, profile).whole()
    if isinstance(log, Log):
        source = _in_memory(log, role, gravity, effort)
    elif isinstance(log, Staged):
        source = replace(_of_file(log.path, role, profile, gravity, effort), name=log.url)
    else:
        source = _of_file(Path(log), role, profile, gravity, effort)
        source = replace(source, name=str(log))
    truth = source.origin.truth
    if truth is None or changing:
        return source
    if truth.schedule:
        raise LogError(
            f"{source.name}: its metadata say that the payload changes; weigh it with algid track"
        )
    if (truth.payload > 0) != (role == "loaded"):
        payload = "no payload"
        if truth.payload > 0:
            payload = f"a payload of {truth.payload:g} kg"
        raise LogError(
            f"{source.name}: expected a log of the {role} arm, its metadata say {payload}; "
            "swap the logs"
        )
    return source


def _in_memory(log: Log, role: Role, gravity: float, effort: str | None) -> Recording:
    """The source of a log from arrays."""
    log = _in_radians(log)
    check_step(log.origin.path, log.stamp_ns)
    return Recording(
        name=log.origin.path,
        role=role,
        origin=log.origin,
        blocks=lambda: iter([log]),
        promised=len(log),
        gravity=gravity,
        effort=effort,
        digest=partial(_hash_of_arrays, log),
    )


def _of_file(
    path: Path, role: Role, profile: Profile | None, gravity: float, effort: str | None
) -> Recording:
    """The source of a log in a file, read ahead of whoever goes over it."""
    from algid.readers import open_log

    reader = open_log(path, profile)

    def blocks() -> Iterator[Log]:
        read = _of_an_arm(reader.blocks())
        if 0 < reader.rows <= SHORT:
            return read  # a thread would cost more than it reads ahead
        return ahead(read)

    return Recording(
        name=str(path),
        role=role,
        origin=reader.origin,
        blocks=blocks,
        promised=reader.rows,
        gravity=gravity,
        effort=effort,
        digest=cache(partial(sha256_of, path)),
    )


def _of_an_arm(blocks: Iterator[Log]) -> Iterator[Log]:
    """The blocks of a log, once the first is known to be sampled as an arm is."""
    for number, block in enumerate(blocks):
        if number == 0:
            check_step(block.origin.path, block.stamp_ns)
        yield block


def open_sources(
    logs: LogLike | Iterable[LogLike] | None,
    role: Role,
    profile: Profile | None,
    gravity: float,
    effort: str | None = None,
) -> list[Recording]:
    """Sources of one log, several, or none: see `open_source`.

    A log that is given twice, byte for byte, counts once, and the first of the two has a notice of
    the other. Only logs that promise as many samples as another are hashed for it.
    """
    if logs is None:
        return []
    if isinstance(logs, str | Path | Log | Staged) or is_columns(logs):
        logs = [logs]
    if not isinstance(logs, Iterable):
        refuse_others(logs)
    sources = [open_source(log, role, profile, gravity, effort) for log in logs]
    lengths = Counter(source.promised for source in sources if source.digest)
    kept: list[Recording] = []
    places: dict[str, int] = {}
    for source in sources:
        if source.digest is not None and lengths[source.promised] > 1:
            place = places.setdefault(source.digest(), len(kept))
            if place < len(kept):
                twin = Notice("SAME_LOG", numbers={"case": "twice", "name": source.name})
                kept[place].notices += (twin,)
                continue
        kept.append(source)
    return kept


def with_twins_marked(unloaded: list[Recording], loaded: list[Recording]) -> list[Recording]:
    """All logs, unloaded ones first.

    A loaded one that is also given as unloaded has a notice of it: its payload is zero.
    """
    if _hashed_lengths(unloaded).isdisjoint(_hashed_lengths(loaded)):
        return unloaded + loaded
    names = {}
    for source in unloaded:
        if source.digest:
            names[source.digest()] = source.name
    for source in loaded:
        if source.digest is not None and source.digest() in names:
            numbers = {"name": source.name, "twin": names[source.digest()]}
            source.notices += (Notice("SAME_LOG", numbers={"case": "loaded"} | numbers),)
    return unloaded + loaded


def _hashed_lengths(sources: Iterable[Recording]) -> set[int]:
    """How many samples those sources promise that can be hashed."""
    return {source.promised for source in sources if source.digest}


def _in_radians(log: Log) -> Log:
    """A log from arrays: its angles are rad by the definition of `Log`, however far joints turn."""
    reading = log.origin.reading
    if "theta1" in reading.channels or "DEGREES" in reading.accepted:
        return log
    accepted = replace(reading, accepted=reading.accepted + ("DEGREES",))
    return replace(log, origin=replace(log.origin, reading=accepted))


def _hash_of_arrays(log: Log) -> str:
    digest = hashlib.sha256()
    for array in (log.stamp_ns, log.theta, log.tau):
        digest.update(array.tobytes())
    return digest.hexdigest()


def read_otherwise(logs: Sequence[LogSummary], earlier: Result, file: str) -> list[Notice]:
    """Warnings of logs read otherwise than those of an earlier result, which `file` holds."""
    before = earlier.log.reading
    if before is None:
        return []
    notices = []
    for log in logs:
        if log.reading is None:
            continue
        differences = sorted(log.reading.differences(before))
        if differences:
            numbers = {"file": file, "differences": ", ".join(differences)}
            name = PurePath(log.path).name
            notices.append(Notice("OTHER_ARM", numbers={"case": "reading"} | numbers, logs=(name,)))
    return notices
