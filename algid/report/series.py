"""What the figures need of a convergence series and of `torque.parquet`.

Each is gathered in one pass of bounded memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.blocks import stacked
from algid.criteria import CUT
from algid.errors import ResultError
from algid.methods import settles
from algid.model import K7
from algid.progress import Progress
from algid.report.reduce import (
    Block,
    MinMax,
    Share,
    Thinned,
    blocks,
    broken_at_gaps,
    bucket_size,
    by_log,
    columns_of,
    row_count,
)

EPSILON = 0.2  # s: the paper's ε
WINDOW = 2.0  # s: after which the paper's integrals restart, unless its own settings say otherwise
LARGEST_CONDITION = 1e10  # beyond, the paper's stages call a system singular
SERIES_POINTS = 1_200  # twice what a panel is wide, of two in a row
STRETCHES = 400
SAMPLES = 20_000
MIDDLES = 500
NOT_SERIES = ("t", "condition", "k7_condition")

Series = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class SeriesLog:
    """Series by name: extremes of `lines`, sizes of `samples`, running medians of `middles`.

    `singular` is the share of samples that have no estimate, after ε, because the system was
    singular; `condition` is the condition number, infinite ones left out. `start`, `end` and
    `window` are in s.
    """

    start: float
    end: float
    window: float
    coarse: bool
    lines: dict[str, Series]
    samples: dict[str, FloatArray]
    middles: dict[str, Series]
    singular: dict[str, Series]
    condition: Series | None

    @property
    def windows(self) -> list[float]:
        """When each window starts, in s."""
        return list(map(float, np.arange(self.start, self.end, self.window)))

    @property
    def any_singular(self) -> bool:
        """Whether any series has a singular stretch."""
        return any(bool(share.any()) for _, share in self.singular.values())


def read_series(path: Path, settings: Mapping[str, Any]) -> SeriesLog:
    """Read `path`: a column ``t``, a column a series, perhaps ``condition``.

    Raises `ResultError`.
    """
    columns = columns_of(path)
    names = [name for name in columns if name not in NOT_SERIES]
    gathering = _SeriesGathering(names, row_count(path), settings)
    wanted = ["t"] + names
    wanted += [name for name in ("condition", "k7_condition") if name in columns]
    for block in blocks(path, wanted):
        gathering.take(block)
    return gathering.result("condition" in columns)


def _window(settings: Mapping[str, Any]) -> float:
    """After how long the integrals restart, s; the paper's where its own settings say nothing."""
    window = settings.get("window")
    if not settles(settings.get("estimator")) or isinstance(window, bool):
        return WINDOW
    if isinstance(window, int | float) and window > 0:
        return float(window)
    return WINDOW


class _SeriesGathering:
    def __init__(self, names: list[str], total: int, settings: Mapping[str, Any]) -> None:
        self.names = names
        self._total = total
        self._window = _window(settings)
        self._start: float | None = None
        self._end = 0.0
        self._size = bucket_size(total, SERIES_POINTS)
        self._lines = _reducers(names, self._size)
        self._singular = {name: Share(max(total // STRETCHES, 1)) for name in names}
        self._condition = MinMax(self._size)
        self._samples = Thinned(total // SAMPLES)

    def take(self, block: Block) -> None:
        """Add the next block."""
        t = block["t"]
        if self._start is None:
            self._start = float(t[0])
        self._end = float(t[-1])
        since = t - self._start
        # stamps are multiples of the period but for rounding, which must not move a window's first
        # sample
        late = np.mod(since + 1e-9, self._window) >= EPSILON
        for name in self.names:
            self._lines[name].feed(t, block[name])
            lacking = late & np.isnan(block[name])
            self._singular[name].feed(t, lacking & _ill_conditioned(name, block))
        if "condition" in block:
            condition = block["condition"]
            self._condition.feed(t, np.where(np.isfinite(condition), condition, np.nan))
        self._samples.feed(stacked(block, ["t"] + self.names))

    def result(self, with_condition: bool) -> SeriesLog:
        """What was gathered."""
        start = self._start or 0.0
        samples = self._samples.result(1 + len(self.names))
        named = dict(zip(self.names, samples[1:], strict=True))
        period = (self._end - start) / max(self._total - 1, 1)
        return SeriesLog(
            start=start,
            end=self._end,
            window=self._window,
            coarse=self._size * period >= EPSILON,
            lines=_results(self._lines),
            samples=named,
            middles={name: _medians(samples[0], values) for name, values in named.items()},
            singular=_results(self._singular),
            condition=self._condition.result() if with_condition else None,
        )


def _reducers(names: Iterable[str], size: int) -> dict[str, MinMax]:
    """One of its own for each series."""
    return {name: MinMax(size) for name in names}


def _results(reducers: Mapping[str, MinMax | Share]) -> dict[str, Series]:
    """What is left of each series."""
    return {name: reducer.result() for name, reducer in reducers.items()}


def _ill_conditioned(name: str, block: Block) -> NDArray[np.bool_]:
    """Where the system of a series was singular (n,): everywhere where the file does not tell."""
    conditions = ["condition"]
    if name == K7:
        conditions.append("k7_condition")
    ill = [~(block[one] <= LARGEST_CONDITION) for one in conditions if one in block]
    if not ill:
        return np.ones(block["t"].size, dtype=np.bool_)
    every: NDArray[np.bool_] = np.logical_or.reduce(ill)
    return every


def _medians(x: FloatArray, y: FloatArray) -> Series:
    """Medians of the finite samples in `MIDDLES` stretches, NaN where there are none."""
    size = max(x.size // MIDDLES, 1)
    whole = x.size - x.size % size
    stretches = np.sort(y[:whole].reshape(-1, size), axis=1)  # NaN goes last
    finite = np.isfinite(stretches).sum(axis=1)
    middle = stretches[np.arange(finite.size), np.maximum(finite - 1, 0) // 2]
    return x[:whole:size], middle


COLUMNS = (
    "log",
    "t",
    "theta1",
    "theta2",
    "omega1",
    "omega2",
    "tau1",
    "tau2",
    "tau1_predicted",
    "tau2_predicted",
)
MOTION = COLUMNS[2:6]
RESIDUALS = ("residual1", "residual2")
SERIES = COLUMNS[2:] + RESIDUALS
SCORED = ("tau1", "tau2", "tau1_predicted", "tau2_predicted")
SCORED_POINTS = 1_200  # of a curve without anything fast in it
POINTS = 2_400  # a series; twice what the page is wide
DOTS = 2_000


@dataclass
class LogRange:
    """Extent of one log: its times in s, samples, largest gap in s, sampling period in s."""

    first: float
    last: float
    samples: int = 0
    largest_gap: float = 0.0
    gaps: int = 0
    period: float = float("nan")

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return self.last - self.first


@dataclass
class TorqueLog:
    """Reduced series by log and name, samples of the motion, extremes.

    `motion` is (4, m): θ1, θ2, θ̇1, θ̇2; `extremes` maps a column to its smallest and largest
    value; `rms` and `residual_rms` are in N m a joint. `worst` gives the log and the time in s of
    each joint's largest residual; `reduced` tells whether a series holds fewer samples than the
    log.
    """

    ranges: dict[int, LogRange]
    series: dict[int, dict[str, Series]]
    motion: FloatArray
    extremes: dict[str, tuple[float, float]]
    rms: tuple[float, float]
    residual_rms: tuple[float, float]
    unpredicted: int
    worst: dict[int, tuple[int, float]]
    reduced: bool


def read_torque(path: Path, progress: Progress | None = None) -> TorqueLog:
    """Read `path`, telling how far.

    Raises
    ------
    ResultError
        Where it cannot be read, lacks a column, or a column of the motion holds no number.
    """
    total = row_count(path)
    gathering = _Gathering(total)
    for log, block in by_log(blocks(path, COLUMNS)):
        gathering.take(log, block)
        if progress is not None:
            progress("report", sum(span.samples for span in gathering.ranges.values()), total)
    for name in MOTION:
        if np.isnan(gathering.extremes.get(name, (np.nan, np.nan))[0]):
            raise ResultError(f"{path}: the column {name!r} holds no number; identify again")
    return gathering.result()


@dataclass
class _Gathering:
    total: int
    ranges: dict[int, LogRange] = field(default_factory=dict)
    reducers: dict[int, dict[str, MinMax]] = field(default_factory=dict)
    extremes: dict[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.size = bucket_size(self.total, POINTS)
        self.motion = Thinned(self.total // DOTS)
        self.squares = np.zeros(4)
        self.counts = np.zeros(4)
        self.worst: dict[int, tuple[float, int, float]] = {}

    def take(self, log: int, block: Block) -> None:
        """Add the next block of the log of that number."""
        _add_residuals(block)
        self._range(log, block["t"])
        reducers = self.reducers.setdefault(log, _reducers(SERIES, self.size))
        for name, reducer in reducers.items():
            reducer.feed(block["t"], block[name])
        self.motion.feed(stacked(block, MOTION))
        for name in SERIES:
            low, high = float(np.fmin.reduce(block[name])), float(np.fmax.reduce(block[name]))
            old = self.extremes.get(name, (low, high))
            self.extremes[name] = float(np.fmin(low, old[0])), float(np.fmax(high, old[1]))
        for joint in (1, 2):
            size = np.nan_to_num(np.abs(block[f"residual{joint}"]), nan=-1.0)
            place = int(size.argmax())
            if size[place] >= 0 and size[place] > self.worst.get(joint, (-1.0, 0, 0.0))[0]:
                self.worst[joint] = (float(size[place]), log, float(block["t"][place]))
        for place, name in enumerate(("tau1", "tau2", "residual1", "residual2")):
            finite = block[name][np.isfinite(block[name])]
            self.squares[place] += finite @ finite
            self.counts[place] += finite.size

    def _range(self, log: int, t: FloatArray) -> None:
        """Extend the log's range."""
        follows = log in self.ranges
        span = self.ranges.setdefault(log, LogRange(float(t[0]), float(t[0])))
        steps = np.diff(t, prepend=span.last if follows else t[0])
        if np.isnan(span.period) and t.size > 1:
            span.period = float(np.median(np.diff(t)))
        span.samples += t.size
        span.last = float(t[-1])
        span.largest_gap = max(span.largest_gap, float(steps.max()))
        span.gaps += int(np.count_nonzero(steps > CUT * span.period))

    def result(self) -> TorqueLog:
        """What was gathered."""
        rms = np.sqrt(self.squares / np.maximum(self.counts, 1))
        series, worst = {}, {}
        for log, reducers in self.reducers.items():
            series[log] = _broken(reducers, CUT * self.size * self.ranges[log].period)
        for joint, (_, log, moment) in self.worst.items():
            worst[joint] = log, moment
        return TorqueLog(
            ranges=self.ranges,
            series=series,
            motion=self.motion.result(4),
            extremes=self.extremes,
            rms=(float(rms[0]), float(rms[1])),
            residual_rms=(float(rms[2]), float(rms[3])),
            unpredicted=int(self.counts[0] - self.counts[2]),
            worst=worst,
            reduced=self.size > 2,
        )


def _add_residuals(block: Block) -> None:
    """Add measured less predicted torque to a block of both."""
    for joint in (1, 2):
        residual = block[f"tau{joint}"] - block[f"tau{joint}_predicted"]
        block[f"residual{joint}"] = residual


def _broken(reducers: Mapping[str, MinMax], longest: float) -> dict[str, Series]:
    """The reduced series by name, broken at gaps longer than `longest`, s."""
    series = {}
    for name, reducer in reducers.items():
        t, values = reducer.result()
        series[name] = broken_at_gaps(t, values, longest)
    return series


def read_scored(path: Path) -> dict[int, dict[str, Series]]:
    """The scored torque, its prediction and their difference by log and name, as a `TorqueLog`.

    Raises `ResultError` where `path` cannot be read or lacks a column.
    """
    size = bucket_size(row_count(path), SCORED_POINTS)
    reducers: dict[int, dict[str, MinMax]] = {}
    steps: dict[int, float] = {}
    for log, block in by_log(blocks(path, ("log", "t") + SCORED)):
        _add_residuals(block)
        own = reducers.setdefault(log, _reducers(SCORED + RESIDUALS, size))
        for name, reducer in own.items():
            reducer.feed(block["t"], block[name])
        if block["t"].size > 1:
            steps.setdefault(log, float(np.median(np.diff(block["t"]))))
    series = {}
    for log, own in reducers.items():
        series[log] = _broken(own, CUT * size * steps.get(log, np.inf))
    return series
