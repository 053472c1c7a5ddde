"""Where a log's stretches of constant payload begin and end.

The best cut into stretches comes by dynamic programming. A stretch from cell a to b costs
−(ΣB)²/ΣA, twice its log likelihood ratio against nothing; each cut costs a penalty. Starts long ago
are thinned, so that cost grows linearly with the cells, also where nothing changes.

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

FINE = 512
"""Cells, ten seconds, back to which each one may begin a stretch.

Of those n times as long ago every n^1.5th may, rounded to a power of two. A change that shows only
then has a time to within a tenth of how late, which is coarser for hours, and its rows place it. Of
120 random series of 300 to 3,000 cells the cut was the best of all in 119, and in one 0.002
penalties short of it; with 128 in 111.
"""
THINNED = 8  # blocks of ends between two thinnings of the starts


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
        Information of each cell and its score.
    penalty : float, in units of twice the log likelihood

    Notes
    -----
    Ends come in blocks of `shortest`: the best cut before an end of a block rests on starts before
    the block alone. Now and then the starts are thinned (`FINE`), but for those that a best cut
    rests on.
    """
    count, often = A.size, THINNED * shortest
    a, b = (np.append(0.0, np.cumsum(x)) for x in (A, B))
    best, last = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=np.int64)
    best[0], place = -penalty, np.empty(0, dtype=np.int64)
    for block in range(shortest, count + 1, shortest):
        ends = np.arange(block, min(block + shortest, count + 1))
        fresh, end = ends - shortest, ends[:, None]
        place = np.append(place, fresh[(fresh == 0) | (fresh >= shortest)])
        value = best[place] - (b[end] - b[place]) ** 2 / np.maximum(a[end] - a[place], 1e-300)
        # the block's own starts serve only the ends that lie `shortest` later
        value[place > fresh[:, None]] = np.inf
        columns = np.argmin(value, axis=1)
        best[ends], last[ends] = value.min(axis=1) + penalty, place[columns]
        if block % often == 0:
            late = np.log2(np.maximum((block - place) / FINE, 1))
            steps = 2 ** (1.5 * late).astype(np.int64)
            place = place[(place % steps == 0) | np.isin(place, last[block - often : ends[-1] + 1])]
    places = [int(last[-1])]
    while places[-1] > 0:
        places.append(int(last[places[-1]]))
    return places[-2::-1]
