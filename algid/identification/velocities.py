"""Segments with the joint velocities that the settings ask for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from algid.base.errors import LogError
from algid.identification.recordings import Recording, Recordings
from algid.options import flag
from algid.settings import Settings
from algid.signals.filters import correlate, differentiator, half_length, reflected
from algid.signals.observers import PAPER_POLES, LuenbergerObserver
from algid.signals.segments import Segment, settled


def with_velocities(
    survey: Recordings, log: Recording, settings: Settings, *, luenberger: bool
) -> Iterator[Segment]:
    """Segments of a log with velocities: measured, by the paper's observer, or differentiated.

    Raises
    ------
    LogError
        If measured velocities are asked for and the log has none.
    """
    if settings.velocity != "measured" and not luenberger:
        bandwidth = settings.bandwidth
        for held, first, last in settled(
            survey.segments(log), lambda dt: half_length(dt, bandwidth)
        ):
            yield _derived(held, bandwidth).part(first, last)
        return
    observer: LuenbergerObserver | None = None
    for segment in survey.segments(log):
        if settings.velocity == "measured":
            if segment.omega is None:
                raise LogError(
                    f"{log.name}: expected velocities omega1, omega2 for {flag('velocity')}="
                    "measured, found none; leave it out to observe them"
                )
            yield segment
            continue
        observer = observer or LuenbergerObserver(segment.dt, settings.poles or PAPER_POLES)
        if not segment.continues:
            observer.reset()
        yield replace(segment, omega=observer.velocities(segment.theta))


def _derived(segment: Segment, bandwidth: float) -> Segment:
    """The segment with velocities by the zero-phase differentiator.

    Its ends go on by point reflection.

    One that is shorter than half a kernel has differences of neighbours.
    """
    reach, theta = half_length(segment.dt, bandwidth), segment.theta
    if len(segment) > reach:
        kernel = differentiator(segment.dt, bandwidth)
        omega = correlate(reflected(theta, reach), kernel)
    elif len(segment) > 1:
        omega = np.gradient(theta, segment.dt, axis=1)
    else:
        omega = np.zeros_like(theta)
    return replace(segment, omega=omega)
