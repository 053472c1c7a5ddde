"""Uniform stretches of a log: what every estimator works on.

A log is cut where samples are missing for long and put on a uniform time base where its stamps jitter, by the
cubic through the four recorded samples around each instant, once samples that stand all but on top of one another
are where they belong (`algid.signals.spacing`). What comes out does not depend on the blocks in
which the log was read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from algid.arm import FloatArray, keep_arrays
from algid.log import IntArray, Log, join, usual_period
from algid.signals.spacing import spaced

PERIOD_SAMPLES = 4096  # the first samples, from which the period is taken
LONGEST_GAP = 5.0  # periods: a longer gap cuts the log
_BRIDGE = 8  # samples of a block that are joined to those held back from the one before
EVEN = 1e-3  # periods: stamps this close to the time base are taken as lying on it


@dataclass(frozen=True, eq=False)
class Segment:
    """Uniformly sampled stretch of one log.

    Parameters
    ----------
    start : float, s
        Time of the first sample since the log's first sample.
    dt : float, s
        Time between samples.
    theta, tau : (2, N) float64, rad and N m
    omega : (2, N) float64, rad/s, or None where the log has no velocities
    continues : bool
        Whether the first sample follows the last one of the segment before by `dt`.
    """

    start: float
    dt: float
    theta: FloatArray
    tau: FloatArray
    omega: FloatArray | None = None
    continues: bool = False

    def __post_init__(self) -> None:
        keep_arrays(self)

    def __len__(self) -> int:
        return int(self.theta.shape[1])

    @property
    def t(self) -> FloatArray:
        """Time (N,) in s since the log's first sample."""
        return self.start + self.dt * np.arange(len(self), dtype=np.float64)

    def part(self, first: int, last: int) -> Segment:
        """Samples `first` to `last` - 1 as views; it continues the part before it."""
        return replace(
            self,
            start=self.start + first * self.dt,
            theta=self.theta[:, first:last],
            tau=self.tau[:, first:last],
            omega=None if self.omega is None else self.omega[:, first:last],
            continues=self.continues or first > 0,
        )


def segments(blocks: Iterable[Log]) -> Iterator[Segment]:
    """Uniform segments of the log that comes in `blocks`, in time order.

    The period is the mean over the log's first samples, gaps left out. A gap of more than `LONGEST_GAP` periods
    starts a new stretch; shorter ones are filled by interpolation.
    """
    source = iter(blocks)
    head = _first_samples(source)
    if head is None:
        return
    dt = _mean_period(join(spaced([head], usual_period(head.stamp_ns[:PERIOD_SAMPLES]))).stamp_ns)
    sampler = _Sampler(int(head.stamp_ns[0]), dt)
    for block in spaced(_chain(head, source), dt):
        yield from sampler.push(block)
    yield from sampler.finish()


def _first_samples(source: Iterator[Log]) -> Log | None:
    """The first blocks joined, so that the period does not depend on how they were cut."""
    head: list[Log] = []
    while sum(map(len, head)) < PERIOD_SAMPLES:
        block = next(source, None)
        if block is None:
            break
        if len(block):
            head.append(block)
    return join(head) if head else None


def _chain(head: Log, rest: Iterator[Log]) -> Iterator[Log]:
    yield head
    yield from rest


def _mean_period(stamp_ns: IntArray) -> float:
    """Mean time between neighbouring samples in s, over the first samples and without gaps."""
    steps = np.diff(stamp_ns[:PERIOD_SAMPLES]).astype(np.float64)
    period = usual_period(stamp_ns[:PERIOD_SAMPLES])
    near = steps[np.abs(steps - 1e9 * period) <= 0.5e9 * period]
    return float(near.mean()) * 1e-9 if 2 * near.size > steps.size else period


class _Sampler:
    """Puts blocks on the time base, holding back the last samples until their successors are known."""

    def __init__(self, origin_ns: int, dt: float) -> None:
        self._origin_ns = origin_ns
        self._dt = dt
        self._pending: Log | None = None
        self._anchor = 0.0  # time of the stretch's first sample
        self._emitted = 0  # grid points of the stretch that have been given out

    def push(self, block: Log) -> Iterator[Segment]:
        if self._pending is None:
            self._anchor = float(self._time(block)[0])
            yield from self._settle(block)
            return
        yield from self._settle(join([self._pending, block.part(0, _BRIDGE)]))
        if len(block) > _BRIDGE:  # what is held back now is the block's own: no copy
            yield from self._settle(block.part(_BRIDGE - len(self._pending), len(block)))

    def _settle(self, held: Log) -> Iterator[Segment]:
        gaps = np.flatnonzero(np.diff(held.stamp_ns) * 1e-9 > LONGEST_GAP * self._dt) + 1
        edges = [0, *gaps.tolist(), len(held)]
        for first, last in pairwise(edges[:-1]):
            yield from self._stretch(held.part(first, last), ends=True)
            self._anchor, self._emitted = self._time(held)[last], 0
        self._pending = held.part(edges[-2], edges[-1])
        yield from self._stretch(self._pending, ends=False)
        self._pending = self._pending.part(max(0, len(self._pending) - 4), len(self._pending))

    def finish(self) -> Iterator[Segment]:
        if self._pending is not None:
            yield from self._stretch(self._pending, ends=True)

    def _time(self, log: Log) -> FloatArray:
        return (log.stamp_ns - self._origin_ns) * 1e-9

    def _stretch(self, log: Log, *, ends: bool) -> Iterator[Segment]:
        """The grid points that `log` settles: up to its last sample but one, or all where the stretch ends."""
        t = self._time(log)
        reach = t[-1] + EVEN * self._dt if ends else t[max(0, t.size - 2)] - EVEN * self._dt
        count = int(np.floor((reach - self._anchor) / self._dt)) + 1 - self._emitted
        if count <= 0 or t.size < 4:
            return
        grid = self._anchor + self._dt * np.arange(self._emitted, self._emitted + count)
        first = int(np.searchsorted(t, grid[0] - 0.5 * self._dt))
        take = _take_even if _is_even(t[first : first + count], grid, self._dt) else _interpolate
        yield Segment(
            start=float(grid[0]),
            dt=self._dt,
            theta=take(t, log.theta, grid, first),
            tau=take(t, log.tau, grid, first),
            omega=None if log.omega is None else take(t, log.omega, grid, first),
            continues=self._emitted > 0,
        )
        self._emitted += count


def _is_even(t: FloatArray, grid: FloatArray, dt: float) -> bool:
    return t.size == grid.size and bool(np.all(np.abs(t - grid) <= EVEN * dt))


def _take_even(_t: FloatArray, signal: FloatArray, grid: FloatArray, first: int) -> FloatArray:
    return signal[:, first : first + grid.size]


def _interpolate(t: FloatArray, signal: FloatArray, grid: FloatArray, _first: int) -> FloatArray:
    """Values (2, M) at `grid` of the cubic through the four samples around each instant (Lagrange)."""
    corner = np.clip(np.searchsorted(t, grid, side="right") - 2, 0, t.size - 4)
    nodes = t[corner[:, None] + np.arange(4)]
    values = np.zeros((signal.shape[0], grid.size))
    for node in range(4):
        others = [other for other in range(4) if other != node]
        weight = np.prod([(grid - nodes[:, other]) / (nodes[:, node] - nodes[:, other]) for other in others], axis=0)
        values += weight * signal[:, corner + node]
    return values


def pieces(source: Iterable[Segment], rows: int) -> Iterator[Segment]:
    """Cut each stretch into pieces of `rows` samples: see `Cutter`."""
    cutter = Cutter(rows)
    for segment in source:
        yield from cutter.push(segment)
    yield from cutter.finish()


def spread_pieces(usable: Iterable[Segment], count: int) -> tuple[list[Segment], bool]:
    """Copies of evenly spread pieces of a log, from one pass over it.

    Parameters
    ----------
    usable : iterable of `Segment`
    count : int
        How many are kept of a long log, up to twice as many. What was cut from a block does not hold it.

    Returns
    -------
    The pieces, and whether they are all there were. Where some were left out none continues the one before.
    """
    kept: list[Segment] = []
    stride = 1
    for index, piece in enumerate(usable):
        if index % stride:
            continue
        omega = None if piece.omega is None else piece.omega.copy()
        continues = piece.continues and stride == 1
        kept.append(replace(piece, theta=piece.theta.copy(), tau=piece.tau.copy(), omega=omega, continues=continues))
        if len(kept) > 2 * count:
            kept, stride = [replace(other, continues=False) for other in kept[::2]], 2 * stride
    return kept, stride == 1


class Cutter:
    """Cuts each stretch into pieces of `rows` samples; a rest shorter than half a piece joins the last one.

    The pieces do not depend on how the stretches came in. Their length is below 1.5 `rows`; a stretch shorter
    than half a piece is a piece of its own. Pieces are views wherever they lie within one segment.
    """

    def __init__(self, rows: int) -> None:
        self._rows = rows
        self._held: Segment | None = None  # fewer than two pieces

    def push(self, segment: Segment) -> Iterator[Segment]:
        """Take in a segment; give out the pieces that are settled."""
        if self._held is not None and not segment.continues:
            yield from self.finish()
        rest = segment
        while len(rest) + (0 if self._held is None else len(self._held)) >= 2 * self._rows:
            piece, rest = self._first(rest)
            yield piece
        if len(rest):
            self._held = rest if self._held is None else append(self._held, rest)

    def _first(self, rest: Segment) -> tuple[Segment, Segment]:
        """The next piece out of what is held and of `rest`, and what remains of `rest`."""
        held, self._held = self._held, None
        if held is None:
            return rest.part(0, self._rows), rest.part(self._rows, len(rest))
        missing = self._rows - len(held)
        if missing > 0:
            return append(held, rest.part(0, missing)), rest.part(missing, len(rest))
        if missing < 0:
            self._held = held.part(self._rows, len(held))
        return held.part(0, self._rows), rest

    def finish(self) -> Iterator[Segment]:
        """Give out what is left of a stretch at its end."""
        rest, self._held = self._held, None
        if rest is None:
            return
        if len(rest) >= self._rows + (self._rows + 1) // 2:
            yield rest.part(0, self._rows)
            rest = rest.part(self._rows, len(rest))
        yield rest


def append(first: Segment, second: Segment) -> Segment:
    """One segment out of two, the second of which continues the first."""
    both_have_omega = first.omega is not None and second.omega is not None
    return replace(
        first,
        theta=np.concatenate([first.theta, second.theta], axis=1),
        tau=np.concatenate([first.tau, second.tau], axis=1),
        omega=np.concatenate([first.omega, second.omega], axis=1) if both_have_omega else None,
    )
