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
    """The source of a log from arrays.

    Its angles are rad by the definition of `Log`, however far joints turn.
    """
    reading = log.origin.reading
    if "theta1" not in reading.channels and "DEGREES" not in reading.accepted:
        accepted = replace(reading, accepted=reading.accepted + ("DEGREES",))
        log = replace(log, origin=replace(log.origin, reading=accepted))
    check_step(log.origin.path, log.stamp_ns)

    def digest() -> str:
        every = hashlib.sha256()
        for array in (log.stamp_ns, log.theta, log.tau):
            every.update(array.tobytes())
        return every.hexdigest()

    return Recording(
        name=log.origin.path,
        role=role,
        origin=log.origin,
        blocks=lambda: iter([log]),
        promised=len(log),
        gravity=gravity,
        effort=effort,
        digest=digest,
    )


def _of_file(
    path: Path, role: Role, profile: Profile | None, gravity: float, effort: str | None
) -> Recording:
    """The source of a log in a file, read ahead of whoever goes over it."""
    from algid.readers import open_log

    reader = open_log(path, profile)

    def checked() -> Iterator[Log]:
        for number, block in enumerate(reader.blocks()):
            if number == 0:  # which has to be sampled as an arm is
                check_step(block.origin.path, block.stamp_ns)
            yield block

    def blocks() -> Iterator[Log]:
        # of a short log a thread would cost more than it reads ahead
        return checked() if 0 < reader.rows <= SHORT else ahead(checked())

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


def open_sources(
    unloaded: LogLike | Iterable[LogLike] | None,
    loaded: LogLike | Iterable[LogLike] | None,
    profile: Profile | None,
    gravity: float,
    effort: str | None = None,
) -> list[Recording]:
    """Sources of one log, several, or none of each role, unloaded ones first: see `open_source`.

    A log that is given twice, byte for byte, counts once, and the first of the two has a notice of
    the other; a loaded one that is also given as unloaded has a notice of that: its payload is
    zero. Only logs that promise as many samples as another are hashed for it.
    """
    sources: list[Recording] = []
    both: tuple[tuple[Role, LogLike | Iterable[LogLike] | None], ...]
    both = (("unloaded", unloaded), ("loaded", loaded))
    for role, logs in both:
        if logs is None:
            continue
        if isinstance(logs, str | Path | Log | Staged) or is_columns(logs):
            logs = [logs]
        if not isinstance(logs, Iterable):
            refuse_others(logs)
        sources += [open_source(log, role, profile, gravity, effort) for log in logs]
    lengths = Counter(source.promised for source in sources if source.digest)
    kept: list[Recording] = []
    seen: dict[str, dict[Role, Recording]] = {}
    for source in sources:
        if source.digest is not None and lengths[source.promised] > 1:
            twins = seen.setdefault(source.digest(), {})
            if source.role in twins:
                numbers = {"case": "twice", "name": source.name}
                twins[source.role].notices += (Notice("SAME_LOG", numbers=numbers),)
                continue
            for twin in twins.values():
                numbers = {"case": "loaded", "name": source.name, "twin": twin.name}
                source.notices += (Notice("SAME_LOG", numbers=numbers),)
            twins[source.role] = source
        kept.append(source)
    return kept


def read_otherwise(logs: Sequence[LogSummary], earlier: Result, file: str) -> list[Notice]:
    """Warnings of logs read otherwise than those of an earlier result, which `file` holds."""
    before = earlier.log.reading
    if before is None:
        return []
    notices = []
    for log in logs:
        differences = sorted(log.reading.differences(before)) if log.reading else []
        if differences:
            numbers = {"case": "reading", "file": file, "differences": ", ".join(differences)}
            name = PurePath(log.path).name
            notices.append(Notice("OTHER_ARM", numbers=numbers, logs=(name,)))
    return notices
