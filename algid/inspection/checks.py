"""All checks of a log: channels, sampling, conventions; `messages.toml` says what each finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

from algid.base.errors import LogError
from algid.estimators.convention_search import Judgement
from algid.estimators.saturation import UNSEEN, Saturation
from algid.inspection.channels import angles, degrees, efforts, held_efforts, spikes, stuck
from algid.inspection.conventions import doubted, is_to_scale, judged, mend
from algid.inspection.sampling import rests, sampling
from algid.log import Log
from algid.notices import Notice, nevertheless

CONTRADICTIONS = ("WRONG_CONVENTION", "FLIPPED_SIGN", "WRONG_ZERO")
"""Findings that say that a log was read by a wrong convention."""


def examine(
    log: Log,
    *,
    gravity: float = 9.81,
    effort: str | None = None,
    whole: bool = True,
    alone: bool = True,
    known: Saturation = UNSEEN,
    tried: Callable[[], Judgement | None] | None = None,
) -> tuple[Notice, ...]:
    """Everything that the checks find in a log.

    Conventions are not sought in one that a check refuses. A refusal names what overrides it, and
    warns where that is accepted, or where the log goes on.

    Parameters
    ----------
    log : Log
    gravity : float, m/s^2
        0 for an arm in a horizontal plane.
    effort : str, as in a profile
        An external torque is zero where nothing pulls, and obeys no convention.
    whole : bool
        False where `log` is the beginning of a longer one.
    alone : bool
        False where the conventions of several logs are judged together: see `mends`.
    known : Saturation
        Limits of torques that the motion shows.
    tried : callable
        Gives what all conventions say of the log, where that is asked for elsewhere too.

    Returns
    -------
    tuple of Notice
        None for a log of fewer than four samples.
    """
    if len(log) < 4:
        return ()
    tried = tried or cache(partial(judged, log, gravity=gravity > 0))
    every = [
        *([] if effort == "external" else efforts(log, known)),
        *held_efforts(log),
        *stuck(log, ("theta",) if effort == "external" else ("theta", "tau")),
        *angles(log),
        *degrees(log, lambda: is_to_scale(tried())),
        *spikes(log),
        *sampling(log),
        *rests(log, whole),
    ]
    notices = []
    for one in every:
        if one.refuse and one.code in log.origin.reading.accepted:
            numbers = {**one.numbers, "accepted": True}
            one = replace(one, refuse=False, remedies=(), text="", numbers=numbers)
        elif one.refuse:
            one = replace(one, remedies=(*one.remedies, nevertheless(one.code)))
        notices.append(one)
    if effort != "external" and alone and not any(one.refuse for one in notices):
        found = mend(log.origin, tried()) or doubted(log.origin, tried())
        notices += [found] if found else []
    if whole:
        return tuple(notices)
    place = {"looked_at": round(log.duration)}
    return tuple(
        replace(one, refuse=False, text="", numbers={**one.numbers, **place}) for one in notices
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
