"""All checks of a log, and the whole look at one that `algid inspect` prints.

Channels, sampling, conventions; `messages.toml` says what each finds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from algid.base.errors import LogError
from algid.base.faults import during
from algid.estimators.convention_search import Judgement
from algid.estimators.saturation import UNSEEN, Saturation
from algid.inspection.channels import (
    angles,
    beyond,
    clipped,
    degrees,
    efforts,
    held,
    rests,
    sampling,
    saturation,
    spikes,
)
from algid.inspection.conventions import doubted, is_to_scale, judged, mend
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

CONTRADICTIONS = ("WRONG_CONVENTION", "FLIPPED_SIGN", "WRONG_ZERO")
"""Findings that say that a log was read by a wrong convention."""


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
        from pydantic_core import to_jsonable_python

        return dict(to_jsonable_python(self, inf_nan_mode="null"))


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
    origin = Origin(name, kind, {})
    try:
        if not isinstance(log, Log):
            reader = open_log(log, own)
            origin = reader.origin
            log = reader.whole()
    except LogError as error:
        return Inspection(name, kind, entries, str(error), origin.mapping, origin.reading)
    known = saturation(log, gravity=own.gravity, effort=own.effort)
    tried = cache(partial(judged, log, gravity=own.gravity > 0))
    findings = (
        *examine(log, tried, effort=own.effort, known=known),
        *clipped(log.origin, beyond(log, known.limits), len(log)),
    )
    reasons = [f"{one.code}: {one.clause}" for one in findings if one.refuse]
    every = channels(log, ("theta", "tau", "omega"))
    return Inspection(
        path=log.origin.path,
        format=kind,
        entries=entries,
        refused="; ".join(reasons) or None,
        mapping=log.origin.mapping,
        reading=log.origin.reading,
        synthetic=log.origin.truth is not None,
        clock=clock_figures(log),
        signals={name: signal_figures(values) for name, values in every},
        dynamics=dynamic_figures(None if own.effort == "external" else tried()),
        notices=log.notices,
        findings=findings,
    )


def examine(
    log: Log,
    tried: Callable[[], Judgement | None],
    *,
    effort: str | None = None,
    whole: bool = True,
    alone: bool = True,
    known: Saturation = UNSEEN,
) -> tuple[Notice, ...]:
    """Everything that the checks find in a log.

    Conventions are not sought in one that a check refuses.

    Parameters
    ----------
    log : Log
    tried : callable
        Gives what all conventions say of the log; called only where a check asks for it.
    effort : str, as in a profile
        An external torque is zero where nothing pulls, and obeys no convention.
    whole : bool
        False where `log` is the beginning of a longer one.
    alone : bool
        False where the conventions of several logs are judged together: see `mends`.
    known : Saturation
        Limits of torques that the motion shows.

    Returns
    -------
    tuple of Notice
        None for a log of fewer than four samples.
    """
    if len(log) < 4:
        return ()
    is_external = effort == "external"
    found = [
        *(() if is_external else efforts(log, known)),
        *held(log, is_external),
        *angles(log),
        *degrees(log, lambda: is_to_scale(tried())),
        *spikes(log),
        *sampling(log),
        *rests(log, whole),
    ]
    if alone and not is_external and not any(one.refuse for one in found):
        wrong = mend(log.origin, tried()) or doubted(log.origin, tried())
        found += [wrong] if wrong else []
    if whole:
        return tuple(found)
    place = {"looked_at": round(log.duration)}
    return tuple(
        replace(one, refuse=False, text="", numbers={**one.numbers, **place}) for one in found
    )


def admitted(log: Log, found: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """What `examine` finds in a log that is used nevertheless.

    Raises
    ------
    LogError
        If a check forbids the use of the log.
    """
    for one in found:
        if one.refuse:
            raise LogError(f"{log.origin.path}: {one.code}: {one.clause}")
    return found
