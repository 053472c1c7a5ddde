"""Logs to identify from, opened once and never changed, and what passes over them show."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import chain
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Literal

from algid.errors import LogError
from algid.log import Log, Notice, Origin
from algid.progress import Told
from algid.results import LogSummary, Result
from algid.runtime import Beside, ahead
from algid.signals.segments import Segment, segments

if TYPE_CHECKING:
    from algid.profile import Profile

Role = Literal["unloaded", "loaded"]
EXAMINED = 1 << 16
"""Samples at the start of a long log that the named checks look at."""
MOST_KEPT = 1 << 20
"""Samples of all logs together that are kept in memory, 48 bytes each with velocities, so that they are read once."""


@dataclass(frozen=True)
class Staged:
    """A log that was fetched from an object store: its copy on this machine, and its URL.

    A copy that is not `whole` holds what the reader needs, and zeros elsewhere: the log's hash is not known then.
    """

    path: Path
    url: str
    whole: bool = True


LogLike = str | Path | Log | Staged


@dataclass(frozen=True, eq=False)
class LogSource:
    """One log, opened; `Survey` goes over it.

    Parameters
    ----------
    name : its path, its URL, or what a log in memory calls itself
    role : 'unloaded' or 'loaded'
    origin : Origin
    blocks : callable
        Gives a fresh pass over the samples.
    promised : samples that the file says it has, 0 where it does not
    gravity : float, m/s^2, for the named checks
    digest : callable or None
        Gives the SHA-256 of the log; None where only parts of it are here.
    """

    name: str
    role: Role
    origin: Origin
    blocks: Callable[[], Iterator[Log]]
    promised: int
    gravity: float
    digest: Callable[[], str] | None
    notices: tuple[Notice, ...] = ()


def open_source(
    log: LogLike, role: Role, profile: Profile | None = None, gravity: float = 9.81, *, changing: bool = False
) -> LogSource:
    """Open a log from a file or from memory.

    Parameters
    ----------
    log : path, `Log` or `Staged`
    role : 'unloaded' or 'loaded'
    profile : Profile
        What the log's names, units and signs mean.
    gravity : float, m/s^2, for the named checks
    changing : bool
        Whether the payload may change: then the log is refused for no payload that its metadata name.

    Raises
    ------
    LogError
        If the log cannot be opened, or its metadata name another payload than its role.
    """
    if isinstance(log, Log):
        source = LogSource(
            log.origin.path, role, log.origin, lambda: iter([log]), len(log), gravity, partial(_hash_of_arrays, log)
        )
    else:
        from algid.readers import open_log

        path = log.path if isinstance(log, Staged) else Path(log)
        reader = open_log(path, profile)
        name, whole = (log.url, log.whole) if isinstance(log, Staged) else (str(log), True)
        digest = cache(partial(sha256_of, path)) if whole else None
        source = LogSource(name, role, reader.origin, lambda: ahead(reader.blocks()), reader.rows, gravity, digest)
    if not changing:
        _refuse_the_other_role(source)
    return source


def open_sources(
    logs: LogLike | Iterable[LogLike] | None, role: Role, profile: Profile | None, gravity: float
) -> list[LogSource]:
    """Sources of one log, several, or none: see `open_source`. A log that is given twice counts once, with a notice."""
    if logs is None:
        return []
    several = [logs] if isinstance(logs, str | Path | Log | Staged) else list(logs)
    return _distinct([open_source(log, role, profile, gravity) for log in several])


def _distinct(sources: list[LogSource]) -> list[LogSource]:
    """The sources without those of the same SHA-256 as one before, which tells of them.

    Only logs that promise as many samples as another are hashed for it.
    """
    kept: list[LogSource] = []
    places: dict[tuple[int, str], int] = {}
    lengths = Counter(source.promised for source in sources if source.digest)
    for source in sources:
        content = (source.promised, source.digest()) if source.digest and lengths[source.promised] > 1 else None
        if content is not None and content in places:
            said = Notice("SAME_LOG", f"SAME_LOG: {source.name} is the same log, byte for byte, and counts once")
            twin = places[content]
            kept[twin] = replace(kept[twin], notices=(*kept[twin].notices, said))
            continue
        if content is not None:
            places[content] = len(kept)
        kept.append(source)
    return kept


def tell_twins(unloaded: list[LogSource], loaded: list[LogSource]) -> list[LogSource]:
    """All logs, unloaded ones first; a loaded one that is also given as unloaded tells so: its payload is nought."""
    lengths = {source.promised for source in unloaded if source.digest}
    if not any(source.digest and source.promised in lengths for source in loaded):
        return [*unloaded, *loaded]
    names = {source.digest(): source.name for source in unloaded if source.digest}
    told = []
    for source in loaded:
        twin = names.get(source.digest()) if source.digest else None
        text = f"SAME_LOG: {source.name} is {twin}, byte for byte: one log is given as unloaded and as loaded"
        said = () if twin is None else (Notice("SAME_LOG", f"{text}, which makes the payload nought"),)
        told.append(replace(source, notices=(*source.notices, *said)))
    return [*unloaded, *told]


def _refuse_the_other_role(source: LogSource) -> None:
    truth, name, role = source.origin.truth, source.name, source.role
    if truth is not None and truth.schedule:
        raise LogError(f"{name}: its metadata say that the payload changes; weigh it with algid track")
    if truth is None or (truth.payload > 0) == (role == "loaded"):
        return
    found = f"a payload of {truth.payload:g} kg" if truth.payload > 0 else "no payload"
    raise LogError(f"{name}: expected a log of the {role} arm, its metadata say {found}; swap the logs")


def _hash_of_arrays(log: Log) -> str:
    digest = hashlib.sha256()
    for array in (log.stamp_ns, *log.theta, *log.tau):
        digest.update(array.tobytes())
    return digest.hexdigest()


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files in the order of their names."""
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as opened:
                while chunk := opened.read(1 << 20):
                    digest.update(chunk)
    return digest.hexdigest()


@dataclass(frozen=True)
class Seen:
    """What a pass over a whole log has shown: its samples, its first and last stamp in ns, and what was noticed."""

    rows: int
    first_ns: int
    last_ns: int
    notices: tuple[Notice, ...]


class Survey:
    """Goes over logs as often as an estimator asks, and keeps what the first pass over each shows.

    Hashing and the named checks run beside the first pass; whoever wants to know how far a pass has come is told.
    Logs of `MOST_KEPT` samples in all are read once and kept; longer ones are read again for each pass.

    Parameters
    ----------
    logs : the logs, unloaded ones first
    told : callable
        Called with the stage and how many samples of how many it has gone over.
    """

    def __init__(self, logs: Sequence[LogSource], told: Told | None = None) -> None:
        self.logs = tuple(logs)
        self.told = told
        self._seen: dict[LogSource, Seen] = {}
        self._findings: dict[LogSource, tuple[Notice, ...]] = {}
        self._digests: dict[LogSource, Beside[str]] = {}
        self._kept: dict[LogSource, tuple[Segment, ...]] = {}
        self._room = MOST_KEPT
        self._stage, self._over = "fitting", self.logs
        self._words = ""
        self._done: dict[LogSource, int] = {}

    @property
    def unloaded(self) -> list[LogSource]:
        """The logs of the arm without payload."""
        return [log for log in self.logs if log.role == "unloaded"]

    @property
    def loaded(self) -> list[LogSource]:
        """The logs of the arm with its payload."""
        return [log for log in self.logs if log.role == "loaded"]

    def begin(self, stage: str, logs: Sequence[LogSource] | None = None) -> None:
        """The passes from here on are over `logs`, by default all, and of that stage."""
        self._stage, self._over, self._words = stage, self.logs if logs is None else tuple(logs), ""

    def segments(self, log: LogSource) -> Iterator[Segment]:
        """A fresh pass over a log: its uniform segments, from its start. Raises `LogError` where it is refused."""
        return self._again(log) if log in self._kept else self._keeping(log)

    def _keeping(self, log: LogSource) -> Iterator[Segment]:
        held: list[Segment] = []
        rows = 0
        for piece in segments(self._counted(log)):
            rows += len(piece)
            if rows <= self._room:
                held.append(piece)
            else:
                held.clear()
            yield piece
        if rows <= self._room and log not in self._kept:
            self._kept[log] = tuple(held)
            self._room -= rows

    def _again(self, log: LogSource) -> Iterator[Segment]:
        rows = 0
        self._tell(log, 0)
        for piece in self._kept[log]:
            yield piece
            rows += len(piece)
            self._tell(log, rows)

    def seen(self, log: LogSource) -> Seen:
        """What the log holds; goes over it where no estimator has done so to its end."""
        if log not in self._seen:
            for _ in self._counted(log):
                pass
        return self._seen[log]

    def summary(self, log: LogSource) -> LogSummary:
        """The log as a result names it."""
        seen = self.seen(log)
        duration = (seen.last_ns - seen.first_ns) * 1e-9
        return LogSummary(
            path=log.name,
            sha256=self._sha256(log),
            role=log.role,
            format=log.origin.format,
            rows=seen.rows,
            start_ns=seen.first_ns,
            duration=duration,
            rate=(seen.rows - 1) / duration if duration > 0 else 0.0,
            mapping=dict(log.origin.mapping),
            reading=log.origin.reading,
        )

    def _sha256(self, log: LogSource) -> str | None:
        self._start_hashing(log)
        return self._digests[log].result() if log in self._digests else None

    def _start_hashing(self, log: LogSource) -> None:
        if log.digest is not None and log not in self._digests:
            self._digests[log] = Beside(log.digest)

    def _counted(self, log: LogSource) -> Iterator[Log]:
        rows, first_ns, last_ns = 0, 0, 0
        notices: list[Notice] = list(log.notices)
        self._start_hashing(log)
        self._tell(log, 0)
        for block, alone in _with_end(log.blocks(), log.promised):
            if len(block) and not rows:
                first_ns = int(block.stamp_ns[0])
                notices += self._examined(log, block, alone)
            if len(block):
                last_ns = int(block.stamp_ns[-1])
            rows += len(block)
            notices += block.notices
            yield block
            self._tell(log, rows)
        self._seen.setdefault(log, Seen(rows, first_ns, last_ns, tuple(notices)))

    def _examined(self, log: LogSource, block: Log, alone: bool) -> tuple[Notice, ...]:
        """What the named checks find in the first block; they refuse a log only where that is all of it."""
        if log not in self._findings:
            from algid.inspection.checks import noticed

            block = block if alone else block.part(0, EXAMINED)
            self._findings[log] = noticed(block, gravity=log.gravity, whole=alone)
        return self._findings[log]

    def _tell(self, log: LogSource, rows: int) -> None:
        """A pass over `log` has come as far as `rows` samples; 0 starts one. The first over a log reads it."""
        if self.told is None:
            return
        words = self._stage if log in self._seen else "reading"
        if words != self._words or (rows == 0 and log in self._done):
            self._words, self._done = words, {}
        self._done[log] = rows
        expected = [self._seen[one].rows if one in self._seen else one.promised for one in self._over]
        self.told(words, sum(self._done.values()), sum(expected) if all(expected) else 0)


def read_otherwise(logs: Sequence[LogSummary], earlier: Result, file: str) -> list[str]:
    """Warnings of logs that were read otherwise than those of an earlier result, which `file` holds."""
    before = earlier.log.reading
    if before is None:
        return []
    told = []
    for log in logs:
        differences = sorted(log.reading.differences(before)) if log.reading else []
        if differences:
            told.append(f"{PurePath(log.path).name}: read otherwise than the log of {file}: {', '.join(differences)}")
    return told


def _with_end(blocks: Iterator[Log], promised: int) -> Iterator[tuple[Log, bool]]:
    """Each block, and whether it is the only one.

    Where more than twice its samples are promised it is not, and need not wait for the second one: a reader
    refuses a log of which it would have to drop half.
    """
    first = next(blocks, None)
    if first is None:
        return
    if promised > 2 * len(first):
        yield first, False
        yield from ((block, False) for block in blocks)
        return
    second = next(blocks, None)
    yield first, second is None
    for block in chain([] if second is None else [second], blocks):
        yield block, False
