"""What the figures need of `torque.parquet`, gathered in one pass of bounded memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.progress import Told
from algid.report.blocks import Block, blocks, by_log, row_count
from algid.report.reduce import MinMax, Thinned, broken_at_gaps, bucket_size
from algid.report.spectrum import Spectrum, stretch_length

COLUMNS = ("log", "t", "theta1", "theta2", "omega1", "omega2", "tau1", "tau2", "tau1_predicted", "tau2_predicted")
SERIES = ("tau1", "tau2", "tau1_predicted", "tau2_predicted", "residual1", "residual2")
POINTS = 3_600  # a series; twice what a wide screen can show
DOTS = 3_000
LONGEST_GAP = 5  # sampling periods; longer breaks the line


@dataclass
class LogRange:
    """What one log spans: its times in s, its samples, its largest gap in s, its sampling period in s."""

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
    """Reduced series by log and name, samples of the motion, extremes, spectra of torque and residual.

    `motion` is (4, m): θ1, θ2, θ̇1, θ̇2; `extremes` maps a column to its smallest and largest value;
    `density` (4, n) belongs to τ1, τ2 and the residuals; `rms` and `residual_rms` are in N m a joint.
    `worst` gives the log and the time in s of each joint's largest residual; `reduced` tells whether a
    series holds fewer samples than the log.
    """

    ranges: dict[int, LogRange]
    series: dict[int, dict[str, tuple[FloatArray, FloatArray]]]
    motion: FloatArray
    extremes: dict[str, tuple[float, float]]
    frequency: FloatArray
    density: FloatArray
    autocorrelation: FloatArray
    independent: int
    rms: tuple[float, float]
    residual_rms: tuple[float, float]
    unpredicted: int
    worst: dict[int, tuple[int, float]]
    reduced: bool


def read_torque(path: Path, told: Told | None = None) -> TorqueLog:
    """Read `path`, telling how far. Raises `ResultError` where it cannot be read or lacks a column."""
    total = row_count(path)
    gathering = _Gathering(total)
    for log, block in by_log(blocks(path, COLUMNS)):
        gathering.take(log, block)
        if told is not None:
            told("report", sum(span.samples for span in gathering.ranges.values()), total)
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
        self.spectrum: Spectrum | None = None
        self.dt = float("nan")
        self.squares = np.zeros(4)
        self.counts = np.zeros(4)
        self.worst: dict[int, tuple[float, int, float]] = {}

    def take(self, log: int, block: Block) -> None:
        """Add the next block of the log of that number."""
        block |= {f"residual{j}": block[f"tau{j}"] - block[f"tau{j}_predicted"] for j in (1, 2)}
        follows = self._range(log, block["t"])
        reducers = self.reducers.setdefault(log, {name: MinMax(self.size) for name in SERIES})
        for name, reducer in reducers.items():
            reducer.feed(block["t"], block[name])
        self.motion.feed(np.stack([block[name] for name in ("theta1", "theta2", "omega1", "omega2")]))
        self._widen(block)
        self._find_worst(log, block)
        self._sum(block)
        self._transform(log, block, follows)

    def _range(self, log: int, t: FloatArray) -> bool:
        """Extend the log's range; whether the block follows what was there."""
        follows = log in self.ranges
        span = self.ranges.setdefault(log, LogRange(float(t[0]), float(t[0])))
        steps = np.diff(t, prepend=span.last if follows else t[0])
        if np.isnan(span.period) and t.size > 1:
            span.period = float(np.median(np.diff(t)))
        span.samples += t.size
        span.last = float(t[-1])
        span.largest_gap = max(span.largest_gap, float(steps.max()))
        span.gaps += int(np.count_nonzero(steps > LONGEST_GAP * span.period))
        return follows

    def _widen(self, block: Block) -> None:
        for name in (*COLUMNS[2:], "residual1", "residual2"):
            low, high = float(np.fmin.reduce(block[name])), float(np.fmax.reduce(block[name]))
            old = self.extremes.get(name, (low, high))
            self.extremes[name] = float(np.fmin(low, old[0])), float(np.fmax(high, old[1]))

    def _find_worst(self, log: int, block: Block) -> None:
        for joint in (1, 2):
            size = np.nan_to_num(np.abs(block[f"residual{joint}"]), nan=-1.0)
            place = int(size.argmax())
            if size[place] >= 0 and size[place] > self.worst.get(joint, (-1.0, 0, 0.0))[0]:
                self.worst[joint] = (float(size[place]), log, float(block["t"][place]))

    def _sum(self, block: Block) -> None:
        for place, name in enumerate(("tau1", "tau2", "residual1", "residual2")):
            finite = block[name][np.isfinite(block[name])]
            self.squares[place] += finite @ finite
            self.counts[place] += finite.size

    def _transform(self, log: int, block: Block, follows: bool) -> None:
        period = self.ranges[log].period
        if self.spectrum is None:
            self.spectrum, self.dt = Spectrum(4, stretch_length(self.total)), period
        if not follows:
            self.spectrum.cut()
        if abs(period - self.dt) <= 0.01 * self.dt:  # a log of another rate has another spectrum
            self.spectrum.feed(np.stack([block[n] for n in ("tau1", "tau2", "residual1", "residual2")]))

    def result(self) -> TorqueLog:
        """What was gathered."""
        spectrum = self.spectrum or Spectrum(4, 128)
        frequency, density = spectrum.density(self.dt)
        rms = np.sqrt(self.squares / np.maximum(self.counts, 1))
        return TorqueLog(
            ranges=self.ranges,
            series={log: {name: self._series(log, name) for name in SERIES} for log in self.reducers},
            motion=self.motion.result(4),
            extremes=self.extremes,
            frequency=frequency,
            density=density if spectrum.stretches else density[:, :0],
            autocorrelation=spectrum.autocorrelation()[2:],
            independent=spectrum.stretches * stretch_length(self.total),
            rms=(float(rms[0]), float(rms[1])),
            residual_rms=(float(rms[2]), float(rms[3])),
            unpredicted=int(self.counts[0] - self.counts[2]),
            worst={joint: (log, moment) for joint, (_, log, moment) in self.worst.items()},
            reduced=self.size > 2,
        )

    def _series(self, log: int, name: str) -> tuple[FloatArray, FloatArray]:
        x, y = self.reducers[log][name].result()
        return broken_at_gaps(x, y, LONGEST_GAP * self.size * self.ranges[log].period)
