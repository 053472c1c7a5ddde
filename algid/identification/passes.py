"""Logs and settings as estimators are given them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from algid.base.errors import LogError
from algid.estimators.combine import Prior, joined, without
from algid.estimators.elastic import with_rotors
from algid.estimators.problem import Problem, Source, TooShortError, WeakSettings
from algid.estimators.terms import Selection
from algid.identification.recordings import Recording, Recordings
from algid.identification.velocities import with_velocities
from algid.physics.effort import absent
from algid.settings import Settings
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift


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


def problem_of(
    survey: Recordings,
    settings: Settings,
    chosen: Selection,
    prior: Prior | None = None,
    watched: Callable[[Recording, Source], Iterator[Segment]] | None = None,
) -> Problem:
    """What an estimator is given to fit the chosen model, beside what is known beforehand.

    Each pass over a log goes through `watched`, if given. Segments have velocities only where they
    are not observed on the way.
    """
    windows = WeakSettings(
        model=chosen.model,
        bandwidth=settings.bandwidth,
        shift=TorqueShift(chosen.hold == "zoh", settings.delay),
        estimate_delay=chosen.delay,
    )
    own = settings.velocity == "measured" or settings.luenberger
    if own:
        windows = replace(windows, bandwidth=None)
    if settings.window is not None:
        windows = replace(windows, window=settings.window)

    def passed(log: Recording) -> Source:
        moving: Source = partial(survey.segments, log)
        if own:
            moving = partial(with_velocities, survey, log, settings, luenberger=settings.luenberger)
        if watched is None:
            return moving
        return partial(watched, log, moving)

    known = without(prior, absent(settings.effort, chosen.model.names))
    known = with_rotors(known, chosen.model)
    if chosen.undetermined is not None and chosen.delay:
        known = joined(known, chosen.undetermined.prior)
    return Problem(
        list(map(passed, survey.unloaded)),
        list(map(passed, survey.loaded)),
        windows,
        settings.lengths,
        known,
        survey.progress,
    )
