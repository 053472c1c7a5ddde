"""Logs, their velocities and settings as estimators are given them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from algid.base.errors import LogError
from algid.estimators.combine import Prior, joined, without
from algid.estimators.elastic import with_rotors
from algid.estimators.problem import Problem, Source, TooShortError, WeakSettings
from algid.estimators.terms import Selection
from algid.identification.recordings import Recording, Recordings
from algid.options import flag
from algid.physics.effort import absent
from algid.settings import Settings
from algid.signals.differences import TorqueShift
from algid.signals.observers import PAPER_POLES, observed
from algid.signals.segments import Segment


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
) -> Problem:
    """What an estimator is given to fit the chosen model, beside what is known beforehand.

    Segments have velocities only where they are not observed on the way.
    """
    own = settings.velocity == "measured" or settings.luenberger
    windows = WeakSettings(
        model=chosen.model,
        bandwidth=None if own else settings.bandwidth,
        shift=TorqueShift(chosen.hold == "zoh", settings.delay),
        estimate_delay=chosen.delay,
    )
    if settings.window is not None:
        windows = replace(windows, window=settings.window)

    def passed(log: Recording) -> Source:
        if own:
            return partial(with_velocities, survey, log, settings)
        return partial(survey.segments, log)

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


def with_velocities(survey: Recordings, log: Recording, settings: Settings) -> Iterator[Segment]:
    """Segments of a log with velocities: measured, or by the paper's observer.

    Raises
    ------
    LogError
        If measured velocities are asked for and the log has none.
    """
    if settings.velocity != "measured":
        yield from observed(survey.segments(log), settings.poles or PAPER_POLES)
        return
    for segment in survey.segments(log):
        if segment.omega is None:
            raise LogError(
                f"{log.name}: expected velocities omega1, omega2 for {flag('velocity')}="
                f"measured, found none; they are observed by {flag('velocity')}=observer"
            )
        yield segment
