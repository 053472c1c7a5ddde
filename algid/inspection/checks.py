"""All checks of a log: channels, sampling, conventions; `messages.toml` says what each finds."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cache, partial

from algid.base.errors import LogError
from algid.estimators.convention_search import Judgement
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
from algid.inspection.conventions import doubted, is_to_scale, judged, mend
from algid.inspection.sampling import rests, sampling
from algid.log import Log
from algid.notices import Notice, Remedy

CONTRADICTIONS = ("WRONG_CONVENTION", "FLIPPED_SIGN", "WRONG_ZERO")
"""Findings that say that a log was read by a wrong convention."""


def examine(
    log: Log,
    *,
    gravity: float = 9.81,
    effort: str | None = None,
    whole: bool = True,
    alone: bool = True,
    known: Saturation | None = None,
    tried: Callable[[], Judgement | None] | None = None,
) -> tuple[Notice, ...]:
    """Everything that the checks find in a log.

    Conventions are not sought in one that a check refuses.

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
        Limits of torques that the motion shows, where they are known already.
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
    external = effort == "external"
    if known is None:
        known = saturation(log, gravity=gravity, effort=effort)
    every: list[Notice] = []
    if not external:
        every += efforts(log, known)
        every += dead_efforts(log)
    every += held_efforts(log)
    every += angles(log)
    every += degrees(log, lambda: is_to_scale(tried()))
    every += spikes(log)
    every += sampling(log)
    every += rests(log, whole)
    notices = [yielding(notice, log.origin.reading.accepted) for notice in every]
    if external or not alone or any(notice.refuse for notice in notices):
        return tuple(notices)
    mended = mend(log.origin, tried())
    if mended is not None:
        return *notices, mended
    doubt = doubted(log.origin, tried()) if gravity > 0 else None
    return (*notices, doubt) if doubt else tuple(notices)


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
    notices = []
    for notice in examine(
        log, gravity=gravity, effort=effort, whole=whole, alone=alone, known=known
    ):
        if notice.refuse and whole:
            raise LogError(f"{log.origin.path}: {notice.code}: {notice.clause}")
        looked_at = round(log.duration)
        if looked_at and not whole:
            numbers = dict(notice.numbers) | {"looked_at": looked_at}
            notice = replace(notice, text="", numbers=numbers)
        notices.append(replace(notice, refuse=False))
    return tuple(notices)


def yielding(notice: Notice, accepted: Collection[str]) -> Notice:
    """A refusal with what overrides it, or as a warning where its code is in `accepted`.

    Else the same.
    """
    if not notice.refuse:
        return notice
    if notice.code in accepted:
        numbers = {**notice.numbers, "accepted": True}
        return replace(notice, refuse=False, remedies=(), text="", numbers=numbers)
    override = Remedy({"accept": notice.code}, "to use it nevertheless")
    return replace(notice, remedies=(*notice.remedies, override))
