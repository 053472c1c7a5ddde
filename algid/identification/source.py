"""Logs to identify from, each read as often as an estimator asks.

How far passes over logs have come: an estimator goes over each log as often as it needs to.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from algid.errors import LogError
from algid.log import Log, Notice, Origin
from algid.progress import Told
from algid.results import LogSummary
from algid.runtime import Beside, ahead
from algid.signals.segments import Segment, segments

if TYPE_CHECKING:
    from algid.estimators.prediction import PredictionSums
    from algid.profile import Profile

Role = Literal["unloaded", "loaded"]
EXAMINED = 1 << 16
"""Samples at the start of a long log that the named checks look at."""


@dataclass(frozen=True)
class Staged:
    """A log that was fetched from an object store: its copy on this machine, and its URL.

    A copy that is not `whole` holds what the reader needs, and zeros elsewhere: the log's hash is not known then.
    """

    path: Path
    url: str
    whole: bool = True


LogLike = str | Path | Log | Staged


@dataclass
class _Seen:
    """What a full pass over a log has shown."""

    rows: int = 0
    first_ns: int = 0
    last_ns: int = 0
    notices: list[Notice] = field(default_factory=list)


class LogSource:
    """One log, from a file or from memory; `segments` gives a fresh pass over it.

    A log whose payload may be `changing` is refused for no payload that its metadata name.
    """

    def __init__(
        self, log: LogLike, role: Role, profile: Profile | None = None, gravity: float = 9.81, *, changing: bool = False
    ) -> None:
        self.role = role
        self.name = log.origin.path if isinstance(log, Log) else log.url if isinstance(log, Staged) else str(log)
        self._log = log.path if isinstance(log, Staged) else log
        self._whole = not isinstance(log, Staged) or log.whole
        self._profile = profile
        self._gravity = gravity
        self._found: list[Notice] | None = None
        self._digest: Beside[str] | None = None
        self.prediction: PredictionSums | None = None
        """What scores a prediction of this log, where an estimator's pass has gathered it."""
        self.passes: Passes | None = None
        """Who is told how far each pass has come."""
        self._promised = 0
        self.origin, self._blocks = self._open()
        self._seen: _Seen | None = None
        if not changing:
            self._refuse_the_other_role()

    def _open(self) -> tuple[Origin, Callable[[], Iterator[Log]]]:
        if isinstance(self._log, Log):
            log = self._log
            self._promised = len(log)
            return log.origin, lambda: iter([log])
        from algid.readers import open_log

        reader = open_log(self._log, self._profile)
        self._promised = reader.rows
        return reader.origin, lambda: ahead(reader.blocks())

    def _refuse_the_other_role(self) -> None:
        truth = self.origin.truth
        if truth is not None and truth.schedule:
            raise LogError(f"{self.name}: its metadata say that the payload changes; weigh it with algid track")
        if truth is None or (truth.payload > 0) == (self.role == "loaded"):
            return
        found = f"a payload of {truth.payload:g} kg" if truth.payload > 0 else "no payload"
        raise LogError(f"{self.name}: expected a log of the {self.role} arm, its metadata say {found}; swap the logs")

    def segments(self) -> Iterator[Segment]:
        """Uniform stretches of the log, from its start."""
        return segments(self._counted())

    def _counted(self) -> Iterator[Log]:
        seen = _Seen()
        self._start_hashing()
        self._tell(seen)
        for block, alone in _with_end(self._blocks(), self._promised):
            if len(block) and not seen.rows:
                seen.first_ns = int(block.stamp_ns[0])
                seen.notices += self._examined(block, alone)
            if len(block):
                seen.last_ns = int(block.stamp_ns[-1])
            seen.rows += len(block)
            seen.notices += block.notices
            yield block
            self._tell(seen)
        self._seen = seen

    def _tell(self, seen: _Seen) -> None:
        if self.passes is not None:
            self.passes.advance(self, seen.rows)

    @property
    def was_read(self) -> bool:
        """Whether a pass has come to the end of the log."""
        return self._seen is not None

    @property
    def expected(self) -> int:
        """Samples of a pass: counted where one has been made, else as the file tells, 0 where it does not."""
        return self._promised if self._seen is None else self._seen.rows

    def _examined(self, block: Log, alone: bool) -> list[Notice]:
        """What the named checks find in the first block; they refuse a log only where that is all of it."""
        if self._found is None:
            from algid.inspection.checks import examine

            block = block if alone else block.part(0, EXAMINED)
            findings = examine(block, gravity=self._gravity)
            refused = next((finding for finding in findings if finding.refuse), None)
            if refused is not None and alone:
                raise LogError(f"{self.name}: {refused.code}: {refused.text}")
            place = "" if alone else f" (in its first {block.duration:.0f} s)"
            self._found = [Notice(finding.code, f"{finding.code}: {finding.text}{place}") for finding in findings]
        return self._found

    @property
    def seen(self) -> _Seen:
        """What the log holds; reads it where no estimator has done so to its end."""
        if self._seen is None:
            for _ in self._counted():
                pass
        assert self._seen is not None
        return self._seen

    @property
    def notices(self) -> list[Notice]:
        """What the reader noticed."""
        return self.seen.notices

    @property
    def start_ns(self) -> int:
        """First stamp in ns."""
        return self.seen.first_ns

    @cached_property
    def sha256(self) -> str | None:
        """Of the file, of a folder's files in the order of their names, or of a log in memory; None of parts."""
        digest = self._start_hashing()
        return None if digest is None else digest.result()

    def _start_hashing(self) -> Beside[str] | None:
        """Hash the log beside the first pass over it."""
        if self._digest is None and self._whole:
            self._digest = Beside(self._hash)
        return self._digest

    def _hash(self) -> str:
        if isinstance(self._log, Log):
            digest = hashlib.sha256()
            for array in (self._log.stamp_ns, *self._log.theta, *self._log.tau):
                digest.update(array.tobytes())
            return digest.hexdigest()
        return sha256_of(Path(self._log))

    def summary(self) -> LogSummary:
        """For the result."""
        seen = self.seen
        duration = (seen.last_ns - seen.first_ns) * 1e-9
        return LogSummary(
            path=self.name,
            sha256=self.sha256,
            role=self.role,
            format=self.origin.format,
            rows=seen.rows,
            start_ns=seen.first_ns,
            duration=duration,
            rate=(seen.rows - 1) / duration if duration > 0 else 0.0,
            mapping=dict(self.origin.mapping),
        )


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


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files in the order of their names."""
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        if file.is_file():
            with file.open("rb") as opened:
                while chunk := opened.read(1 << 20):
                    digest.update(chunk)
    return digest.hexdigest()


def sources_of(
    logs: LogLike | Iterable[LogLike] | None, role: Role, profile: Profile | None, gravity: float
) -> list[LogSource]:
    """Sources of one log, several, or none."""
    if logs is None:
        return []
    several = [logs] if isinstance(logs, str | Path | Log | Staged) else list(logs)
    return [LogSource(log, role, profile, gravity) for log in several]


if TYPE_CHECKING:
    from algid.identification.source import LogSource


class Passes:
    """Tells of the passes over `logs`; without `told` it lets the logs be."""

    def __init__(self, told: Told | None, logs: Sequence[LogSource]) -> None:
        self.told = told
        self._stage, self._logs = "fitting", logs
        self._words = ""
        self._done: dict[int, int] = {}
        if told is not None:
            for log in logs:
                log.passes = self

    def begin(self, stage: str, logs: Sequence[LogSource]) -> None:
        """The passes from here on are over `logs`, and of that stage."""
        self._stage, self._logs, self._words = stage, logs, ""

    def advance(self, log: LogSource, rows: int) -> None:
        """A pass over `log` has come as far as `rows` samples; 0 starts one. The first over a log reads it."""
        words = self._stage if log.was_read else "reading"
        if words != self._words or (rows == 0 and id(log) in self._done):
            self._words, self._done = words, {}
        self._done[id(log)] = rows
        expected = [log.expected for log in self._logs]
        if self.told is not None:
            self.told(words, sum(self._done.values()), sum(expected) if all(expected) else 0)
