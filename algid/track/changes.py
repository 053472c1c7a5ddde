"""Where a regression's coefficient changes: the best cut into stretches, by pruned dynamic programming.

A stretch from cell a to b costs −(ΣB)²/ΣA, twice its log likelihood ratio against nothing; each cut costs a
penalty. Cuts that can never be the last one again are dropped (Killick, Fearnhead & Eckley 2012).
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray


def cuts(A: FloatArray, B: FloatArray, penalty: float, shortest: int) -> list[int]:
    """Cells (sorted) that begin a new stretch; each stretch has `shortest` cells at least.

    Parameters
    ----------
    A, B : (C,) float64
        Information and score of each cell.
    penalty : float, in units of twice the log likelihood
    """
    count = A.size
    a, b = np.concatenate([[0.0], np.cumsum(A)]), np.concatenate([[0.0], np.cumsum(B)])
    best = np.full(count + 1, np.inf)
    best[0] = -penalty
    last = np.zeros(count + 1, dtype=np.int64)
    open_: list[int] = []
    for end in range(shortest, count + 1):
        if end == shortest or end - shortest >= shortest:
            open_.append(end - shortest)
        starts = np.array(open_)
        information = np.maximum(a[end] - a[starts], 1e-300)
        value = best[starts] - (b[end] - b[starts]) ** 2 / information
        place = int(np.argmin(value))
        best[end], last[end] = value[place] + penalty, starts[place]
        kept = value <= best[end]
        open_ = starts[kept].tolist()
    return _traced(last)


def _traced(last: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> list[int]:
    found: list[int] = []
    place = int(last[-1])
    while place > 0:
        found.append(place)
        place = int(last[place])
    return found[::-1]
