"""When a payload changed, from the whitened rows around the change with all their memory.

Whitening remembers for as long as noise of the angles hides accelerations: a tenth of a second and
more. So a step of the payload at s reaches the whitened rows as its own column L⁻¹ (g h_s), and a
cell behind it holds both masses. Here each candidate s has its column, a mass before and a mass
after, and the likelihood of s is exact.

An acceleration that jumps at s is seen through the differences of the angles, and the torques'
residual with it:

    h_s(t) = Σ_p w_p ½ (t + p − s)₊²,  w the stencil's weights of the second derivative, p its
    points

A bracket holds the times whose likelihood ratio ξ is not beyond its 95 % quantile, P(ξ ≤ x) = (1 −
e^(−x/2))² (Hansen 2000, Econometrica 68).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators.whitening import Linearised, modelled
from algid.signals.differences import POINTS, Stencil
from algid.signals.segments import Segment, append
from algid.tracks.arm import IdentifiedArm
from algid.tracks.drift import Drift

STEP = 5e-3  # s, between candidates
REACH = 0.4  # s: how far a change may lie from where the cells have it
WIDEST = 1.5  # s: of log on both sides of a change by which it is placed
CLOSE = 0.8  # s: changes closer than that may be one with its jolt
MARGIN = 0.04  # s: of log at least before the first and after the last candidate
LIKELY = 7.352  # −2 ln(1 − √0.95)
SAFE = 25.0  # ξ beyond which a time is out of the question
CLUSTERED = 3.0  # times as much counts what is explained over the variance of clusters
CLUSTER = 0.2  # s: of rows that may err alike
_AT_ONCE = 32  # candidates whose columns are whitened together


@dataclass(frozen=True)
class ChangeTime:
    """Time of a change in s: the best one, its 95 % bracket, and the limits that it cannot pass.

    `gain` is what two masses explain beyond one, in squares of the rows' noise.
    """

    time: float
    bracket: tuple[float, float]
    safe: tuple[float, float]
    gain: float


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of a piece of log, n instants of two joints.

    Parameters
    ----------
    t : (n,), s, when the torques act
    dt : float, s
    g : (2, n), what a kilogram at the tip adds, over the torques' noise
    e : (2 n,), whitened, what the arm without payload leaves of the torque
    linear : Linearised, which whitens
    """

    t: FloatArray
    dt: float
    g: FloatArray
    e: FloatArray
    linear: Linearised

    def whitened(self, rows: FloatArray) -> FloatArray:
        """L⁻¹ (S, 2 n) of rows (S, 2, n)."""
        flat = np.ascontiguousarray(rows.swapaxes(1, 2)).reshape(rows.shape[0], -1)
        return self.linear.solve(flat)

    def steps(self, moments: FloatArray) -> FloatArray:
        """Columns (S, 2 n) of a kilogram that is grasped at each of `moments` (S,)."""
        h = step_response((self.t - moments[:, None]) / self.dt)
        return self.whitened(self.g * h[:, None])


def step_response(u: FloatArray) -> FloatArray:
    """h: what differences of a motion see, u samples behind a step of its acceleration."""
    weights = Stencil(1.0).weights[2]
    points = np.arange(POINTS) - POINTS // 2
    h = np.zeros(u.shape)
    for weight, point in zip(weights, points, strict=True):
        h += weight * 0.5 * np.maximum(u + point, 0.0) ** 2
    return np.where(u > POINTS, 1.0, h)


def rows_of(
    piece: Segment,
    arm: IdentifiedArm,
    drift: Drift,
    moments: Sequence[float],
    masses: Sequence[float],
) -> Rows:
    """Rows of a piece with payloads of `masses` kg that change at the known `moments` in s."""
    given = Stencil(piece.dt, arm.shift).torques(len(piece))
    t = piece.start + piece.dt * np.arange(given.start, given.stop) + arm.shift
    mass = np.asarray(masses)[np.searchsorted(np.asarray(moments), t, side="right")]
    # Each row at its own mass and friction: the angles' noise passes through the torque's partial
    # derivatives, which are theirs.
    c = arm.k[:, None] + np.outer(arm.unit, mass)
    c[arm.friction] += drift.at(t).T
    linear = arm.linearised(piece, c)
    J, _ = modelled(arm.model, c, linear.motion, piece.dt)
    g = np.einsum("q,aqn->an", arm.unit, J) / arm.noise.tau[:, None]
    rows = Rows(t, piece.dt, g, linear.columns[-1], linear)
    return replace(rows, e=rows.e + rows.whitened((mass * g)[None])[0])


def place(rows: Rows, low: float, high: float, variance: float) -> ChangeTime:
    """When between `low` and `high` s the payload changed, a mass before it and another behind.

    `variance` is that of the rows, at least.
    """
    moments = np.arange(low, high + STEP / 2, STEP)
    a = rows.whitened(rows.g[None])[0]
    information = max(float(a @ a), 1e-300)
    left = rows.e - (a @ rows.e / information) * a
    gains = np.empty(moments.size)
    for first in range(0, moments.size, _AT_ONCE):
        x = rows.steps(moments[first : first + _AT_ONCE])
        alone = np.sum(x * x, axis=1) - (x @ a) ** 2 / information
        gains[first : first + _AT_ONCE] = (x @ left) ** 2 / np.maximum(alone, 1e-9 * information)
    best = int(np.argmax(gains))
    gain = float(gains[best])
    variance = max(variance, (float(left @ left) - gain) / max(left.size - 3, 1))
    ratio = (gain - gains) / variance

    def within(limit: float) -> tuple[float, float]:
        likely = moments[ratio <= limit]
        return float(likely[0]) - STEP, float(likely[-1]) + STEP

    worth = _worth(rows, left, a / np.sqrt(information), float(moments[best]))
    return ChangeTime(float(moments[best]), within(LIKELY), within(SAFE), worth)


def _worth(rows: Rows, left: FloatArray, a: FloatArray, moment: float) -> float:
    """What two masses explain of `left` (2 n,), the rows less one mass.

    Rows of a cluster may err alike, as where a joint turns back and friction is not of its model's
    shape. Over the variance of the clusters' scores (Liang & Zeger 1986) it has to be a third as
    much, since these few scores hold what a change leaves of its neighbours too.
    `a` (2 n,) is the column of one mass, of length one.
    """
    x = rows.steps(np.array([moment]))[0]
    x -= (a @ x) * a
    information, score = max(float(x @ x), 1e-300), float(x @ left)
    two = left - score / information * x
    every = 2 * max(1, round(CLUSTER / rows.dt))
    scores = np.add.reduceat(x * two, np.arange(0, left.size, every))
    alike = max(information, float(scores @ scores))
    return score**2 * min(1 / information, CLUSTERED / alike)


def explained(rows: Rows, moments: FloatArray) -> float:
    """Squares of the rows that masses explain which change at `moments` (S,)."""
    X = np.concatenate([rows.whitened(rows.g[None]), rows.steps(moments)])
    fitted = np.linalg.lstsq(X.T, rows.e, rcond=None)[0]
    return float(np.sum((fitted @ X) ** 2))


def cut_to(segment: Segment, start: float, end: float, shift: float) -> Segment | None:
    """The samples that give the torques from `start` to `end` s, their stencils' included.

    None where it has none.

    `shift` is the time in s after which a logged torque acts.
    """
    given = Stencil(segment.dt, shift).torques(len(segment))  # the others serve the stencil
    first = round((start - segment.start) / segment.dt) - given.start
    last = round((end - segment.start) / segment.dt) + len(segment) - given.stop
    first, last = max(0, first), min(len(segment), last)
    if last - first <= 1:
        return None
    return segment.part(first, last)


@dataclass(frozen=True)
class Changes:
    """Changes of a log, and what it weighs between them: `masses` (kg) are one more."""

    places: tuple[ChangeTime, ...]
    masses: tuple[float, ...]

    def merged(self, first: int, last: int, *places: ChangeTime) -> Changes:
        """With these changes, one or none, for those from `first` to `last`.

        Of the masses between them only that before the first and that behind the last stay, and
        without a change the one before.
        """
        masses = self.masses[: first + 1] + self.masses[last + 1 :][1 - len(places) :]
        return Changes(self.places[:first] + places + self.places[last + 1 :], masses)


@dataclass(frozen=True)
class Confirmation:
    """Evidence of changes in the rows about them.

    Parameters
    ----------
    source : callable
        Gives a fresh iterable of the log's `Segment`.
    arm : IdentifiedArm
    drift : Drift
    ends : s, of the log
    penalty : what a change has to explain, in squares of the rows' noise
    variance : of the rows, one at least
    """

    source: Callable[[], Iterable[Segment]]
    arm: IdentifiedArm
    drift: Drift
    ends: tuple[float, float]
    penalty: float
    variance: float

    def of(self, changes: Changes) -> list[ChangeTime]:
        """Those of the changes, as cells have them, that the rows bear out, each where they do."""
        count = None
        while changes.places and len(changes.places) != count:
            count = len(changes.places)
            changes = self._placed(self._merged(self._placed(changes)))
            # Drop those that explain too little, of neighbours the least first.
            gains = [np.inf] + [one.gain for one in changes.places] + [np.inf]
            for at in reversed(range(len(changes.places))):
                before, own, after = gains[at : at + 3]
                if own < self.penalty and own <= min(before, after):
                    changes = changes.merged(at, at)
        return list(changes.places)

    def _rows(
        self, changes: Changes, groups: Sequence[tuple[int, int]]
    ) -> Iterator[tuple[tuple[int, int], Rows]]:
        """The rows about each group of changes, from its first to its last, in one pass.

        They hold the masses about the group, and no other.
        """
        safe = [(-np.inf, self.ends[0]), *(one.safe for one in changes.places), (self.ends[1], 0)]
        times = [one.time for one in changes.places]
        spans = []
        for first, last in groups:
            start, end = safe[first][1], safe[last + 2][0]
            spans.append((max(start, times[first] - WIDEST), min(end, times[last] + WIDEST)))
        for place, piece in windows(self.source(), spans, self.arm.shift):
            first, last = groups[place]
            moments, masses = times[first : last + 1], changes.masses[first : last + 2]
            yield groups[place], rows_of(piece, self.arm, self.drift, moments, masses)

    def _placed(self, changes: Changes) -> Changes:
        """Each change where the rows about it have it; where they are too few, as it was."""
        places = list(changes.places)
        for (at, _), rows in self._rows(changes, [(one, one) for one in range(len(places))]):
            time = places[at].time
            low = max(time - REACH, float(rows.t[0]) + MARGIN)
            high = min(time + REACH, float(rows.t[-1]) - MARGIN)
            if low < high:
                places[at] = place(rows, low, high, self.variance)
        return replace(changes, places=tuple(places))

    def _merged(self, changes: Changes) -> Changes:
        """Merge close changes where their rows need only one: a jolt is no change of payload."""
        times = np.array([one.time for one in changes.places])
        close = [(at, at + 1) for at in np.flatnonzero(np.diff(times) < CLOSE).tolist()]
        places: dict[tuple[int, int], ChangeTime] = {}
        for (first, last), rows in self._rows(changes, close):
            low = max(times[first] - MARGIN, float(rows.t[0]) + MARGIN)
            high = min(times[last] + MARGIN, float(rows.t[-1]) - MARGIN)
            if low < high:
                one = place(rows, low, high, self.variance)
                both = explained(rows, times[[first, last]])
                if both - explained(rows, np.array([one.time])) < self.penalty:
                    places[first, last] = one
        following = len(changes.places)
        for (first, last), one in sorted(places.items(), reverse=True):
            if last < following:  # of pairs that share a change, the later one
                changes, following = changes.merged(first, last, one), first
        return changes


def windows(
    log: Iterable[Segment], spans: Sequence[tuple[float, float]], shift: float
) -> Iterator[tuple[int, Segment]]:
    """Numbered pieces of a log within `spans` (s), in one pass.

    What a gap cuts comes in parts.
    """
    held: dict[int, Segment] = {}

    def cut(at: int) -> Iterator[tuple[int, Segment]]:
        piece = cut_to(held.pop(at), *spans[at], shift)
        if piece is not None and len(piece) > 2 * POINTS:
            yield at, piece

    for segment in log:
        spare = POINTS * segment.dt + abs(shift)  # for the stencils
        for at, (start, end) in enumerate(spans):
            ends = np.array([start - spare, end + spare]) - segment.start
            first, last = np.clip(np.rint(ends / segment.dt), 0, len(segment)).astype(int).tolist()
            if at in held and not (segment.continues and first < last):
                yield from cut(at)
            if first < last:
                part = segment.part(first, last)
                held[at] = append(held[at], part) if at in held else part
    for at in list(held):
        yield from cut(at)
