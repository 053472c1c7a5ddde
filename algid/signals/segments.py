"""Uniform stretches of a log: what every estimator works on.

A log is cut where samples are missing for long and put on a uniform time base where its stamps
jitter, by the cubic through the four recorded samples around each instant, once samples that stand
all but on top of one another are where they belong (`algid.signals.spacing`). What comes out does
not depend on the blocks in which the log was read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise, permutations

import numpy as np

from algid.arm import FloatArray, keep_arrays
from algid.base.criteria import CUT
from algid.log import IntArray, Log, join, joined, signals_of, usual_period
from algid.signals.spacing import spaced

_ENDLESS = 1 << 62  # samples: more than any stretch has
PERIOD_SAMPLES = 4096  # the first samples, from which the period is taken
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
    reference : (2, N) float64, rad, or None
        Angles that a controller was to follow, where the log has them; NaN where there were none.
    """

    start: float
    dt: float
    theta: FloatArray
    tau: FloatArray
    omega: FloatArray | None = None
    continues: bool = False
    reference: FloatArray | None = None

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
            continues=self.continues or first > 0,
            **signals_of(self, lambda signal: signal[:, first:last]),
        )


def segments(blocks: Iterable[Log]) -> Iterator[Segment]:
    """Uniform segments of the log that comes in `blocks`, in time order.

    The period is the mean over the log's first samples, gaps left out. A gap of more than
    `CUT` periods starts a new stretch; shorter ones are filled by interpolation.
    """
    source = (block for block in blocks if len(block))
    first: list[Log] = []
    while sum(map(len, first)) < PERIOD_SAMPLES and (block := next(source, None)) is not None:
        first.append(block)
    if not first:
        return
    head = join(first)  # so that the period does not depend on how the blocks were cut
    even = spaced([head], usual_period(head.stamp_ns[:PERIOD_SAMPLES]))
    stamps = np.concatenate([log.stamp_ns for log in even])[:PERIOD_SAMPLES]
    steps, dt = np.diff(stamps).astype(np.float64), usual_period(stamps)
    near = steps[np.abs(steps - 1e9 * dt) <= 0.5e9 * dt]
    if 2 * near.size > steps.size:
        dt = float(near.mean()) * 1e-9
    yield from _resampled(spaced(chain([head], source), dt), int(head.stamp_ns[0]), dt)


def stretches(blocks: Iterable[Log]) -> list[Segment]:
    """The same segments, each with those that continue it: one from gap to gap."""
    return list(pieces(segments(blocks), _ENDLESS))


def _resampled(blocks: Iterable[Log], origin_ns: int, dt: float) -> Iterator[Segment]:
    """Blocks on the time base; the last samples wait until their successors are known."""
    held: list[Log] = []
    anchor, emitted = 0.0, -1  # time of a stretch's first sample, and how many were given out
    for block in chain(blocks, [None]):
        log = join(held if block is None else [*held, block])
        t = (log.stamp_ns - origin_ns) * 1e-9
        gaps = np.flatnonzero(np.diff(log.stamp_ns) * 1e-9 > CUT * dt) + 1
        edges = [0, *gaps.tolist(), len(log)]
        for first, last in pairwise(edges):
            if first or emitted < 0:
                anchor, emitted = float(t[first]), 0
            # of a stretch that goes on the last sample but one is the last that is determined
            ended = block is None or last < len(log)
            reach = t[last - 1] + EVEN * dt if ended else t[max(first, last - 2)] - EVEN * dt
            count = int(np.floor((reach - anchor) / dt)) + 1 - emitted
            if count > 0 and last - first >= 4:
                grid = anchor + dt * np.arange(emitted, emitted + count)
                yield replace(
                    _at(log.part(first, last), t[first:last], grid, dt), continues=emitted > 0
                )
                emitted += count
        held = [log.part(max(edges[-2], len(log) - 4), len(log))]


def _at(log: Log, t: FloatArray, grid: FloatArray, dt: float) -> Segment:
    """A log with samples at `t` at the instants of `grid`."""
    first = int(np.searchsorted(t, grid[0] - 0.5 * dt))
    own = slice(first, first + grid.size)
    if t[own].size == grid.size and np.abs(t[own] - grid).max() <= EVEN * dt:
        return Segment(float(grid[0]), dt, **signals_of(log, lambda signal: signal[:, own]))
    places, weights = _cubic(t, grid)
    between = signals_of(log, lambda signal: np.sum(weights * signal.take(places, axis=1), axis=1))
    return Segment(float(grid[0]), dt, **between)


def _cubic(t: FloatArray, grid: FloatArray) -> tuple[IntArray, FloatArray]:
    """Lagrange's cubic around each instant of `grid`: its four samples and their weights (4, n)."""
    corner = np.clip(np.searchsorted(t, grid, side="right") - 2, 0, t.size - 4)
    places = np.arange(4)[:, None] + corner
    nodes, weights = t[places], np.ones(places.shape)
    for node, other in permutations(range(4), 2):
        weights[node] *= (grid - nodes[other]) / (nodes[node] - nodes[other])
    return places, weights


def pieces(
    source: Iterable[Segment], rows: int | Callable[[float], int], shortest: int = 1
) -> Iterator[Segment]:
    """Cut each stretch into pieces of `rows` samples, less those below `shortest`.

    A rest shorter than half a piece joins the last one. The pieces do not depend on how the
    stretches came in. Their length is below 1.5 `rows`; a stretch shorter than half a piece is a
    piece of its own.

    Parameters
    ----------
    source : iterable of `Segment`
    rows : int or callable
        Samples, or what gives them from the period in s.
    shortest : int
    """
    held: Segment | None = None
    size = 0
    for segment in chain(source, [None]):
        done: list[Segment] = []
        if held is not None and (segment is None or not segment.continues):
            if len(held) >= size + (size + 1) // 2:
                done.append(held.part(0, size))
                held = held.part(size, len(held))
            done.append(held)
            held = None
        if segment is not None:
            held = segment if held is None else append(held, segment)
            size = rows if isinstance(rows, int) else rows(held.dt)
            while len(held) >= 2 * size:
                done.append(held.part(0, size))
                held = held.part(size, len(held))
        for piece in done:
            if len(piece) >= shortest:
                yield piece


def spread_pieces(usable: Iterable[Segment], count: int, rows: int) -> tuple[list[Segment], bool]:
    """Copies of evenly spread pieces of a log, from one pass over it.

    Parameters
    ----------
    usable : iterable of `Segment`
    count : int
        How many are kept of a long log, up to twice as many. What was cut from a block does not
        hold it.
    rows : int
        Samples of a whole piece. Of shorter ones, as a log with many gaps has, so many are kept
        that they hold as many samples.

    Returns
    -------
    The pieces, and whether they are all there were. Where some were left out none continues the
    one before.
    """
    kept: list[Segment] = []
    stride = 1
    for index, piece in enumerate(usable):
        if index % stride:
            continue
        follows = piece.continues and stride == 1
        kept.append(replace(piece, continues=follows, **signals_of(piece, np.copy)))
        if len(kept) > 2 * count and sum(map(len, kept)) > 2 * count * rows:
            kept, stride = [replace(other, continues=False) for other in kept[::2]], 2 * stride
    return kept, stride == 1


def append(first: Segment, second: Segment) -> Segment:
    """One segment out of two, the second of which continues the first."""
    return replace(first, **joined([first, second]))
