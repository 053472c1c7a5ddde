"""The whole look at a log that `algid inspect` prints, also at one that cannot be used."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter

from algid.base.errors import LogError
from algid.base.faults import during
from algid.inspection.checks import CONTRADICTIONS, examine
from algid.inspection.clipping import beyond, clipped, saturation
from algid.inspection.conventions import judged
from algid.inspection.figures import (
    ClockFigures,
    DynamicFigures,
    SignalFigures,
    channels,
    clock_figures,
    dynamic_figures,
    signal_figures,
)
from algid.log import Log, Origin, Reading
from algid.notices import Notice, codes_of, has_code, lossy
from algid.readers import open_log
from algid.readers.formats import Entry, entries_at, entries_of, format_of
from algid.readers.memory import NAME, open_columns

if TYPE_CHECKING:
    from algid.profile import Profile


@dataclass(frozen=True)
class Inspection:
    """What a log is and is worth.

    `mapping` and `reading` are empty for a log that cannot be opened, what stands below them for
    one that cannot be read.
    """

    path: str
    format: str
    entries: tuple[Entry, ...]
    refused: str | None = None
    mapping: dict[str, str] | None = None
    reading: Reading = field(default_factory=Reading)
    synthetic: bool = False
    clock: ClockFigures | None = None
    signals: dict[str, SignalFigures] | None = None
    dynamics: DynamicFigures | None = None
    notices: tuple[Notice, ...] = ()
    findings: tuple[Notice, ...] = ()

    def __repr__(self) -> str:
        codes = ", ".join(codes_of((*self.notices, *self.findings)))
        return f"Inspection({self.path!r}, {self.refused or codes or 'nothing found'})"

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
    from algid.profile import Profile

    own = profile or Profile()
    name = str(log) if isinstance(log, str | Path) else NAME
    with during("opening", name):
        if isinstance(log, str | Path):
            kind, entries = format_of(Path(log)).name, entries_at(Path(log))
        elif isinstance(log, Log):
            kind, entries = log.origin.format, ()
        else:
            table = open_columns(log)
            kind, entries = table.kind, entries_of(table)
    content, origin = log, Origin(name, kind, {})
    try:
        if not isinstance(log, Log):
            reader = open_log(log, own)
            origin = reader.origin
            content = reader.whole()
    except LogError as error:
        return Inspection(name, kind, entries, str(error), origin.mapping, origin.reading)
    asked: dict[str, Any] = {"gravity": own.gravity, "effort": own.effort}
    known = saturation(content, **asked)
    tried = cache(partial(judged, content, gravity=own.gravity > 0))
    findings = examine(content, **asked, known=known, tried=tried)
    counts = beyond(content, known.limits)
    findings += tuple(clipped(content.origin, known.limits, counts, len(content)))
    reasons = [f"{one.code}: {one.clause}" for one in findings if one.refuse]
    every = channels(content, ("theta", "tau", "omega"))
    return Inspection(
        path=content.origin.path,
        format=kind,
        entries=entries,
        refused="; ".join(reasons) or None,
        mapping=content.origin.mapping,
        reading=content.origin.reading,
        synthetic=content.origin.truth is not None,
        clock=clock_figures(content),
        signals={name: signal_figures(values) for name, values in every},
        dynamics=dynamic_figures(None if own.effort == "external" else tried()),
        notices=content.notices,
        findings=findings,
    )
