"""What a file holds, by name: columns, or topics with their types.

Also of a file that cannot be used.

The whole look at a log that `algid inspect` prints.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import TypeAdapter

from algid.base.errors import LogError
from algid.base.faults import during
from algid.inspection.checks import CONTRADICTIONS, examine
from algid.inspection.clipping import clipped, saturation
from algid.inspection.dynamics import DynamicFigures, dynamic_figures
from algid.inspection.figures import ClockFigures, SignalFigures, clock_figures, signal_figures
from algid.log import Log
from algid.notices import Notice, has_code, lossy
from algid.readers import read_log
from algid.readers.formats import Entry, entries_at, entries_of, format_of
from algid.readers.memory import NAME, open_columns

T = TypeVar("T")


@dataclass(frozen=True)
class Look(Generic[T]):
    """A log that may be refused: its format and entries, then its content or the refusal."""

    format: str
    entries: tuple[Entry, ...]
    content: T | None = None
    refused: str | None = None


def look(log: Any, read: Callable[[], T]) -> Look[T]:
    """What a log holds, and what `read` makes of it.

    Raises
    ------
    LogError
        As `contents`; what `read` raises stands in `refused`.
    """
    with during("opening", _called(log)):
        kind, entries = contents(log)
    try:
        return Look(kind, entries, content=read())
    except LogError as error:
        return Look(kind, entries, refused=str(error))


def _called(log: Any) -> str:
    """A log's path, or what stands for one in memory."""
    if isinstance(log, str | Path):
        return str(log)
    return NAME


def contents(log: Any) -> tuple[str, tuple[Entry, ...]]:
    """Format and entries of a log.

    Raises
    ------
    LogError
        If there is no such log, or not even its list of entries can be read.
    """
    if isinstance(log, Log):
        return log.origin.format, ()
    if not isinstance(log, str | Path):
        table = open_columns(log)
        return table.kind, entries_of(table)
    return format_of(Path(log)).name, entries_at(Path(log))


if TYPE_CHECKING:
    from algid.profile import Profile


@dataclass(frozen=True)
class Inspection:
    """What a log is and is worth.

    Everything below `refused` is empty for a log that cannot be read.
    """

    path: str
    format: str
    entries: tuple[Entry, ...]
    refused: str | None = None
    mapping: dict[str, str] | None = None
    synthetic: bool = False
    clock: ClockFigures | None = None
    signals: dict[str, SignalFigures] | None = None
    dynamics: DynamicFigures | None = None
    notices: tuple[Notice, ...] = ()
    findings: tuple[Notice, ...] = ()

    def __repr__(self) -> str:
        if self.refused is not None:
            return f"Inspection({self.path!r}, refused: {self.refused:.160})"
        rows = 0 if self.clock is None else self.clock.rows
        codes = ", ".join(dict.fromkeys(one.code for one in (*self.notices, *self.findings)))
        return f"Inspection({self.path!r}, N = {rows:,}, found: {codes or 'nothing'})"

    @property
    def lossy(self) -> bool:
        """Whether samples are missing."""
        return lossy(self.notices)

    @property
    def contradicted(self) -> bool:
        """Whether physics contradicts how the log was read."""
        return has_code(self.findings, *CONTRADICTIONS)

    def as_dict(self) -> dict[str, Any]:
        """As plain data for JSON; what is not finite becomes None."""
        return dict(json.loads(TypeAdapter(Any).dump_json(asdict(self))))


def inspect_log(log: Any, profile: Profile | None = None) -> Inspection:
    """Look at a log, a path or one in memory, without using it.

    A log that cannot be read gives what it holds, and the reason.

    Raises
    ------
    LogError
        If there is no such log, or its format is unknown.
    """

    def samples() -> Log:
        if isinstance(log, Log):
            return log
        return read_log(log, profile)

    seen = look(log, samples)
    if seen.content is None:
        return Inspection(_called(log), seen.format, seen.entries, refused=seen.refused)
    path = _called(log)
    if isinstance(log, Log):
        path = log.origin.path
    gravity, effort = 9.81, None
    if profile is not None:
        gravity, effort = profile.gravity, profile.effort
    known = saturation(seen.content, gravity=gravity, effort=effort)
    findings = examine(seen.content, gravity=gravity, effort=effort, known=known)
    findings += tuple(clipped(seen.content, known.limits))
    reasons = [f"{one.code}: {one.clause}" for one in findings if one.refuse]
    return Inspection(
        path=path,
        format=seen.format,
        entries=seen.entries,
        refused="; ".join(reasons) or None,
        mapping=seen.content.origin.mapping,
        synthetic=seen.content.origin.truth is not None,
        clock=clock_figures(seen.content),
        signals=_signals(seen.content),
        dynamics=dynamic_figures(seen.content),
        notices=seen.content.notices,
        findings=findings,
    )


def _signals(log: Log) -> dict[str, SignalFigures]:
    signals = {}
    pairs = [("theta", log.theta), ("tau", log.tau)]
    if log.omega is not None:
        pairs.append(("omega", log.omega))
    for name, pair in pairs:
        for joint, values in enumerate(pair, start=1):
            signals[f"{name}{joint}"] = signal_figures(values)
    return signals
