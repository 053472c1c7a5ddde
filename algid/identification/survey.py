"""Passes over logs, one way for all estimators, and what the first of them shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import TYPE_CHECKING

from algid.base.names import evenly_spread
from algid.base.progress import Progress
from algid.base.runtime import Beside
from algid.identification.source import LogSource, refuse_shared_torques
from algid.log import Log
from algid.notices import Notice
from algid.results import LogSummary
from algid.signals.segments import Segment, segments

if TYPE_CHECKING:
    from algid.estimators.convention_search import Recorded
    from algid.estimators.saturation import Limit

EXAMINED = 1 << 15
"""Samples at the start of a long log that the named checks look at."""
MOST_KEPT = 1 << 20
"""Samples of all logs together that stay in memory, 48 bytes each, so that they are read once."""


@dataclass(frozen=True)
class Seen:
    """Findings of a pass over a whole log: samples, first and last stamp in ns, and notices."""

    rows: int
    first_ns: int
    last_ns: int
    notices: tuple[Notice, ...]


class Survey:
    """Goes over logs as often as an estimator asks, and keeps what the first pass over each shows.

    Hashing and the named checks run beside the first pass; whoever wants to know how far a pass
    has come is called. Logs of `MOST_KEPT` samples in all are read once and kept; longer ones are
    read again for each pass.

    Parameters
    ----------
    logs : the logs, unloaded ones first
    progress : callable
        Called with the stage and how many samples of how many it has gone over.
    """

    def __init__(self, logs: Sequence[LogSource], progress: Progress | None = None) -> None:
        refuse_shared_torques(logs)
        self.logs = tuple(logs)
        self.progress = progress
        self._seen: dict[LogSource, Seen] = {}
        self._findings: dict[LogSource, tuple[Notice, ...]] = {}
        self._recorded: dict[LogSource, list[Recorded]] = {}
        self._limits: dict[LogSource, tuple[Limit, ...]] = {}
        self._conventions: dict[LogSource, Notice] | None = None
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
        self._stage, self._words = stage, ""
        self._over = self.logs
        if logs is not None:
            self._over = tuple(logs)

    def segments(self, log: LogSource) -> Iterator[Segment]:
        """A fresh pass over a log: its uniform segments, from its start.

        Without samples whose torque a limit cuts off.

        Raises `LogError` where it is refused.
        """
        rows = 0
        if log in self._kept:
            self._report(log, 0)
            for piece in self._kept[log]:
                yield piece
                rows += len(piece)
                self._report(log, rows)
            return
        held: list[Segment] = []
        for piece in self._sound(log):
            rows += len(piece)
            if rows <= self._room:
                held.append(piece)
            else:
                held.clear()
            yield piece
        if rows <= self._room and log not in self._kept:
            self._kept[log] = tuple(held)
            self._room -= rows

    def _sound(self, log: LogSource) -> Iterator[Segment]:
        """The segments of a pass, without what a limit cuts off, which the first block shows."""
        from algid.estimators.saturation import sound

        passing = segments(self._counted(log))
        first = next(passing, None)
        if first is not None:
            yield from sound(chain([first], passing), self._limits.get(log, ()))

    def seen(self, log: LogSource) -> Seen:
        """What the log holds; goes over it where no estimator has done so to its end."""
        if log not in self._seen:
            for _ in self._counted(log):
                pass
        return self._seen[log]

    def notices(self, log: LogSource) -> tuple[Notice, ...]:
        """What was noticed in a log.

        Of several logs of a kind the conventions are judged together.
        """
        seen = self.seen(log).notices
        if self._conventions is None:
            self._conventions = {}
            for kind in (self.unloaded, self.loaded):
                self._conventions |= self._judged(kind)
        convention = self._conventions.get(log)
        if convention is None:
            return seen
        # what is less precise than the convention
        of_gravity = ("FLIPPED_SIGN", "WRONG_ZERO", "GRAVITY_COMPENSATED")
        return tuple(one for one in seen if one.code not in of_gravity) + (convention,)

    def _judged(self, logs: Sequence[LogSource]) -> dict[LogSource, Notice]:
        """What is wrong with the conventions of each of several logs."""
        from algid.inspection.conventions import mends

        for log in logs:
            self.seen(log)
        known = [(log, self._recorded.pop(log)) for log in logs if log in self._recorded]
        if not known:
            return {}
        gravity = _weight(known[0][0]) > 0
        wrong = {}
        for (log, _), mend in zip(known, mends(known, gravity=gravity), strict=True):
            if mend is not None:
                wrong[log] = mend.notice
        return wrong

    def _checked(self, log: LogSource, begin: Log, *, whole: bool) -> tuple[Notice, ...]:
        """What the named checks find at the `begin` of a log."""
        from algid.estimators.convention_search import MOST_LOGS, seconds_of_each
        from algid.inspection.checks import noticed
        from algid.inspection.clipping import saturation
        from algid.inspection.conventions import recorded
        from algid.inspection.findings import CONTRADICTIONS

        alike = [one for one in self.logs if one.role == log.role]
        gravity, alone = _weight(log), len(alike) == 1
        known = saturation(begin, gravity=gravity, effort=log.effort)
        self._limits[log] = known.limits
        notices = noticed(
            begin, gravity=gravity, effort=log.effort, whole=whole, alone=alone, known=known
        )
        if alone:
            if any(one.code in CONTRADICTIONS for one in notices):
                self._limits[log] = ()  # of an arm that is not this one
            return notices
        if log.effort != "external" and log in evenly_spread(alike, MOST_LOGS):
            self._recorded[log] = recorded(begin, seconds_of_each(len(alike)))
        return notices

    def summary(self, log: LogSource) -> LogSummary:
        """The log as a result names it."""
        seen = self.seen(log)
        duration = (seen.last_ns - seen.first_ns) * 1e-9
        rate, digest = 0.0, None
        if duration > 0:
            rate = (seen.rows - 1) / duration
        if log in self._digests:
            digest = self._digests[log].result()
        return LogSummary(
            path=log.name,
            sha256=digest,
            role=log.role,
            format=log.origin.format,
            rows=seen.rows,
            start_ns=seen.first_ns,
            duration=duration,
            rate=rate,
            mapping=dict(log.origin.mapping),
            reading=log.origin.reading,
        )

    def _counted(self, log: LogSource) -> Iterator[Log]:
        """The log's blocks, each counted.

        The first is examined, and refuses a log only where that is all of it.
        """
        from algid.inspection.clipping import Counted

        if log.digest is not None and log not in self._digests:
            self._digests[log] = Beside(log.digest)
        rows, first_ns, last_ns = 0, 0, 0
        notices: list[Notice] = list(log.notices)
        counted: Counted | None = None
        self._report(log, 0)
        for block, alone in _with_end(log.blocks(), log.promised):
            if len(block) and not rows:
                first_ns = int(block.stamp_ns[0])
                if log not in self._findings:
                    begin = block
                    if not alone:
                        begin = block.part(0, EXAMINED)
                    self._findings[log] = self._checked(log, begin, whole=alone)
                notices += self._findings[log]
                counted = Counted(self._limits.get(log, ()))
            if counted is not None:
                counted.add(block)
            if len(block):
                last_ns = int(block.stamp_ns[-1])
            rows += len(block)
            notices += block.notices
            yield block
            self._report(log, rows)
        if counted is not None:
            notices += counted.notices(log.origin)
        self._seen.setdefault(log, Seen(rows, first_ns, last_ns, tuple(notices)))

    def _report(self, log: LogSource, rows: int) -> None:
        """A pass over `log` has come as far as `rows` samples; 0 starts one.

        The first over a log reads it.
        """
        if self.progress is None:
            return
        words = "reading"
        if log in self._seen:
            words = self._stage
        if words != self._words or (rows == 0 and log in self._done):
            self._words, self._done = words, {}
        self._done[log] = rows
        self.progress(words, sum(self._done.values()), self._expected())

    def _expected(self) -> int:
        """Samples of the logs that the passes are over; 0 where one does not say how many."""
        expected = 0
        for log in self._over:
            rows = log.promised
            if log in self._seen:
                rows = self._seen[log].rows
            if not rows:
                return 0
            expected += rows
        return expected


def _weight(log: LogSource) -> float:
    """Gravity in m/s² in the log's torque; no driver compensates for that of a payload."""
    weightless = log.effort in ("gravity-compensated", "external") and log.role == "unloaded"
    if weightless:
        return 0.0
    return log.gravity


def _with_end(blocks: Iterator[Log], promised: int) -> Iterator[tuple[Log, bool]]:
    """Each block, and whether it is the only one.

    Where more than twice its samples are promised it is not, and need not wait for the second one:
    a reader refuses a log of which it would have to drop half.
    """
    for first in islice(blocks, 1):
        if promised > 2 * len(first):
            yield first, False
        else:
            waited = list(islice(blocks, 1))
            yield first, not waited
            blocks = chain(waited, blocks)
        for block in blocks:
            yield block, False
