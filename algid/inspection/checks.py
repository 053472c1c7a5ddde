"""All checks of `algid.inspection.findings` on a log: channels, sampling, then convention."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

from algid.errors import LogError
from algid.estimators.saturation import Saturation
from algid.inspection.channels import (
    angles,
    dead_efforts,
    degrees,
    efforts,
    held_efforts,
    spikes,
)
from algid.inspection.clipping import saturation
from algid.inspection.conventions import advised, is_right, judged, mend
from algid.inspection.dynamics import dynamic_figures, gravity_findings
from algid.inspection.findings import yielding
from algid.inspection.sampling import rests, sampling
from algid.log import Log
from algid.notices import Notice


def examine(
    log: Log,
    *,
    gravity: float = 9.81,
    effort: str | None = None,
    whole: bool = True,
    alone: bool = True,
    known: Saturation | None = None,
) -> tuple[Notice, ...]:
    """Everything that the checks find in a log.

    Conventions are not sought in one that a check refuses.

    Parameters
    ----------
    log : Log
    gravity : float, m/s^2
        0 for an arm in a horizontal plane.
    effort : str, as in a profile
        An external torque is nothing where nothing pulls, and tells no convention.
    whole : bool
        False where `log` is the beginning of a longer one.
    alone : bool
        False where the conventions of several logs are judged together: see `mends`.
    known : Saturation
        What motion tells of the limits of torques, where that is known already.

    Returns
    -------
    tuple of Notice
        None for a log of fewer than four samples.
    """
    if len(log) < 4:
        return ()
    tried = cache(partial(judged, log, gravity=gravity > 0))
    external = effort == "external"
    known = saturation(log, gravity=gravity, effort=effort) if known is None else known
    every = (
        *(() if external else efforts(log, known)),
        *(() if external else dead_efforts(log)),
        *held_efforts(log),
        *angles(log),
        *degrees(log, lambda: is_right(tried())),
        *spikes(log),
        *sampling(log),
        *rests(log, whole),
    )
    found = [yielding(notice, log.origin.reading.accepted) for notice in every]
    if external or any(finding.refuse for finding in found):
        return tuple(found)
    mended = mend(log, tried()) if alone else None
    if mended is not None:
        found.append(mended.notice)
    elif gravity > 0 and (figures := dynamic_figures(log)) is not None:
        suspicion = gravity_findings(figures)
        found += [] if suspicion is None else [advised(log, suspicion)]
    return tuple(found)


def noticed(
    log: Log,
    *,
    gravity: float = 9.81,
    effort: str | None = None,
    whole: bool = True,
    alone: bool = True,
    known: Saturation | None = None,
) -> tuple[Notice, ...]:
    """What `examine` finds, as notices.

    Raises
    ------
    LogError
        If a check forbids the use of a log that is all there.
    """
    findings = examine(log, gravity=gravity, effort=effort, whole=whole, alone=alone, known=known)
    refused = next((finding for finding in findings if finding.refuse), None)
    if refused is not None and whole:
        raise LogError(f"{log.origin.path}: {refused.code}: {refused.clause}")
    looked_at = 0 if whole else round(log.duration)
    return tuple(
        replace(one, text="", numbers={**one.numbers, "looked_at": looked_at}, refuse=False)
        if looked_at
        else replace(one, refuse=False)
        for one in findings
    )
