"""What a file holds, by name: columns, or topics with their types; also of a file that cannot be used.

The whole look at a log that `algid inspect` prints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from algid.errors import LogError
from algid.faults import during
from algid.inspection.checks import examine
from algid.inspection.dynamics import DynamicFigures, dynamic_figures
from algid.inspection.figures import ClockFigures, SignalFigures, clock_figures, signal_figures
from algid.inspection.findings import Finding
from algid.log import Log, Notice
from algid.readers import read_log
from algid.readers.sniff import sniff


@dataclass(frozen=True)
class Entry:
    """A column or a topic: its name, its type, and how many samples it has where that is known.

    A topic's `joints` are those that its messages name, its `fields` paths of their numbers.
    """

    name: str
    type: str
    count: int | None = None
    joints: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()


_MOST_SHOWN = 64
T = TypeVar("T")


@dataclass(frozen=True)
class Look(Generic[T]):
    """A log that may be refused: its format and entries in any case, then what was read of it, or why not."""

    format: str
    entries: tuple[Entry, ...]
    found: T | None = None
    refused: str | None = None


def look(path: Path, read: Callable[[], T]) -> Look[T]:
    """What a log holds, and what `read` makes of it.

    Raises
    ------
    LogError
        As `contents`; what `read` raises stands in `refused`.
    """
    with during("opening", path):
        kind, entries = contents(path)
    try:
        return Look(kind, entries, found=read())
    except LogError as error:
        return Look(kind, entries, refused=str(error))


def contents(path: Path) -> tuple[str, tuple[Entry, ...]]:
    """Format and entries of a log.

    Raises
    ------
    LogError
        If there is no such log, or not even its list of entries can be read.
    """
    kind = sniff(path)
    if kind == "mcap":
        return kind, _mcap(path)
    if kind == "rosbag2":
        from algid.readers.bags.folder import bag_files

        bag = bag_files(path)
        return kind, _mcap(bag.paths[0]) if bag.kind == "mcap" else _bag(path, kind)
    if kind == "parquet":
        return kind, tuple(_parquet(path))
    if kind.startswith("csv"):
        return kind, tuple(_csv(path, kind))
    if kind == "feather":
        from algid.readers.feather import opened

        feather = opened(path)
        return kind, tuple(Entry(field.name, str(field.type)[:80], feather.rows) for field in feather.schema)
    if kind in ("npz", "npy", "mat"):
        from algid.readers.arrays import frame_of

        frame = frame_of(path, kind)
        return kind, tuple(Entry(name, str(dtype), frame.height) for name, dtype in frame.schema.items())
    return kind, _bag(path, kind)


def _bag(path: Path, kind: str) -> tuple[Entry, ...]:
    from algid.readers.bags import parts_of

    parts, _ = parts_of(path, kind)
    with parts[0]() as source:
        return tuple(_topics(source))


def _mcap(path: Path) -> tuple[Entry, ...]:
    from algid.readers.mcap import messages_in

    with messages_in(path) as source:
        return tuple(_topics(source))


def _topics(source: Source) -> Iterator[Entry]:
    from algid.readers.messages.plan import fields_shown

    for place, (number, channel) in enumerate(sorted(source.channels.items())):
        form = f"{channel.type or 'no schema'}, {channel.encoding}"
        count = None if source.counts is None else source.counts.get(number, 0)
        joints, fields = fields_shown(source, number) if place < _MOST_SHOWN else ((), ())
        yield Entry(channel.topic, form, count, joints[:_MOST_SHOWN], fields[:_MOST_SHOWN])


def _parquet(path: Path) -> Iterator[Entry]:
    from algid.readers.parquet import counted_rows, schema_of

    rows = _known(lambda: counted_rows(path))
    for name, kind in schema_of(path).items():
        yield Entry(name, str(kind), rows)


def _csv(path: Path, kind: str) -> Iterator[Entry]:
    from algid.readers.csv import counted_rows
    from algid.readers.dialect import detect, kinds
    from algid.readers.sniff import head_of

    head = head_of(path, kind)
    dialect = detect(path, head)
    rows = _known(lambda: counted_rows(path, kind, dialect))
    for name, dtype in kinds(path, head, dialect).items():
        yield Entry(name, dtype, rows)


def _known(count: Callable[[], int]) -> int | None:
    """What can be counted; None in a damaged file, of which reading will tell more."""
    try:
        return count()
    except LogError:
        return None


if TYPE_CHECKING:
    from algid.profile import Profile
    from algid.readers.messages.source import Source


@dataclass(frozen=True)
class Inspection:
    """What a log is and is worth; everything below `refused` is empty for a log that cannot be read."""

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
    findings: tuple[Finding, ...] = ()

    @property
    def lossy(self) -> bool:
        """Whether samples are missing."""
        return any(notice.lossy for notice in self.notices)

    def as_dict(self) -> dict[str, Any]:
        """As plain data for JSON; what is not finite becomes None."""
        plain: dict[str, Any] = _finite(asdict(self))
        return plain


def inspect_log(path: Path, profile: Profile | None = None) -> Inspection:
    """Look at a log without using it; a log that cannot be read gives what it holds, and the reason.

    Raises
    ------
    LogError
        If there is no such log, or its format is unknown.
    """
    seen = look(path, lambda: read_log(path, profile))
    if seen.found is None:
        return Inspection(str(path), seen.format, seen.entries, refused=seen.refused)
    log = seen.found
    gravity = profile.gravity if profile is not None else 9.81
    findings = examine(log, gravity=gravity)
    reasons = [f"{one.code}: {one.text}" for one in findings if one.refuse]
    return Inspection(
        path=str(path),
        format=seen.format,
        entries=seen.entries,
        refused="; ".join(reasons) or None,
        mapping=log.origin.mapping,
        synthetic=log.origin.truth is not None,
        clock=clock_figures(log),
        signals=_signals(log),
        dynamics=dynamic_figures(log),
        notices=log.notices,
        findings=findings,
    )


def _signals(log: Log) -> dict[str, SignalFigures]:
    found = {}
    pairs = [("theta", log.theta), ("tau", log.tau)]
    pairs += [("omega", log.omega)] if log.omega is not None else []
    for name, pair in pairs:
        for joint, values in enumerate(pair, start=1):
            found[f"{name}{joint}"] = signal_figures(values)
    return found


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
