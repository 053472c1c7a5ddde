"""Logs to identify from, opened once and never changed."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Literal

from algid.errors import LogError
from algid.files import sha256_of
from algid.log import Log, Origin
from algid.notices import Notice
from algid.readers.memory import Columns, is_columns, refuse_others
from algid.readers.timebase import check_step
from algid.results import LogSummary, Result
from algid.runtime import ahead

if TYPE_CHECKING:
    from algid.profile import Profile

Role = Literal["unloaded", "loaded"]


@dataclass(frozen=True)
class Staged:
    """A log that was fetched from an object store: its copy on this machine, and its URL.

    A copy that is not `whole` holds what the reader needs, and zeros elsewhere: the log's hash is
    not known then.
    """

    path: Path
    url: str
    whole: bool = True


LogLike = str | Path | Log | Staged | Columns


@dataclass(frozen=True, eq=False)
class LogSource:
    """One log, opened; `algid.identification.survey.Survey` goes over it.

    Parameters
    ----------
    name : its path, its URL, or what a log in memory calls itself
    role : 'unloaded' or 'loaded'
    origin : Origin
    blocks : callable
        Gives a fresh pass over the samples.
    promised : samples that the file says it has, 0 where it does not
    gravity : float, m/s^2, for the named checks
    effort : as in `Settings`, for the named checks
    digest : callable or None
        Gives the SHA-256 of the log; None where only parts of it are here.
    """

    name: str
    role: Role
    origin: Origin
    blocks: Callable[[], Iterator[Log]]
    promised: int
    gravity: float
    effort: str | None
    digest: Callable[[], str] | None
    notices: tuple[Notice, ...] = ()


def open_source(
    log: LogLike,
    role: Role,
    profile: Profile | None = None,
    gravity: float = 9.81,
    effort: str | None = None,
    *,
    changing: bool = False,
) -> LogSource:
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
        log = _in_radians(log)
        check_step(log.origin.path, log.stamp_ns)
        source = LogSource(
            log.origin.path,
            role,
            log.origin,
            lambda: iter([log]),
            len(log),
            gravity,
            effort,
            partial(_hash_of_arrays, log),
        )
    else:
        path = log.path if isinstance(log, Staged) else Path(log)
        reader = open_log(path, profile)
        name, whole = (log.url, log.whole) if isinstance(log, Staged) else (str(log), True)
        digest = cache(partial(sha256_of, path)) if whole else None
        source = LogSource(
            name,
            role,
            reader.origin,
            lambda: ahead(_of_an_arm(reader.blocks())),
            reader.rows,
            gravity,
            effort,
            digest,
        )
    truth = source.origin.truth
    if truth is None or changing:
        return source
    if truth.schedule:
        raise LogError(
            f"{source.name}: its metadata say that the payload changes; weigh it with algid track"
        )
    if (truth.payload > 0) != (role == "loaded"):
        payload = f"a payload of {truth.payload:g} kg" if truth.payload > 0 else "no payload"
        raise LogError(
            f"{source.name}: expected a log of the {role} arm, its metadata say {payload}; "
            "swap the logs"
        )
    return source


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
) -> list[LogSource]:
    """Sources of one log, several, or none: see `open_source`.

    A log that is given twice, byte for byte, counts once, and the first of the two has a notice of
    the other. Only logs that promise as many samples as another are hashed for it.
    """
    several = [] if logs is None else logs
    if isinstance(several, str | Path | Log | Staged) or is_columns(several):
        several = [several]
    if not isinstance(several, Iterable):
        refuse_others(several)
    sources = [open_source(log, role, profile, gravity, effort) for log in several]
    lengths = Counter(source.promised for source in sources if source.digest)
    kept: list[LogSource] = []
    places: dict[str, int] = {}
    for source in sources:
        hashed = source.digest is not None and lengths[source.promised] > 1
        content = source.digest() if source.digest and hashed else None
        if content in places:
            twin = places[content]
            said = Notice("SAME_LOG", numbers={"name": source.name})
            kept[twin] = replace(kept[twin], notices=(*kept[twin].notices, said))
            continue
        if content is not None:
            places[content] = len(kept)
        kept.append(source)
    return kept


def with_twins_marked(unloaded: list[LogSource], loaded: list[LogSource]) -> list[LogSource]:
    """All logs, unloaded ones first.

    a loaded one that is also given as unloaded says so: its payload is zero.
    """
    lengths = {source.promised for source in unloaded if source.digest}
    if not any(source.digest and source.promised in lengths for source in loaded):
        return [*unloaded, *loaded]
    names = {source.digest(): source.name for source in unloaded if source.digest}
    marked = []
    for source in loaded:
        twin = names.get(source.digest()) if source.digest else None
        numbers = {"name": source.name, "twin": twin}
        said = () if twin is None else (Notice("SAME_LOG_LOADED", numbers=numbers),)
        marked.append(replace(source, notices=(*source.notices, *said)))
    return [*unloaded, *marked]


def refuse_shared_torques(sources: Sequence[LogSource]) -> None:
    """Refuse logs whose torques would come from one file: they were not recorded at once.

    Raises
    ------
    LogError
        If two of them do.
    """
    owners: dict[str, str] = {}
    for source in sources:
        file = source.origin.reading.torque_file
        if file is None:
            continue
        owner = owners.setdefault(file, source.name)
        if owner != source.name:
            raise LogError(
                f"{source.name}: its torques would come from {file}, as those of {owner} do; put "
                "each log and its torques into a folder of their own, under the same names"
            )


def _in_radians(log: Log) -> Log:
    """A log from arrays: its angles are rad by the definition of `Log`, however far joints turn."""
    reading = log.origin.reading
    if "theta1" in reading.channels or "DEGREES" in reading.accepted:
        return log
    accepted = replace(reading, accepted=(*reading.accepted, "DEGREES"))
    return replace(log, origin=replace(log.origin, reading=accepted))


def _hash_of_arrays(log: Log) -> str:
    digest = hashlib.sha256()
    for array in (log.stamp_ns, *log.theta, *log.tau):
        digest.update(array.tobytes())
    return digest.hexdigest()


def read_otherwise(logs: Sequence[LogSummary], earlier: Result, file: str) -> list[Notice]:
    """Warnings of logs read otherwise than those of an earlier result, which `file` holds."""
    before = earlier.log.reading
    if before is None:
        return []
    return [
        Notice(
            "READ_OTHERWISE",
            numbers={"file": file, "differences": ", ".join(differences)},
            logs=(PurePath(log.path).name,),
        )
        for log in logs
        if log.reading and (differences := sorted(log.reading.differences(before)))
    ]
