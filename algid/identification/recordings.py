"""Recordings: logs opened from files and memory, judged once an arm, read as rarely as can be."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.base.files import sha256_of
from algid.base.names import evenly_spread
from algid.base.progress import Progress
from algid.base.runtime import ahead, beside
from algid.log import Log, Origin
from algid.notices import Notice, has_code
from algid.options import flag
from algid.readers.clock import check_step
from algid.readers.memory import FrameOrArrays, is_columns
from algid.results import LogSummary
from algid.signals.observers import PAPER_POLES, observed
from algid.signals.segments import Segment, segments

if TYPE_CHECKING:
    from algid.estimators.convention_search import Recorded
    from algid.estimators.saturation import Limit, Saturation
    from algid.profile import Profile
    from algid.settings import Settings

EXAMINED = 1 << 15
"""Samples at the start of a long log that the named checks look at."""
SHORT = 1 << 16
"""Samples of a log that is read and hashed sooner than a thread starts."""
_WHOLE = 0.9  # of a log's samples: what is left is where it was cut
MOST_KEPT = 1 << 20
"""Samples of all logs together that stay in memory, 48 bytes each, so that they are read once."""

Role = Literal["unloaded", "loaded"]


@dataclass(eq=False)
class Recording:
    """One log, opened, and what the first pass over it shows; see `Recordings`.

    Parameters
    ----------
    name : its path, its URL, or what a log in memory calls itself
    role : 'unloaded' or 'loaded'
    origin : Origin
    blocks : callable
        Gives a fresh pass over the samples.
    promised : samples that the file says it has, 0 where it does not
    digest : callable or None
        Gives the SHA-256 of the log; None where only parts of it are here.
    notices : of opening it, then of the first pass too
    rows : samples; None before a pass has come to the end
    first_ns, last_ns : its first and its last stamp
    limits : of its torques; None before its first samples are examined
    recorded : what its conventions are judged by, where those of several logs are together
    begin : all of a log that was looked at before its first pass
    kept : its segments, of a log that stays in memory
    """

    name: str
    role: Role
    origin: Origin
    blocks: Callable[[], Iterator[Log]]
    promised: int
    digest: Callable[[], str] | None
    notices: tuple[Notice, ...] = ()
    rows: int | None = None
    first_ns: int = 0
    last_ns: int = 0
    limits: tuple[Limit, ...] | None = None
    recorded: list[Recorded] | None = None
    begin: Log | None = None
    kept: tuple[Segment, ...] | None = None

    @property
    def duration(self) -> float:
        """From the first to the last stamp, in s."""
        return (self.last_ns - self.first_ns) * 1e-9


@dataclass(frozen=True)
class Staged:
    """A log that was fetched from an object store: its copy on this machine, and its URL."""

    path: Path
    url: str


LogLike = str | Path | Log | Staged | FrameOrArrays
OneOrMore = LogLike | Iterable[LogLike] | None
"""What a call takes of a role: a log, several, or none."""


def open_source(
    log: LogLike, role: Role, profile: Profile | None = None, *, changing: bool = False
) -> Recording:
    """Open a log from a file, which is read ahead of whoever goes over it, or from memory.

    Parameters
    ----------
    log : path, `Log`, `Staged`, or columns as `algid.readers.memory` takes them
    role : 'unloaded' or 'loaded'
    profile : Profile
        What the log's names, units and signs mean.
    changing : bool
        Whether the payload may change: then the log is refused for no payload that its metadata
        name.

    Raises
    ------
    LogError
        If the log cannot be opened, or its metadata name another payload than its role.
    """
    from algid.readers import open_log

    name = None
    if isinstance(log, Staged):
        name, log = log.url, log.path
    if isinstance(log, str | Path):
        path = Path(log)
        reader = open_log(path, profile)

        def blocks() -> Iterator[Log]:
            # of a short log a thread would cost more than it reads ahead
            return reader.blocks() if 0 < reader.rows <= SHORT else ahead(reader.blocks())

        digest = cache(partial(sha256_of, path))
        source = Recording(name or str(log), role, reader.origin, blocks, reader.rows, digest)
    else:
        if not isinstance(log, Log):
            log = open_log(log, profile).whole()
        source = _in_memory(log, role)
    truth = source.origin.truth
    if truth is None or changing:
        return source
    if truth.schedule:
        raise LogError(
            f"{source.name}: its metadata say that the payload changes; weigh it with algid track"
        )
    if (truth.payload > 0) != (role == "loaded"):
        payload, kind = "no payload", "an unloaded"
        if truth.payload > 0:
            payload, kind = f"a payload of {truth.payload:g} kg", "a loaded"
        raise LogError(
            f"{source.name}: expected a log of the {role} arm, its metadata say {payload}; "
            f"give it as {kind} one"
        )
    return source


def _in_memory(log: Log, role: Role) -> Recording:
    """The log from arrays."""

    def digest() -> str:
        every = hashlib.sha256()
        for array in (log.stamp_ns, log.theta, log.tau):
            every.update(array.tobytes())
        return every.hexdigest()

    return Recording(log.origin.path, role, log.origin, lambda: iter([log]), len(log), digest)


def open_sources(
    unloaded: OneOrMore, loaded: OneOrMore, profile: Profile | None = None
) -> list[Recording]:
    """Sources of one log, several, or none of each role, unloaded ones first: see `open_source`.

    Of logs in memory that have one name the later ones are numbered.
    """
    sources: list[Recording] = []
    called = Counter[str]()
    given: dict[Role, OneOrMore] = {"unloaded": unloaded, "loaded": loaded}
    for role, logs in given.items():
        if logs is None:
            continue
        alone = isinstance(logs, str | Path | Log | Staged) or is_columns(logs)
        for log in logs if isinstance(logs, Iterable) and not alone else [logs]:
            source = open_source(log, role, profile)
            called[source.name] += 1
            if called[source.name] > 1 and not isinstance(log, str | Path | Staged):
                source.name += f" ({called[source.name]})"
            sources.append(source)
    return sources


class Recordings:
    """Logs that are gone over as often as an estimator asks.

    What is the arm's and its driver's (limits of torques, conventions) is judged of all logs of a
    role together, in the first samples of at most `MOST_LOGS` of them; sampling and channels are
    judged log by log, in the first pass. Hashing runs beside it. Logs of `MOST_KEPT` samples in all
    are read once and kept; longer ones are read again for each pass, block by block.

    Parameters
    ----------
    logs : the logs, unloaded ones first
    progress : callable
        Called with the stage and how many samples of how many it has gone over.
    gravity, effort : as in `Settings`, for the named checks

    Raises
    ------
    LogError
        If torques of two logs come from one file: they were not recorded at once.
    """

    def __init__(
        self,
        logs: Sequence[Recording],
        progress: Progress | None = None,
        gravity: float = 9.81,
        effort: str | None = None,
    ) -> None:
        owners: dict[str, str] = {}
        for log in logs:
            file = log.origin.reading.torque_file
            owner = log.name if file is None else owners.setdefault(file, log.name)
            if owner != log.name:
                raise LogError(
                    f"{log.name}: its torques would come from {file}, as those of {owner} do; put "
                    "each log and its torques into a folder of their own, under the same names"
                )
        self.logs = tuple(logs)
        self.progress = progress
        self._gravity, self._effort = gravity, effort
        self._known: dict[Role, Saturation] = {}
        self._room = MOST_KEPT
        self._stage, self._over = "fitting", self.logs
        self._done: dict[Recording, int] = {}

    @property
    def unloaded(self) -> list[Recording]:
        """The logs of the arm without payload."""
        return [log for log in self.logs if log.role == "unloaded"]

    @property
    def loaded(self) -> list[Recording]:
        """The logs of the arm with its payload."""
        return [log for log in self.logs if log.role == "loaded"]

    @property
    def accepted(self) -> set[str]:
        """Codes of what the user says is right in some log."""
        return {code for log in self.logs for code in log.origin.reading.accepted}

    def _weight(self, log: Recording) -> float:
        """Gravity in m/s² in a log's torque; no driver compensates for that of a payload."""
        if self._effort in ("gravity-compensated", "external") and log.role == "unloaded":
            return 0.0
        return self._gravity

    def begin(self, stage: str, logs: Sequence[Recording] | None = None) -> None:
        """The passes from here on are over `logs`, by default all, and of that stage."""
        self._stage = stage
        self._over = self.logs if logs is None else tuple(logs)

    def count_once(self) -> None:
        """Leave out each log whose samples another one of its role has too, with a notice of that.

        A log that has some of another's has a notice alone. Of one of more than `MOST_KEPT` samples
        the first block is looked at.
        """
        from algid.estimators.repeats import shared_samples

        if len(self.logs) < 2:
            return
        for log in self.logs:
            if log.promised <= self._room:
                for _ in self.segments(log):
                    pass
        shares = shared_samples([self._samples(log) for log in self.logs])
        np.fill_diagonal(shares, 0.0)
        kept: list[int] = []
        copies: dict[int, list[str]] = {}
        # the longest first, which hold the others
        for own in sorted(range(len(self.logs)), key=lambda place: -(self.logs[place].rows or 0)):
            log = self.logs[own]
            twin = max(kept, key=lambda other: shares[own, other], default=own)
            share, other = shares[own, twin], self.logs[twin]
            if share > _WHOLE and log.role == other.role:
                copies.setdefault(twin, []).append(log.name)
                continue
            if share > 0:
                case = "part" if log.role == other.role else "loaded"
                numbers = {"name": log.name, "twin": other.name, "share": 100 * share}
                other.notices += (Notice("SAME_LOG", numbers={"case": case, **numbers}),)
            kept.append(own)
        for twin, names in copies.items():
            twice = Notice("SAME_LOG", numbers={"case": "twice", "names": names})
            self.logs[twin].notices += (twice,)
        self.logs = tuple(self.logs[place] for place in sorted(kept))

    @staticmethod
    def _samples(log: Recording) -> FloatArray:
        """Angles and torques (4, N) of a log, or of its first block."""
        parts = log.kept or [block.part(0, EXAMINED) for block in islice(log.blocks(), 1)]
        return np.concatenate([np.concatenate([one.theta, one.tau]) for one in parts], axis=1)

    def segments(self, log: Recording) -> Iterator[Segment]:
        """A fresh pass over a log: its uniform segments, from its start.

        Without samples whose torque a limit cuts off.

        Raises `LogError` where it is refused.
        """
        from algid.estimators.saturation import sound

        rows = 0
        if log.kept is not None:
            self._report(log, 0)
            for piece in log.kept:
                yield piece
                rows += len(piece)
                self._report(log, rows)
            return
        uniform = segments(self._blocks(log))
        first = list(islice(uniform, 1))  # which the limits are known after
        held: list[Segment] = []
        for piece in sound(chain(first, uniform), log.limits or ()):
            rows += len(piece)
            if rows <= self._room:
                held.append(piece)
            else:
                held.clear()
            yield piece
        if rows <= self._room and log.kept is None:
            log.kept = tuple(held)
            self._room -= rows

    def with_velocities(self, log: Recording, settings: Settings) -> Iterator[Segment]:
        """The segments with velocities: measured, or by the paper's observer.

        Raises
        ------
        LogError
            If measured velocities are asked for and the log has none.
        """
        if settings.velocity != "measured":
            yield from observed(self.segments(log), settings.poles or PAPER_POLES)
            return
        for segment in self.segments(log):
            if segment.omega is None:
                raise LogError(
                    f"{log.name}: expected velocities omega1, omega2 for {flag('velocity')}="
                    f"measured, found none; they are observed by {flag('velocity')}=observer"
                )
            yield segment

    def whole(self, log: Recording) -> Recording:
        """The log, gone over to its end."""
        if log.rows is None:
            for _ in self._blocks(log):
                pass
        return log

    def noticed(self, *, doubtful: bool = True) -> list[tuple[Notice, ...]]:
        """What was noticed in each log.

        Of several logs of a role the conventions are judged together, and only where what they
        come to is `doubtful`: a fit that holds and obeys physics has no other convention.
        """
        from algid.inspection.conventions import mends

        noticed = {log: self.whole(log).notices for log in self.logs}
        for logs in (self.unloaded, self.loaded) if doubtful else ():
            known = {one: (one.origin, one.recorded) for one in logs if one.recorded is not None}
            if not known:
                continue
            found = mends(list(known.values()), gravity=self._weight(logs[0]) > 0)
            for log, convention in zip(known, found, strict=True):
                if convention is not None:  # what is of gravity is less precise
                    of_gravity = ("FLIPPED_SIGN", "WRONG_ZERO", "GRAVITY_COMPENSATED")
                    kept = (one for one in noticed[log] if one.code not in of_gravity)
                    noticed[log] = (*kept, convention)
        return list(noticed.values())

    def summary(self, log: Recording) -> LogSummary:
        """The log as a result names it."""
        rows = self.whole(log).rows or 0
        rate = 0.0
        if log.duration > 0:
            rate = (rows - 1) / log.duration
        return LogSummary(
            path=log.name,
            sha256=None if log.digest is None else log.digest(),
            role=log.role,
            format=log.origin.format,
            rows=rows,
            start_ns=log.first_ns,
            duration=log.duration,
            rate=rate,
            mapping=dict(log.origin.mapping),
            reading=log.origin.reading,
        )

    def _blocks(self, log: Recording) -> Iterator[Log]:
        """The log's blocks, each counted.

        The first is examined, and refuses a log only where that is all of it.
        """
        from algid.inspection.channels import beyond, clipped

        if log.limits is None and log.digest is not None and not 0 < log.promised <= SHORT:
            log.digest = beside(log.digest).result
        rows, last_ns, notices = 0, 0, list[Notice]()
        counts: Counter[Limit] = Counter()
        self._report(log, 0)
        blocks = _with_end(log)
        if log.begin is not None:
            blocks, log.begin = iter([(log.begin, True)]), None
        for block, alone in blocks:
            if len(block):
                if log.limits is None:
                    log.limits = self._examined(log, block, whole=alone)
                counts.update(beyond(block, log.limits))
                rows, last_ns = rows + len(block), int(block.stamp_ns[-1])
            notices += block.notices
            yield block
            self._report(log, rows)
        if log.rows is None:
            log.notices += (*notices, *clipped(log.origin, counts, rows))
            log.rows, log.last_ns = rows, last_ns

    def _examined(self, log: Recording, block: Log, *, whole: bool) -> tuple[Limit, ...]:
        """The limits of a log's torques; what the named checks find in its first block is noted.

        Raises
        ------
        LogError
            If a check refuses the log.
        """
        from algid.inspection.checks import CONTRADICTIONS, admitted, examine
        from algid.inspection.conventions import judged

        log.first_ns = int(block.stamp_ns[0])
        begin = block if whole else block.part(0, EXAMINED)
        alike = self.loaded if log.role == "loaded" else self.unloaded
        if log.role not in self._known:
            self._judge_arm(log, begin, alike)
        found = examine(
            begin,
            cache(partial(judged, begin, gravity=self._weight(log) > 0)),
            effort=self._effort,
            whole=whole,
            alone=len(alike) == 1,
            known=self._known[log.role],
        )
        log.notices += admitted(begin, found)
        if len(alike) == 1 and has_code(found, *CONTRADICTIONS):
            return ()  # of an arm that is not this one
        return self._known[log.role].limits

    def _judge_arm(self, log: Recording, begin: Log, alike: Sequence[Recording]) -> None:
        """Find the limits of torques of logs `alike`, and keep what conventions ask for."""
        from algid.estimators.convention_search import MOST_LOGS, seconds_of_each
        from algid.inspection.channels import saturation
        from algid.inspection.conventions import recorded

        begins = {log: begin}
        for other in evenly_spread(alike, MOST_LOGS):
            if other is not log:
                for block, alone in islice(_with_end(other), 1):
                    other.begin = block if alone else None  # so that it is not read again
                    begins[other] = block if alone else block.part(0, EXAMINED)
        known = saturation(*begins.values(), gravity=self._weight(log), effort=self._effort)
        self._known[log.role] = known
        if len(alike) > 1 and self._effort != "external":
            for one, samples in begins.items():
                one.recorded = recorded(samples, seconds_of_each(len(alike)))

    def _report(self, log: Recording, rows: int) -> None:
        """A pass over `log` has come as far as `rows` samples; 0 starts one.

        The first over a log reads it.
        """
        if self.progress is None:
            return
        if rows == 0 and log in self._done:
            self._done = {}
        self._done[log] = rows
        counts = [one.promised if one.rows is None else one.rows for one in self._over]
        # 0 where a log does not say how many samples it has
        stage = "reading" if log.rows is None else self._stage
        self.progress(stage, sum(self._done.values()), sum(counts) if all(counts) else 0)


def _with_end(log: Recording) -> Iterator[tuple[Log, bool]]:
    """Each block of a log, and whether it is the only one.

    Raises
    ------
    LogError
        If the first is not sampled as an arm is.
    """
    blocks = log.blocks()
    begin = list(islice(blocks, 2))
    if begin:
        check_step(begin[0].origin.path, begin[0].stamp_ns)
    alone = len(begin) == 1
    while begin:
        yield begin.pop(0), alone
    for block in blocks:
        yield block, False
