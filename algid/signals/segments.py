"""Uniform stretches of a log: what every estimator works on.

A log is cut where samples are missing for long and put on a uniform time base where its stamps
jitter, by the cubic through the four recorded samples around each instant, once samples that stand
all but on top of one another are where they belong (`algid.signals.spacing`). What comes out does
not depend on the blocks in which the log was read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from algid.arm import FloatArray, keep_arrays
from algid.base.criteria import CUT
from algid.log import IntArray, Log, join, joined, usual_period
from algid.signals.spacing import spaced

PERIOD_SAMPLES = 4096  # the first samples, from which the period is taken
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
        omega, reference = self.omega, self.reference
        if omega is not None:
            omega = omega[:, first:last]
        if reference is not None:
            reference = reference[:, first:last]
        return replace(
            self,
            start=self.start + first * self.dt,
            theta=self.theta[:, first:last],
            tau=self.tau[:, first:last],
            omega=omega,
            reference=reference,
            continues=self.continues or first > 0,
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
    stamps = _first_stamps(spaced([head], usual_period(head.stamp_ns[:PERIOD_SAMPLES])))
    steps, dt = np.diff(stamps).astype(np.float64), usual_period(stamps)
    near = steps[np.abs(steps - 1e9 * dt) <= 0.5e9 * dt]
    if 2 * near.size > steps.size:
        dt = float(near.mean()) * 1e-9
    sampler = _Sampler(int(head.stamp_ns[0]), dt)
    for block in spaced(chain([head], source), dt):
        yield from sampler.push(block)
    yield from sampler.finish()


def stretches(blocks: Iterable[Log]) -> list[Segment]:
    """The same segments, each with those that continue it: one from gap to gap."""
    whole: list[Segment] = []
    for segment in segments(blocks):
        if segment.continues and whole:
            whole[-1] = append(whole[-1], segment)
        else:
            whole.append(segment)
    return whole


def _first_stamps(blocks: Iterable[Log]) -> IntArray:
    """The first `PERIOD_SAMPLES` stamps; the other signals are not copied."""
    stamps: list[IntArray] = []
    for block in blocks:
        stamps.append(block.stamp_ns)
        if sum(map(len, stamps)) >= PERIOD_SAMPLES:
            break
    return np.concatenate(stamps)[:PERIOD_SAMPLES]


class _Sampler:
    """Resample blocks on the time base; the last samples wait until their successors are known."""

    def __init__(self, origin_ns: int, dt: float) -> None:
        self._origin_ns = origin_ns
        self._dt = dt
        self._pending: Log | None = None
        self._anchor = 0.0  # time of the stretch's first sample
        self._emitted = 0  # grid points of the stretch that have been given out

    def push(self, block: Log) -> Iterator[Segment]:
        if self._pending is None:
            self._anchor = float(self._time(block.stamp_ns[0]))
            yield from self._settle(block)
            return
        yield from self._settle(join([self._pending, block.part(0, _BRIDGE)]))
        if len(block) > _BRIDGE:  # what is held back now is the block's own: no copy
            yield from self._settle(block.part(_BRIDGE - len(self._pending), len(block)))

    def _settle(self, held: Log) -> Iterator[Segment]:
        gaps = []
        steps = np.diff(held.stamp_ns)
        if steps.max(initial=0) * 1e-9 > CUT * self._dt:
            gaps = (np.flatnonzero(steps * 1e-9 > CUT * self._dt) + 1).tolist()
        edges = [0, *gaps, len(held)]
        for first, last in pairwise(edges[:-1]):
            yield from self._stretch(held.part(first, last), ends=True)
            self._anchor, self._emitted = float(self._time(held.stamp_ns[last])), 0
        self._pending = held.part(edges[-2], edges[-1])
        yield from self._stretch(self._pending, ends=False)
        self._pending = self._pending.part(max(0, len(self._pending) - 4), len(self._pending))

    def finish(self) -> Iterator[Segment]:
        if self._pending is not None:
            yield from self._stretch(self._pending, ends=True)

    def _time(self, stamp_ns: IntArray) -> FloatArray:
        return (stamp_ns - self._origin_ns) * 1e-9

    def _stretch(self, log: Log, *, ends: bool) -> Iterator[Segment]:
        """Grid points that `log` determines: up to its last sample but one, or all if `ends`."""
        t = self._time(log.stamp_ns)
        if ends:
            reach = t[-1] + EVEN * self._dt
        else:
            reach = t[max(0, t.size - 2)] - EVEN * self._dt
        count = int(np.floor((reach - self._anchor) / self._dt)) + 1 - self._emitted
        if count <= 0 or t.size < 4:
            return
        grid = np.arange(self._emitted, self._emitted + count, dtype=np.float64)
        grid *= self._dt
        grid += self._anchor
        first = int(np.searchsorted(t, grid[0] - 0.5 * self._dt))
        own = slice(first, first + count)
        even = _alike(t[own], grid, EVEN * self._dt)
        weights: list[tuple[IntArray, FloatArray]] = []
        if not even:
            weights = _cubic(t, grid)

        def take(signal: FloatArray) -> FloatArray:
            if even:
                return signal[:, own]
            values = np.zeros((2, count))
            for place, weight in weights:
                values += weight * signal[:, place]
            return values

        omega = reference = None
        if log.omega is not None:
            omega = take(log.omega)
        if log.reference is not None:
            reference = take(log.reference)
        yield Segment(
            start=float(grid[0]),
            dt=self._dt,
            theta=take(log.theta),
            tau=take(log.tau),
            omega=omega,
            reference=reference,
            continues=self._emitted > 0,
        )
        self._emitted += count


def _alike(t: FloatArray, grid: FloatArray, reach: float) -> bool:
    """Whether there are as many times as instants, each within `reach` of its own."""
    if t.size != grid.size:
        return False
    off = t - grid
    return bool(off.max() <= reach and off.min() >= -reach)


def _cubic(t: FloatArray, grid: FloatArray) -> list[tuple[IntArray, FloatArray]]:
    """Lagrange's cubic around each instant of `grid`: its four samples and their weights."""
    corner = np.clip(np.searchsorted(t, grid, side="right") - 2, 0, t.size - 4)
    nodes = t[corner[:, None] + np.arange(4)]
    weights: list[tuple[IntArray, FloatArray]] = []
    for node in range(4):
        weight: FloatArray = np.ones(grid.size)
        for other in range(4):
            if other != node:
                weight *= (grid - nodes[:, other]) / (nodes[:, node] - nodes[:, other])
        weights.append((corner + node, weight))
    return weights


def pieces(source: Iterable[Segment], rows: int, shortest: int = 1) -> Iterator[Segment]:
    """Cut each stretch into pieces of `rows` samples, less those below `shortest`: see `Cutter`."""
    cutter = Cutter(rows)
    for segment in source:
        for piece in cutter.push(segment):
            if len(piece) >= shortest:
                yield piece
    for piece in cutter.finish():
        if len(piece) >= shortest:
            yield piece


def pieces_of(source: Iterable[Segment], seconds: float, least: int = 1) -> Iterator[Segment]:
    """Cut each stretch of a log into pieces of `seconds` and `least` samples: see `Cutter`."""
    cutter: Cutter | None = None
    for segment in source:
        if cutter is None:
            cutter = Cutter(max(least, round(seconds / segment.dt)))
        yield from cutter.push(segment)
    if cutter is not None:
        yield from cutter.finish()


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
        copy = _copied(piece)
        kept.append(replace(copy, continues=piece.continues and stride == 1))
        if len(kept) > 2 * count and sum(map(len, kept)) > 2 * count * rows:
            kept, stride = [replace(other, continues=False) for other in kept[::2]], 2 * stride
    return kept, stride == 1


def _copied(piece: Segment) -> Segment:
    """A piece with arrays of its own."""
    omega, reference = piece.omega, piece.reference
    if omega is not None:
        omega = omega.copy()
    if reference is not None:
        reference = reference.copy()
    return replace(
        piece, theta=piece.theta.copy(), tau=piece.tau.copy(), omega=omega, reference=reference
    )


class Cutter:
    """Cuts each stretch into pieces of `rows` samples.

    A rest shorter than half a piece joins the last one.

    The pieces do not depend on how the stretches came in. Their length is below 1.5 `rows`; a
    stretch shorter than half a piece is a piece of its own. Pieces are views wherever they lie
    within one segment.
    """

    def __init__(self, rows: int) -> None:
        self._rows = rows
        self._held: Segment | None = None  # fewer than two pieces

    def push(self, segment: Segment) -> Iterator[Segment]:
        """Take in a segment; give out the pieces that are settled."""
        if self._held is not None and not segment.continues:
            yield from self.finish()
        if self._held is None:
            yield from self._pieces_of(segment)
            return
        held = self._held
        while len(held) + len(segment) >= 2 * self._rows:
            if len(held) < self._rows:
                missing = self._rows - len(held)
                yield append(held, segment.part(0, missing))
                yield from self._pieces_of(segment.part(missing, len(segment)))
                return
            yield held.part(0, self._rows)
            held = held.part(self._rows, len(held))
        self._held = append(held, segment)

    def _pieces_of(self, segment: Segment) -> Iterator[Segment]:
        """Whole pieces of a segment that follows no other; holds what is left."""
        while len(segment) >= 2 * self._rows:
            yield segment.part(0, self._rows)
            segment = segment.part(self._rows, len(segment))
        self._held = segment

    def finish(self) -> Iterator[Segment]:
        """Give out what is left of a stretch at its end."""
        rest, self._held = self._held, None
        if rest is None:
            return
        if len(rest) >= self._rows + (self._rows + 1) // 2:
            yield rest.part(0, self._rows)
            rest = rest.part(self._rows, len(rest))
        yield rest


def settled(
    source: Iterable[Segment], reach: Callable[[float], int]
) -> Iterator[tuple[Segment, int, int]]:
    """A log's segments with what follows and precedes: what comes of them no cut changes.

    Yields
    ------
    A segment, its first sample that is new, and the end of those that have `reach` samples (by the
    period in s) behind them or are the last of a stretch; as many stand before the first
    """
    held: Segment | None = None
    done = 0  # samples of what is held that were given out
    for segment in chain(source, [None]):
        if held is not None and (segment is None or not segment.continues):
            yield held, done, len(held)
            held = None
        if segment is None:
            return
        held, done = (segment, 0) if held is None else (append(held, segment), done)
        near = reach(held.dt)
        if len(held) - near > max(done, near):
            yield held, done, len(held) - near
            first = max(0, len(held) - 2 * near)
            held, done = held.part(first, len(held)), len(held) - near - first


def append(first: Segment, second: Segment) -> Segment:
    """One segment out of two, the second of which continues the first."""
    return replace(
        first,
        theta=np.concatenate([first.theta, second.theta], axis=1),
        tau=np.concatenate([first.tau, second.tau], axis=1),
        omega=joined([first.omega, second.omega]),
        reference=joined([first.reference, second.reference]),
    )
