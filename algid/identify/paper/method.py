"""The paper's method over a whole log: stages on windows, in blocks, and one estimate from each series.

A series' estimate is the median over its settled samples, the last 0.2 s of each window; with several windows,
the median of the windows' medians. An estimate that wanders by more than its own size has status weak.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.identify.paper.stages import EPSILON, STAGE2_NAMES, stage1, stage2
from algid.sampling import Segment, pieces

SETTLED = 0.2  # s at the end of each window
SHORTEST = EPSILON + SETTLED  # s
BLOCK_SAMPLES = 16384  # bounds the memory: some 3 kB a sample

STAGE1_SERIES = ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "k5+k3", "condition", "k7_condition")
STAGE2_SERIES = (*STAGE2_NAMES, "l1", "m_p", "condition")

Stage = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]


@dataclass(frozen=True, eq=False)
class Series:
    """Estimates (s, n) of one window, its times `t` (n,) in s, and how many samples at its end are settled."""

    t: FloatArray
    values: FloatArray
    settled: int


def stage1_series(source: Iterable[Segment], window: float) -> Iterator[Series]:
    """`STAGE1_SERIES` of a log of the arm without payload, by windows of `window` s; segments need velocities."""

    def stage(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float) -> FloatArray:
        found = stage1(theta, omega, tau, dt)
        total = found.k[4] + found.k[2]
        return np.concatenate([found.k, [total, found.condition, found.k7_condition]])

    return _windows(source, window, stage)


def stage2_series(source: Iterable[Segment], window: float, k: FloatArray, gravity: float) -> Iterator[Series]:
    """`STAGE2_SERIES` of a log of the arm with payload, given its constants k1 … k7 (7,) without."""

    def stage(theta: FloatArray, omega: FloatArray, tau: FloatArray, dt: float) -> FloatArray:
        found = stage2(theta, omega, tau, dt, k, gravity)
        return np.concatenate([found.x, [found.l1, found.m_p, found.condition]])

    return _windows(source, window, stage)


def _windows(source: Iterable[Segment], window: float, stage: Stage) -> Iterator[Series]:
    moving = iter(source)
    first = next(moving, None)
    if first is None:
        return
    rows = max(round(window / first.dt), 8)
    for batch in _batches(pieces(chain([first], moving), rows)):
        dt = batch[0].dt
        theta, tau = (np.stack([getattr(window, name) for window in batch], axis=1) for name in ("theta", "tau"))
        omega = np.stack([window.omega for window in batch if window.omega is not None], axis=1)
        values = stage(theta, omega, tau, dt)
        for index, piece in enumerate(batch):
            yield Series(t=piece.t, values=values[:, index], settled=round(SETTLED / dt))


def _batches(windows: Iterable[Segment]) -> Iterator[list[Segment]]:
    """Neighbouring windows of one length, as many as a block holds; windows too short to integrate are left out."""
    batch: list[Segment] = []
    for window in windows:
        if len(window) < 8:
            continue
        full = len(window) * (len(batch) + 1) > BLOCK_SAMPLES
        if batch and (full or len(batch[0]) != len(window)):
            yield batch
            batch = []
        batch.append(window)
    if batch:
        yield batch


class Summary:
    """Gathers the windows' settled medians; `estimates` is what the series come to."""

    def __init__(self, size: int) -> None:
        self._quartiles: list[FloatArray] = []
        self._size = size

    def add(self, series: Series) -> None:
        """Take in one window; samples that are NaN (singular, before ε) do not count."""
        settled = series.values[:, -series.settled :]
        quartiles = np.full((3, self._size), np.nan)
        some = np.isfinite(settled).any(axis=1)
        if some.any():
            usable = settled[some]
            quantile = np.nanquantile if np.isnan(usable).any() else np.quantile  # the former goes row by row
            quartiles[:, some] = quantile(usable, [0.25, 0.5, 0.75], axis=1)
        self._quartiles.append(quartiles)

    def estimates(self) -> tuple[FloatArray, FloatArray]:
        """Estimates (s,) and how far they wander (s,), half the distance of the quartiles; NaN where none."""
        if not self._quartiles:
            return np.full(self._size, np.nan), np.full(self._size, np.nan)
        low, middle, high = np.stack(self._quartiles, axis=-1)
        estimate, wander = np.full(self._size, np.nan), np.full(self._size, np.nan)
        some = np.isfinite(middle).any(axis=1)
        estimate[some] = np.nanmedian(middle[some], axis=1)
        within = np.nanmedian(high[some] - low[some], axis=1)
        if some.any():
            between = np.subtract(*np.nanquantile(middle[some], [0.75, 0.25], axis=1))
            wander[some] = 0.5 * np.maximum(within, between)
        return estimate, wander


def wanders(estimate: FloatArray, wander: FloatArray) -> NDArray[np.bool_]:
    """Where an estimate is not to be trusted: there is none, or it wanders by more than its own size."""
    return ~(wander <= np.abs(estimate))
