"""Segments with the joint velocities that the settings ask for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import LogError
from algid.identification.source import LogSource
from algid.identification.survey import Survey
from algid.options import flag
from algid.settings import Settings
from algid.signals.filters import correlate, differentiator, half_length
from algid.signals.observers import PAPER_POLES, LuenbergerObserver
from algid.signals.segments import Segment, append


def with_velocities(
    survey: Survey, log: LogSource, settings: Settings, *, luenberger: bool
) -> Iterator[Segment]:
    """Segments of a log with velocities: measured, by the paper's observer, or differentiated.

    Raises
    ------
    LogError
        If measured velocities are asked for and the log has none.
    """
    observer: LuenbergerObserver | None = None
    filters: _Differentiator | None = None
    for segment in survey.segments(log):
        if settings.velocity == "measured":
            if segment.omega is None:
                raise LogError(
                    f"{log.name}: expected velocities omega1, omega2 for {flag('velocity')} "
                    "measured, found none; leave the flag out to observe them"
                )
            yield segment
        elif luenberger:
            observer = observer or LuenbergerObserver(segment.dt, settings.poles or PAPER_POLES)
            if not segment.continues:
                observer.reset()
            yield replace(segment, omega=observer.velocities(segment.theta))
        else:
            if filters is not None and not segment.continues:
                yield from filters.finish()
                filters = None
            filters = filters or _Differentiator(segment.dt, settings.bandwidth)
            yield from filters.push(segment)
    if filters is not None:
        yield from filters.finish()


class _Differentiator:
    """The zero-phase differentiator on one stretch that comes in parts.

    Its ends go on by point reflection.
    """

    def __init__(self, dt: float, bandwidth: float) -> None:
        self._kernel = differentiator(dt, bandwidth)
        self._reach = half_length(dt, bandwidth)
        self._angles: FloatArray | None = None  # what the next outputs rest on
        self._waiting: Segment | None = None  # samples whose velocity is still open

    def push(self, segment: Segment) -> Iterator[Segment]:
        """Take in a part; give out the samples whose neighbourhood is now complete."""
        self._waiting = segment if self._waiting is None else append(self._waiting, segment)
        if self._angles is None:
            if len(self._waiting) <= self._reach:
                return
            head = self._waiting.theta
            self._angles = np.concatenate(
                [2 * head[:, :1] - head[:, self._reach : 0 : -1], head], axis=1
            )
        else:
            self._angles = np.concatenate([self._angles, segment.theta], axis=1)
        yield from self._ready()

    def finish(self) -> Iterator[Segment]:
        """Give out the rest, at the end of the stretch."""
        assert self._waiting is not None
        if self._angles is None:
            slope = (
                np.gradient(self._waiting.theta, self._waiting.dt, axis=1)
                if len(self._waiting) > 1
                else None
            )
            yield replace(
                self._waiting, omega=np.zeros_like(self._waiting.theta) if slope is None else slope
            )
            return
        tail = self._angles[:, -self._reach - 1 :]
        self._angles = np.concatenate([self._angles, 2 * tail[:, -1:] - tail[:, -2::-1]], axis=1)
        yield from self._ready()

    def _ready(self) -> Iterator[Segment]:
        assert self._angles is not None
        assert self._waiting is not None
        if self._angles.shape[1] <= 2 * self._reach:
            return
        omega = correlate(self._angles, self._kernel)
        count = omega.shape[1]
        yield replace(self._waiting.part(0, count), omega=omega)
        self._waiting = self._waiting.part(count, len(self._waiting))
        self._angles = self._angles[:, -2 * self._reach :]
