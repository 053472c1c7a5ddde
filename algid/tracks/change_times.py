"""When a payload changed, from the whitened rows around the change with all their memory.

Whitening remembers for as long as noise of the angles hides accelerations: a tenth of a second and
more. So a step of the payload at s reaches the whitened rows as its own column L⁻¹ (g h_s), and a
cell behind it holds both masses. Here each candidate s has its column, a mass before and a mass
after, and the likelihood of s is exact.

An acceleration that jumps at s is seen through the differences of the angles, and the torques'
residual with it:

    h_s(t) = Σ_p w_p ½ (t + p − s)₊²,  w the stencil's weights of the second derivative, p its
    points

Those differences mix the accelerations from before and behind the jump −M⁻¹ m g, with M before it
and m the step of the mass. What a kilogram adds behind it is therefore not g as they see it, but

    (1 + (1 − h) m G M⁻¹)⁻¹ g,  G the mass matrix of a kilogram at the tip

A bracket holds the times whose likelihood ratio ξ is not beyond its 95 % quantile, P(ξ ≤ x) = (1 −
e^(−x/2))² (Hansen 2000, Econometrica 68).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.estimators.whitening import Linearised, modelled, whiten
from algid.model import inertia
from algid.signals.differences import POINTS, Stencil
from algid.signals.segments import Segment, append
from algid.tracks.arm import IdentifiedArm
from algid.tracks.cells import CELL
from algid.tracks.change_points import PENALTY, SHORTEST
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
_MOST_MOVES = 6  # of a change, until it stays
_AT_ONCE = 32  # candidates whose columns are whitened together
_FAR = 2**40  # samples: more than any log has


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
    jump : (2, 2, n), m G M⁻¹ in units of the torques' noise: see above
    linear : Linearised, which whitens
    """

    t: FloatArray
    dt: float
    g: FloatArray
    e: FloatArray
    jump: FloatArray
    linear: Linearised

    def whitened(self, rows: FloatArray) -> FloatArray:
        """L⁻¹ (S, 2 n) of rows (S, 2, n)."""
        return whiten(self.linear.factor, rows)

    def steps(self, moments: FloatArray) -> FloatArray:
        """Columns (S, 2 n) of a kilogram that is grasped at each of `moments` (S,)."""
        h = step_response((self.t - moments[:, None]) / self.dt)
        columns = self.g * h[:, None]
        at, n = np.nonzero((h != 0) & (h != 1))  # where differences mix both accelerations
        mixed, share = h[at, n], (1 - h[at, n]) * self.jump[:, :, n]
        (a, b), (c, d) = share + np.eye(2)[:, :, None]
        first, second = self.g[:, n] * mixed / (a * d - b * c)
        columns[at, :, n] = np.transpose([d * first - b * second, a * second - c * first])
        return self.whitened(columns)


def step_response(u: FloatArray) -> FloatArray:
    """h: what differences of a motion see, u samples behind a step of its acceleration."""
    behind = np.maximum(np.add.outer(np.arange(POINTS) - POINTS // 2, u), 0.0)
    h = np.tensordot(Stencil(1.0).weights[2], 0.5 * behind**2, axes=1)
    return np.where(u > POINTS, 1.0, h)


def rows_of(
    piece: Segment,
    arm: IdentifiedArm,
    drift: Drift,
    moments: Sequence[float],
    masses: Sequence[float],
    *,
    settle: bool = True,
) -> Rows:
    """Rows of a piece with payloads of `masses` kg that change at the known `moments` in s.

    `settle` is that of `IdentifiedArm.linearised`.
    """
    t = arm.times(piece) + arm.shift
    mass = np.asarray(masses)[np.searchsorted(np.asarray(moments), t, side="right")]
    # Each row at its own mass and friction: the angles' noise passes through the torque's partial
    # derivatives, which are theirs.
    c = arm.k[:, None] + np.outer(arm.unit, mass)
    c[arm.friction] += drift.at(t).T
    linear = arm.linearised(piece, c, settle=settle)
    J, _ = modelled(arm.model, c, linear.motion, piece.dt)
    g = np.einsum("q,aqn->an", arm.unit, J) / arm.noise.tau[:, None]
    before, theta = arm.k + arm.unit * masses[0], linear.motion.theta
    G, M = (np.array(inertia(arm.model, one, theta)) for one in (arm.unit, before))
    share = np.linalg.solve(M.transpose(2, 1, 0), G.transpose(2, 1, 0)).transpose(2, 1, 0)
    share = share * arm.noise.tau[None, :, None] / arm.noise.tau[:, None, None]
    jump = (masses[-1] - masses[0]) * share
    rows = Rows(t, piece.dt, g, linear.columns[-1], jump, linear)
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
        own = np.sum(x * x, axis=1) - (x @ a) ** 2 / information
        gains[first : first + _AT_ONCE] = (x @ left) ** 2 / np.maximum(own, 1e-9 * information)
    best = int(np.argmax(gains))
    gain = float(gains[best])
    variance = max(variance, (float(left @ left) - gain) / max(left.size - 3, 1))
    ratio = (gain - gains) / variance

    likely, safe = (
        (float(moments[near][0]) - STEP, float(moments[near][-1]) + STEP)
        for near in (ratio <= LIKELY, ratio <= SAFE)
    )

    # Rows of a cluster may err alike, as where a joint turns back and friction is not of its
    # model's shape. Over the variance of the clusters' scores (Liang & Zeger 1986) a change has to
    # explain a third as much, since these few scores hold what it leaves of its neighbours too.
    x = rows.steps(moments[best : best + 1])[0]
    x -= (a @ x / information) * a
    alone, score = max(float(x @ x), 1e-300), float(x @ left)
    every = 2 * max(1, round(CLUSTER / rows.dt))
    scores = np.add.reduceat(x * (left - score / alone * x), np.arange(0, left.size, every))
    alike = max(alone, float(scores @ scores))
    worth = score**2 * min(1 / alone, CLUSTERED / alike)
    return ChangeTime(float(moments[best]), likely, safe, worth)


def explained(rows: Rows, moments: FloatArray) -> float:
    """Squares of the rows that masses explain which change at `moments` (S,)."""
    X = np.concatenate([rows.whitened(rows.g[None]), rows.steps(moments)])
    fitted = np.linalg.lstsq(X.T, rows.e, rcond=None)[0]
    return float(np.sum((fitted @ X) ** 2))


def confirmed(
    source: Callable[[], Iterable[Segment]],
    arm: IdentifiedArm,
    drift: Drift,
    ends: tuple[float, float],
    variance: float,
    changes: Sequence[ChangeTime],
    weighed: Sequence[float],
) -> list[ChangeTime]:
    """Those of the changes, as cells have them, that the rows bear out, each where they do.

    Parameters
    ----------
    source : callable
        Gives a fresh iterable of the log's `Segment`.
    arm : IdentifiedArm
    drift : Drift
    ends : s, of the log
    variance : of the rows, one at least
    changes : as cells have them
    weighed : masses in kg between them, one more
    """
    places, masses = list(changes), list(weighed)
    penalty, count = PENALTY * variance, None

    def rows_about(
        groups: Sequence[tuple[int, int]], *, settle: bool = True
    ) -> Iterator[tuple[tuple[int, int], Rows]]:
        """The rows about each group of changes, from its first to its last, in one pass.

        They hold the masses about the group, and no other.
        """
        safe = [(-np.inf, ends[0]), *(one.safe for one in places), (ends[1], 0)]
        times, spans = [one.time for one in places], []
        for first, last in groups:
            start = max(safe[first][1], times[first] - WIDEST)
            spans.append((start, min(safe[last + 2][0], times[last] + WIDEST)))
        for at, piece in windows(source(), spans, arm.shift):
            first, last = groups[at]
            if len(piece) > 2 * POINTS:
                own = times[first : last + 1], masses[first : last + 2]
                yield groups[at], rows_of(piece, arm, drift, *own, settle=settle)

    def within(rows: Rows, low: float, high: float) -> ChangeTime | None:
        """The change between `low` and `high` s; None where the rows have not both its sides.

        A hole in the log is such a place: there cells alone show a change.
        """
        middle = (low + high) / 2
        low, high = max(low, float(rows.t[0]) + MARGIN), min(high, float(rows.t[-1]) - MARGIN)
        return place(rows, low, high, variance) if low < middle < high else None

    def shift(*, settle: bool = True) -> None:
        """Move each change to where the rows about it have it, which depend on where it was."""
        left = list(range(len(places)))
        for number in range(_MOST_MOVES):
            moved = []
            for (at, _), rows in rows_about([(at, at) for at in left], settle=settle):
                time, (low, high) = places[at].time, places[at].safe
                reach = REACH if number == 0 else min(REACH, 2 * max(time - low, high - time))
                places[at] = within(rows, time - reach, time + reach) or places[at]
                if abs(places[at].time - time) > STEP / 2:
                    moved.append(at)
            left = moved

    while places and len(places) != count:
        count = len(places)
        shift()
        # Close changes whose rows need only one become one: a jolt is no change of payload. So do
        # those between which nothing can be carried: a jolt of a heavy payload needs both.
        times = np.array([one.time for one in places])
        close = [(at, at + 1) for at in np.flatnonzero(np.diff(times) < CLOSE).tolist()]
        single: dict[int, ChangeTime] = {}
        for (first, last), rows in rows_about(close):
            one = within(rows, times[first] - MARGIN, times[last] + MARGIN)
            if one is not None:
                both = explained(rows, times[[first, last]])
                short = times[last] - times[first] < SHORTEST * CELL
                if short or both - explained(rows, np.array([one.time])) < penalty:
                    single[first] = one
        following = len(places)
        for first, one in sorted(single.items(), reverse=True):
            if first + 1 < following:  # of pairs that share a change, the later one
                places[first : first + 2], following = [one], first
                del masses[first + 1]
        shift()
        # Drop those that explain too little, of neighbours the least first.
        gains = [np.inf] + [one.gain for one in places] + [np.inf]
        for at in reversed(range(len(places))):
            before, own, after = gains[at : at + 3]
            if own < penalty and own <= min(before, after):
                del places[at], masses[at + 1]
    # A trajectory of the fit that holds the masses draws a heavy one's change to where it was.
    shift(settle=False)
    return places


def windows(
    log: Iterable[Segment], spans: Sequence[tuple[float, float]], shift: float
) -> Iterator[tuple[int, Segment]]:
    """Numbered pieces of a log that give the torques within `spans` (s), in one pass.

    They hold their stencils' samples. What a gap cuts comes in parts. `shift` is the time in s
    after which a logged torque acts.
    """
    held: dict[int, Segment] = {}
    for segment in log:
        given = Stencil(segment.dt, shift).torques(_FAR)  # the others serve the stencil
        for at, span in enumerate(spans):
            start, end = ((time - segment.start) / segment.dt for time in span)
            reach = round(start) - given.start, round(end) + _FAR - given.stop
            first, last = np.clip(reach, 0, len(segment)).tolist()
            if at in held and not (segment.continues and first < last):
                yield at, held.pop(at)
            if first < last:
                part = segment.part(first, last)
                held[at] = append(held[at], part) if at in held else part
    yield from held.items()
