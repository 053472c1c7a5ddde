"""Passes over logs as estimators take them, and the settings that go with a model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from algid.base.errors import LogError
from algid.estimators import weak
from algid.estimators.terms import Selection
from algid.estimators.too_short import TooShortError
from algid.identification.recordings import Recording, Recordings
from algid.identification.velocities import with_velocities
from algid.settings import Settings
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift

Pass = Callable[[], Iterable[Segment]]


@contextmanager
def long_enough(survey: Recordings) -> Iterator[None]:
    """Name the logs where an estimator finds none of them long enough.

    Raises
    ------
    LogError
        If that is so.
    """
    try:
        yield
    except TooShortError as error:
        names = ", ".join(log.name for log in survey.logs)
        raise LogError(f"{names}: {error}; record longer") from error


def weak_settings(settings: Settings, chosen: Selection) -> weak.WeakSettings:
    """The settings of estimators for the chosen model."""
    ours = weak.WeakSettings(
        model=chosen.model,
        bandwidth=settings.bandwidth,
        shift=TorqueShift(chosen.hold == "zoh", settings.delay),
        estimate_delay=chosen.delay,
    )
    if settings.velocity == "measured" or settings.luenberger:
        ours = replace(ours, bandwidth=None)
    if settings.window is not None:
        ours = replace(ours, window=settings.window)
    return ours


def passes(
    survey: Recordings,
    settings: Settings,
    watched: Callable[[Recording, Pass], Iterator[Segment]] | None = None,
) -> tuple[list[Pass], list[Pass]]:
    """Callables, one per log, that give a fresh pass; unloaded and loaded logs apart.

    Each pass goes through `watched`, if given.

    Segments have velocities only where they are not observed on the way.
    """
    own = settings.velocity == "measured" or settings.luenberger

    def passed(log: Recording) -> Pass:
        moving: Pass = partial(survey.segments, log)
        if own:
            moving = partial(with_velocities, survey, log, settings, luenberger=settings.luenberger)
        if watched is None:
            return moving
        return partial(watched, log, moving)

    return [passed(log) for log in survey.unloaded], [passed(log) for log in survey.loaded]
