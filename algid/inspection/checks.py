"""All checks of `algid.inspection.findings` on a log: channels, sampling, then what physics says of its convention."""

from __future__ import annotations

import shlex
from functools import cache, partial

from algid.errors import LogError
from algid.inspection.channels import angles, dead_efforts, degrees, efforts, spikes
from algid.inspection.conventions import is_right, judged, mend
from algid.inspection.dynamics import dynamic_figures, gravity_findings
from algid.inspection.findings import Finding
from algid.inspection.sampling import rests, sampling
from algid.log import Log, Notice


def examine(log: Log, *, gravity: float = 9.81, whole: bool = True) -> tuple[Finding, ...]:
    """Everything that the checks find in a log; conventions are not sought in one that a check refuses.

    Parameters
    ----------
    log : Log
    gravity : float, m/s^2
        0 for an arm in a horizontal plane.
    whole : bool
        False where `log` is the beginning of a longer one.

    Returns
    -------
    tuple of Finding
        None for a log of fewer than four samples.
    """
    if len(log) < 4:
        return ()
    tried = cache(partial(judged, log, gravity=gravity > 0))
    every = (
        *efforts(log),
        *dead_efforts(log),
        *angles(log),
        *degrees(log, lambda: is_right(tried())),
        *spikes(log),
        *sampling(log),
        *rests(log, whole),
    )
    found = [finding.yielding(log.origin.reading.accepted) for finding in every]
    if any(finding.refuse for finding in found):
        return tuple(found)
    mended = mend(log, tried())
    if mended is not None:
        advice = f"use {' '.join(map(shlex.quote, mended.flags))} (profile: {mended.lines})"
        if mended.another:
            text = f"{mended.words}, by all that physics says ({mended.contradiction}); {advice}"
            found.append(Finding("WRONG_CONVENTION", text, flags=mended.flags))
        else:
            found.append(Finding("ZERO_OFFSET", f"{mended.words}; {advice}", flags=mended.flags))
    elif gravity > 0 and (figures := dynamic_figures(log)) is not None:
        found += gravity_findings(figures)
    return tuple(found)


def noticed(log: Log, *, gravity: float = 9.81, whole: bool = True) -> tuple[Notice, ...]:
    """What `examine` finds, as notices.

    Raises
    ------
    LogError
        If a check forbids the use of a log that is all there.
    """
    findings = examine(log, gravity=gravity, whole=whole)
    refused = next((finding for finding in findings if finding.refuse), None)
    if refused is not None and whole:
        raise LogError(f"{log.origin.path}: {refused.code}: {refused.text}")
    place = "" if whole else f" (in its first {log.duration:.0f} s)"
    return tuple(Notice(one.code, f"{one.code}: {one.text}{place}", flags=one.flags, note=one.note) for one in findings)
