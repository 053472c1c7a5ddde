"""All checks of a log: channels, sampling, conventions; `messages.toml` says what each finds."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from functools import cache, partial

from algid.base.errors import LogError
from algid.estimators.convention_search import Judgement
from algid.estimators.saturation import UNSEEN, Saturation
from algid.inspection.channels import angles, degrees, efforts, held_efforts, spikes, stuck
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
    known: Saturation = UNSEEN,
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
        *stuck(log),
        *angles(log),
        *degrees(log, lambda: is_to_scale(tried())),
        *spikes(log),
        *sampling(log),
        *rests(log, whole),
    ]
    notices = tuple(yielding(notice, log.origin.reading.accepted) for notice in every)
    if effort == "external" or not alone or any(notice.refuse for notice in notices):
        return notices
    found = mend(log.origin, tried()) or doubted(log.origin, tried())
    return (*notices, found) if found else notices


def admitted(log: Log, found: Iterable[Notice], *, whole: bool = True) -> tuple[Notice, ...]:
    """What `examine` finds in a log that is used nevertheless, or in its beginning.

    Raises
    ------
    LogError
        If a check forbids the use of a log that is all there.
    """
    notices, looked_at = [], 0 if whole else round(log.duration)
    for notice in found:
        if notice.refuse and whole:
            raise LogError(f"{log.origin.path}: {notice.code}: {notice.clause}")
        if looked_at:
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
