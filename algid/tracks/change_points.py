"""Where a log's stretches of constant payload begin and end.

The best cut into stretches comes by pruned dynamic programming. A stretch from cell a to b costs
−(ΣB)²/ΣA, twice its log likelihood ratio against nothing; each cut costs a penalty. Cuts that can
never be the last one again, whatever the mass, are dropped (Maidstone, Hocking, Rigaill & Fearnhead
2017): cost grows linearly with the cells, also where nothing changes.

A penalty holds for white rows; what the arm's model lacks makes neighbouring cells err alike.
Masses of neighbouring blocks of cells differ by 1/A + 1/A' in variance where rows are white. Slow
errors (friction that the model lacks, play, a gear's ripple) make long blocks differ by far more;
the largest excess over block lengths up to a second is what intervals and changes have to stand up
to. Blocks lie within stretches. While changes are sought medians are taken, so that a few that are
not known do not pass for errors.

Whitened rows remember, so that a change shows late in cells, and may show twice. Cells show that
there is one; `algid.tracks.change_times` has the rows around it say whether there is, and when.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.compiled import chi2_exceeded, student_quantile
from algid.tracks.cells import Cells
from algid.tracks.drift import BLOCK, Drift, drift_of, variances

FIRST_SPANS = (1, 2, 3, 5, 8)  # cells: blocks of which few hold a change, before any is known
SPANS = (1, 2, 3, 5, 8, 12, 18, 25, 35, 50)  # cells: 0.02 to 1 s
LIGHTEST = 1e-6  # information of a block that counts, of the largest
FEWEST = 8  # pairs of blocks that give a variance
_MEDIAN = 0.454936  # of a squared standard normal
CHANCE = 1e-4  # that white rows have an excess over one span

# cells ahead of a cut and behind it that may hold both masses: whitened rows show a change late
AHEAD, BEHIND = 8, 5

SHORTEST = 10  # cells: no object is carried for less than 0.2 s
PENALTY = 60.0  # of a change: 7.7 standard deviations, far beyond what white rows reach
MOST_ROUNDS = 6

_ROUNDING = 1e-12  # of sums of squares, in comparisons that drop a start


def first_segmentation(cells: Cells) -> tuple[list[int], Drift, float]:
    """The changes of payload among `cells`.

    Before any change is known, errors are those of short blocks, of which few hold one. They are
    estimated again within the stretches, over longer blocks too, until the changes stay.

    Returns
    -------
    Cells at which stretches begin and the last one's end, how friction drifted, and the rows'
    variance that a change had to stand up to.
    """
    places = [0, len(cells)]
    spans: Sequence[int] = FIRST_SPANS
    for _ in range(MOST_ROUNDS):
        # from which cell to which each stretch lies away from the changes at its ends
        calm = np.stack([places[:-1], places[1:]], axis=1)
        calm[1:, 0] += BEHIND
        calm[:-1, 1] -= AHEAD
        calm = np.maximum.accumulate(calm, axis=1)
        # masses are free in short blocks, lest a change that is not found passes for friction
        blocks = np.union1d(np.arange(0, len(cells), BLOCK), np.ravel(calm)[:-1])
        drift = drift_of(cells, blocks, rough_variance(cells))
        freed = drift.freed(cells)
        # a change must stand up to slow errors whatever their reason, wrong constants of the arm
        # included; rows scatter about masses that hold for a few cells, and err alike over longer
        # blocks: the larger of both
        spread = max(rough_variance(freed), excess(freed.A, freed.B, calm, spans))
        before = places
        places = [0] + cuts(freed.A, freed.B, PENALTY * spread, SHORTEST) + [len(cells)]
        if places == before and spans is SPANS:
            break
        spans = SPANS
    return places, drift, spread


def rough_variance(cells: Cells) -> float:
    """Variance of the rows about masses that hold for a few cells, one at least."""
    groups = len(cells) // SHORTEST
    sums = np.stack([cells.A, cells.B, cells.E, cells.rows])[:, : groups * SHORTEST]
    A, B, E, rows = sums.reshape(4, groups, -1).sum(axis=2)
    # groups that hold a change are few
    return max(1.0, float(np.median((E - B**2 / np.maximum(A, 1e-300)) / rows)))


def excess(
    A: FloatArray,
    B: FloatArray,
    parts: Collection[Sequence[int]],
    spans: Sequence[int] = SPANS,
    known: tuple[FloatArray, FloatArray] | None = None,
    *,
    robust: bool = True,
) -> float:
    """Variance of the masses of neighbouring blocks over what white rows would give.

    1 where they pass for white.

    Parameters
    ----------
    A, B : (C,) float64
        Information of each cell and its score.
    parts : pairs of the cells from which and to which the mass is constant
    spans : cells a block
    known : (C, p) and (p, p) float64, or None
        How the scores shift with constants of the arm, and the covariance of these: their errors
        are no excess. None where they are to be one.
    robust : bool
        Whether a median stands for the mean. A few changes that are not known are no errors then,
        nor are those of the few moments at which a joint turns back.
    """
    factor = 1.0
    for span in spans:
        starts = np.concatenate([np.arange(a, b - span + 1, span) for a, b in parts])
        ends = starts + span
        information, score = sums(A, starts, ends), sums(B, starts, ends)
        heavy = information > LIGHTEST * information.max(initial=0.0)
        within = np.isin(starts[1:], [a for a, _ in parts], invert=True)
        neighbours = heavy[1:] & heavy[:-1] & within
        if neighbours.sum() < FEWEST:
            continue
        information = np.maximum(information, 1e-300)
        white = 1 / information[1:] + 1 / information[:-1]
        if known is not None:
            T, covariance = known
            J = np.diff(sums(T, starts, ends) / information[:, None], axis=0)
            white += variances(J, covariance)
        squares = np.diff(score / information)[neighbours] ** 2 / white[neighbours]
        # neighbouring differences share a block: n of their squares scatter as n / 1.5 do
        freedom = squares.size / 1.5
        if robust:
            # The median of ν squares of white rows is χ² of one degree of freedom at a share u
            # which is Beta((ν + 1) / 2, (ν + 1) / 2), so that u = ½ + t / 2 √(ν + 1 + t²) with
            # Student's t of ν + 1. Of few squares it is far from normal.
            t = student_quantile(freedom + 1, 1 - CHANCE)
            beyond = 0.5 - 0.5 * t / np.sqrt(freedom + 1 + t**2)
            ratio = float(np.median(squares)) / _MEDIAN
            limit = float(chi2_exceeded(1, beyond)) / _MEDIAN
        else:
            ratio, limit = float(np.mean(squares)), chi2_exceeded(freedom, CHANCE) / freedom
        if ratio > limit:
            factor = max(factor, ratio)
    return factor


def sums(x: FloatArray, first: NDArray[np.int64], last: NDArray[np.int64]) -> FloatArray:
    """Sums (N, ...) of x (C, ...) from each of the cells `first` (N,) to before `last` (N,)."""
    total = np.concatenate([np.zeros_like(x[:1]), np.cumsum(x, axis=0)])
    return np.asarray(total[last] - total[first])


def cuts(A: FloatArray, B: FloatArray, penalty: float, shortest: int) -> list[int]:
    """Cells (sorted) that begin a new stretch; each stretch has `shortest` cells at least.

    Parameters
    ----------
    A, B : (C,) float64
        Information and score of each cell.
    penalty : float, in units of twice the log likelihood

    Notes
    -----
    Up to an end with the sums a and b, a stretch from start s that holds a mass m costs

        a m² − 2 b m + f_s(m),    f_s(m) = best_s − a_s m² + 2 b_s m,

    so a start whose f is the least of all at no m is never used again (Maidstone et al. 2017).
    An older start o beats a newer one s between the roots of f_s − f_o, a concave parabola in m,
    and nowhere else. Of each start the masses are kept at which it beats every newer one.

    Ends come in blocks of `shortest`: the best cut before an end of a block rests on starts before
    the block alone.
    """
    count = A.size
    f = np.zeros((3, count + 1))  # a, b and best at each start
    f[0, 1:], f[1, 1:] = np.cumsum(A), np.cumsum(B)
    a, b, best = f
    best[0], best[1:] = -penalty, np.inf
    last = np.zeros(count + 1, dtype=np.int64)
    place, masses = np.empty(0, dtype=np.int64), np.empty((2, 0))
    for block in range(shortest, count + 1, shortest):
        ends = np.arange(block, min(block + shortest, count + 1))
        fresh = ends - shortest
        added = fresh[(fresh == 0) | (fresh >= shortest)]
        place = np.append(place, added)
        masses = np.hstack([masses, np.tile([[-np.inf], [np.inf]], added.size)])
        own = f[:, place, None]
        value = own[2] - (b[ends] - own[1]) ** 2 / np.maximum(a[ends] - own[0], 1e-300)
        # the block's own starts serve only the ends that lie `shortest` later
        value[place[:, None] > fresh] = np.inf
        rows = np.argmin(value, axis=0)
        best[ends], last[ends] = value[rows, np.arange(ends.size)] + penalty, place[rows]
        # Drop the starts that the newest ones, or the one that leads, beat at every mass.
        low, high = _won(f[:, place], f[:, added], penalty, _ROUNDING)
        newer = added > place[:, None]
        masses[0] = np.maximum(masses[0], np.where(newer, low, -np.inf).max(axis=1))
        masses[1] = np.minimum(masses[1], np.where(newer, high, np.inf).min(axis=1))
        beaten = masses[0] > masses[1]
        behind = slice(rows[-1] + 1, None)
        leader, low_high = f[:, place[rows[-1:]]], masses[:, behind]
        low, high = _won(leader, f[:, place[behind]], penalty, -_ROUNDING)
        beaten[behind] |= (low[0] <= low_high[0]) & (low_high[1] <= high[0])
        place, masses = place[~beaten], masses[:, ~beaten]
    places = [int(last[-1])]
    while places[-1] > 0:
        places.append(int(last[places[-1]]))
    return places[-2::-1]


def _won(
    older: FloatArray, newer: FloatArray, penalty: float, rounding: float
) -> tuple[FloatArray, FloatArray]:
    """From and to which mass each older start (3, O) beats each newer one (3, N): (O, N).

    The first lies above the second where it never does. Sums of squares are off by `rounding`, in
    its favour.
    """
    a, b, best = newer[:, None] - older[:, :, None]
    slack = rounding * (penalty + np.abs(newer[2]))
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
