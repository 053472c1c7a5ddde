"""Where a log's stretches of constant payload begin and end.

The best cut into stretches comes by pruned dynamic programming. A stretch from cell a to b costs
−(ΣB)²/ΣA, twice its log likelihood ratio against nothing; each cut costs a penalty. Cuts that can
never be the last one again, whatever the mass, are dropped (Maidstone, Hocking, Rigaill & Fearnhead
2017): cost grows linearly with the cells, also where nothing changes.

A penalty holds for white rows; what the arm's model lacks makes neighbouring cells err alike.
Masses of neighbouring blocks of cells differ by 1/A + 1/A' in variance where rows are white. Slow
errors (friction that the model lacks, play, a gear's ripple) make long blocks differ by far more;
the largest excess over block lengths up to a second is what intervals and changes have to stand up
to. Medians are taken, so that a few changes of payload do not pass for errors.

A grasp jolts the cells it falls among: no stencil follows the jump of the acceleration. It is one
change, wherever its jolt would put one; cells within `GUARD` of it tell neither mass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.tracks.bins import Cells, IdentifiedArm

SPANS = (1, 2, 3, 5, 8, 12, 18, 25, 35, 50)  # cells: 0.02 to 1 s
LIGHTEST = 1e-6  # information of a block that tells anything, of the largest
FEWEST = 8  # pairs of blocks that tell a variance
_MEDIAN = 0.454936  # of a squared standard normal
_SPREAD = 2.33  # standard deviation of the median of n squares over _MEDIAN, times √n
_SURE = 4.0  # of those standard deviations: white rows pass once in 30,000 spans

GUARD = 3  # cells left out on both sides of a change, which lies somewhere among them
# of a change's place: squares beyond those of the best one, noise of the cells left out included
UNLIKELY = 25.0
REACH = 15  # cells: how far a jolt may have put a change from its place
# cells more on both sides of a change's surest ends, over which the smoothed trajectory settles
CALM = 2
NARROW = 20  # cells: changes this close may be one with its jolt

SHORTEST = 10  # cells: no object is carried for less than 0.2 s
PENALTY = 60.0  # of a change: 7.7 standard deviations, far beyond what white rows reach
MOST_ROUNDS = 6

_ROUNDING = 1e-12  # of sums of squares, in comparisons that drop a start


@dataclass(frozen=True)
class Edges:
    """Cells at which stretches begin, and the last one's end.

    The cells between which each change surely lies.
    """

    places: list[int]
    spans: list[tuple[int, int]]


def edges(cells: Cells, arm: IdentifiedArm) -> Edges:
    """The changes of payload among `cells`.

    What a change would explain counts as an error at first, and no longer once the change is
    found: errors are estimated again from what the stretches leave, until the changes stay.
    """
    places: list[int] = [0, len(cells)]
    spans: list[tuple[int, int]] = []
    masses: FloatArray = np.zeros(len(cells))
    exact = np.zeros((arm.k.size + 2,) * 2)
    for _ in range(MOST_ROUNDS):
        calm = np.ones(
            len(cells)
        )  # cells around changes: their jolts are no errors of the arm's model
        for low, high in spans:
            calm[max(low - GUARD - CALM, 0) : high + GUARD + CALM] = 0.0
        still = replace(
            cells, A=calm * cells.A, B=calm * cells.B, S=calm[:, None] * cells.S, E=calm * cells.E
        )
        # a change must stand up to slow errors whatever their reason, wrong constants of the arm
        # included
        penalty = PENALTY * variance(still, masses, arm, exact)
        before = places
        places = [0, *cuts(cells.A, cells.B, penalty, SHORTEST), len(cells)]
        places, spans = placed(_needed(fused(places, cells, penalty), cells, penalty), cells)
        if places == before:
            break
        starts = places[:-1]
        own = np.add.reduceat(cells.B, starts) / np.maximum(
            np.add.reduceat(cells.A, starts), 1e-300
        )
        masses = np.repeat(own, np.diff(places))
    return Edges(places, spans)


def variance(cells: Cells, masses: FloatArray, arm: IdentifiedArm, covariance: FloatArray) -> float:
    """Variance of the rows about `masses` (C,), of the constants' errors freed, one at least.

    Rows scatter about masses that hold for a few cells, and err alike over longer blocks: the
    larger of both.
    """
    groups = len(cells) // SHORTEST
    A, B, E, rows = (
        x[: groups * SHORTEST].reshape(groups, -1).sum(axis=1)
        for x in (cells.A, cells.B, cells.E, cells.rows)
    )
    rough = float(
        np.median((E - B**2 / np.maximum(A, 1e-300)) / rows)
    )  # groups that hold a change are few
    T = cells.sensitivity(arm, masses)
    return max(1.0, rough, excess(cells.A, cells.B - cells.A * masses, T, covariance))


def excess(A: FloatArray, B: FloatArray, T: FloatArray, covariance: FloatArray) -> float:
    """Variance of the masses of neighbouring blocks over what white rows would give.

    1 where they pass for white.

    Parameters
    ----------
    A, B : (C,) float64
        Information of each cell and its score, less what is known of the mass.
    T : (C, p) float64
        How the scores shift with the arm's constants.
    covariance : (p, p) float64
        Of these constants: their errors are no excess.
    """
    found = 1.0
    for span in SPANS:
        count = A.size // span
        information, score, shift = (
            x[: count * span].reshape(count, span, *x.shape[1:]).sum(axis=1) for x in (A, B, T)
        )
        heavy = information > LIGHTEST * information.max(initial=0.0)
        information, score, shift = information[heavy], score[heavy], shift[heavy]
        if information.size <= FEWEST:
            continue
        J = np.diff(shift / information[:, None], axis=0)
        white = (
            1 / information[1:] + 1 / information[:-1] + np.einsum("cx,xy,cy->c", J, covariance, J)
        )
        ratio = float(np.median(np.diff(score / information) ** 2 / white)) / _MEDIAN
        if ratio > 1 + _SURE * _SPREAD / np.sqrt(information.size - 1):
            found = max(found, ratio)
    return found


def cuts(A: FloatArray, B: FloatArray, penalty: float, shortest: int) -> list[int]:
    """Cells (sorted) that begin a new stretch; each stretch has `shortest` cells at least.

    Parameters
    ----------
    A, B : (C,) float64
        Information and score of each cell.
    penalty : float, in units of twice the log likelihood

    Notes
    -----
    Ends come in blocks of `shortest`: the best cut before an end of a block rests on starts before
    the block alone. Starts that are the best at no mass are dropped after each block (`Starts`).
    """
    count = A.size
    a, b = np.concatenate([[0.0], np.cumsum(A)]), np.concatenate([[0.0], np.cumsum(B)])
    last = np.zeros(count + 1, dtype=np.int64)
    best = np.full(count + 1, np.inf)
    best[0] = -penalty
    starts = Starts(penalty)
    for block in range(shortest, count + 1, shortest):
        ends = np.arange(block, min(block + shortest, count + 1))
        new = ends - shortest
        starts.add(new[(new == 0) | (new >= shortest)], a, b, best)
        # the block's own starts serve only the ends that lie `shortest` later
        value = starts.values(a[ends], b[ends])
        value[starts.place[:, None] > new] = np.inf
        rows = np.argmin(value, axis=0)
        best[ends], last[ends] = value[rows, np.arange(ends.size)] + penalty, starts.place[rows]
        starts.prune(int(rows[-1]))
    found = [int(last[-1])]
    while found[-1] > 0:
        found.append(int(last[found[-1]]))
    return found[-2::-1]


class Starts:
    """Starts of the last stretch that may serve an end to come.

    Up to an end with the sums a and b, a stretch from start s that holds a mass m costs

        a m² − 2 b m + f_s(m),    f_s(m) = best_s − a_s m² + 2 b_s m,

    so a start whose f is the least of all at no m is never used again (Maidstone et al. 2017).
    An older start o beats a newer one s between the roots of f_s − f_o, a concave parabola in m,
    and nowhere else. Of each start the masses are kept at which it beats every newer one.
    """

    def __init__(self, penalty: float) -> None:
        self.place = np.empty(0, dtype=np.int64)
        self._penalty = penalty
        self._sums = np.empty((3, 0))  # a, b and best at each start
        self._masses = np.empty((2, 0))  # from and to which it beats the newer ones
        self._fresh = 0

    def add(self, place: NDArray[np.int64], a: FloatArray, b: FloatArray, best: FloatArray) -> None:
        """Take in starts that are newer than all before."""
        self._fresh = self.place.size
        everywhere = np.broadcast_to([[-np.inf], [np.inf]], (2, place.size))
        self.place = np.concatenate([self.place, place])
        self._sums = np.hstack([self._sums, [a[place], b[place], best[place]]])
        self._masses = np.hstack([self._masses, everywhere])

    def values(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """What the best cut up to ends of the sums a and b (E,) costs by last start (S, E)."""
        own_a, own_b, best = self._sums[:, :, None]
        return np.asarray(best - (b - own_b) ** 2 / np.maximum(a - own_a, 1e-300))

    def prune(self, leading: int) -> None:
        """Drop the starts that the newest ones, or the `leading` one, beat at every mass."""
        low, high = self._won(
            np.arange(self.place.size), np.arange(self._fresh, self.place.size), _ROUNDING
        )
        newer = self.place[self._fresh :] > self.place[:, None]
        self._masses[0] = np.maximum(self._masses[0], np.where(newer, low, -np.inf).max(axis=1))
        self._masses[1] = np.minimum(self._masses[1], np.where(newer, high, np.inf).min(axis=1))
        beaten = self._masses[0] > self._masses[1]
        after = np.arange(leading + 1, self.place.size)
        (low,), (high,) = self._won(np.array([leading]), after, -_ROUNDING)
        beaten[after] |= (low <= self._masses[0, after]) & (self._masses[1, after] <= high)
        self.place = self.place[~beaten]
        self._sums, self._masses = self._sums[:, ~beaten], self._masses[:, ~beaten]

    def _won(
        self, older: NDArray[np.int64], newer: NDArray[np.int64], rounding: float
    ) -> tuple[FloatArray, FloatArray]:
        """From and to which mass each older start beats each newer one (O, N).

        The first lies above the second where it never does. Sums of squares are off by `rounding`, in its favour.
        """
        a, b, best = self._sums[:, None, newer] - self._sums[:, older, None]
        slack = rounding * (self._penalty + np.abs(self._sums[2, newer]))
        # between starts without information the older one is better throughout, or the newer one
        flat = a <= 1e-300
        divisor = np.where(flat, 1.0, a)
        square = b * b + divisor * (best + slack)
        reach = np.sqrt(np.maximum(square, 0.0)) / divisor
        middle = b / divisor
        low = np.where(flat, -np.inf, middle - reach)
        high = np.where(flat, np.inf, middle + reach)
        never = np.where(flat, best < -slack, square < 0.0)
        return np.where(never, np.inf, low), np.where(never, -np.inf, high)


def fused(places: list[int], cells: Cells, penalty: float) -> list[int]:
    """Places with two close changes made one wherever the cells away from that one need no more."""
    place = 1
    while place < len(places) - 2:
        first, left, right, last = places[place - 1 : place + 3]
        close = right - left <= NARROW
        one = left + int(np.argmin(_costs(cells, first, left, right, last))) if close else left
        if (
            close
            and _gain(cells.part(first, last), left - first, right - first, one - first) < penalty
        ):
            places = [*places[:place], one, *places[place + 2 :]]
        else:
            place += 1
    return places


def _gain(cells: Cells, left: int, right: int, one: int) -> float:
    """What the stretch between two changes explains beyond `one` change, cells around that one left out."""
    kept = np.abs(np.arange(len(cells)) + 0.5 - one) > GUARD
    A, B = np.where(kept, cells.A, 0.0), np.where(kept, cells.B, 0.0)
    worths = [
        np.sum(np.add.reduceat(B, cut) ** 2 / np.maximum(np.add.reduceat(A, cut), 1e-300))
        for cut in ([0, left, right], [0, one])
    ]
    return float(worths[0] - worths[1])


def _needed(places: list[int], cells: Cells, penalty: float) -> list[int]:
    """Edges less those that cells away from them do not need: a grasp jolts the cells it falls among."""

    def worth(first: int, cut: int, last: int) -> float:
        """Squared difference of the masses on both sides of a cut over its variance."""
        sides = (cells.part(first + GUARD, cut - GUARD), cells.part(cut + GUARD, last - GUARD))
        A, B = (
            np.maximum([side.A.sum() for side in sides], 1e-300),
            np.array([side.B.sum() for side in sides]),
        )
        return float(np.diff(B / A)[0] ** 2 / np.sum(1 / A))

    while len(places) > 2:
        worths = [worth(*places[place : place + 3]) for place in range(len(places) - 2)]
        weakest = int(np.argmin(worths))
        if worths[weakest] > penalty:
            break
        places = places[: weakest + 1] + places[weakest + 2 :]
    return places


def placed(places: list[int], cells: Cells) -> tuple[list[int], list[tuple[int, int]]]:
    """Each change moved to where the cells away from it fit best, and between which cells it may as well lie."""
    moved, spans = list(places), []
    for place in range(1, len(places) - 1):
        first, cut, last = moved[place - 1], places[place], places[place + 1]
        low, high = max(cut - REACH, first + 2 * GUARD + 1), min(cut + REACH, last - 2 * GUARD - 1)
        if low <= high:
            cost = _costs(cells, first, low, high, last)
            moved[place] = low + int(np.argmin(cost))
            likely = low + np.flatnonzero(cost < cost.min() + UNLIKELY)
            spans.append((int(likely[0]), int(likely[-1])))
        else:
            spans.append((cut, cut))
    return moved, spans


def _costs(cells: Cells, first: int, low: int, high: int, last: int) -> FloatArray:
    """How badly the cells away from a change at `low` to `high` fit the masses on both sides of it."""
    before, after = (
        _misfit(cells.part(first, last), *ends) for ends in ((0, low - first), (high - first, None))
    )
    left, right = (np.concatenate([[0.0], np.cumsum(misfit)]) for misfit in (before, after))
    change = np.arange(low, high + 1) - first
    return np.asarray(
        left[np.maximum(change - GUARD, 0)]
        + right[-1]
        - right[np.minimum(change + GUARD, last - first)]
    )


def _misfit(cells: Cells, start: int, stop: int | None) -> FloatArray:
    """Each cell's squares about the mass of those from `start` to `stop`, less what these usually have (C,)."""
    # medians: the stretch's other end may hold a jolt too, and cells of the next mass
    A, B, rows = cells.A[start:stop], cells.B[start:stop], cells.rows[start:stop]
    own = B / np.maximum(A, 1e-300)
    order = np.argsort(own)
    running_sum = np.cumsum(A[order])
    mass = float(own[order][min(np.searchsorted(running_sum, running_sum[-1] / 2), own.size - 1)])
    squares = cells.squares(mass)
    return np.asarray(squares - cells.rows * np.median(squares[start:stop] / rows))
