"""What a grasp does to the cells it falls among: no stencil follows the jump of the acceleration.

A grasp is one change, wherever its jolt would put one; cells within `GUARD` of it tell neither mass.
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.track.cells import Cells

GUARD = 3  # cells left out on both sides of a change, which lies somewhere among them
UNLIKELY = 25.0  # of a change's place: squares beyond those of the best one, noise of the cells left out included
REACH = 15  # cells: how far a jolt may have put a change from its place
CALM = 2  # cells more on both sides of a change's surest ends, over which the smoothed trajectory settles
NARROW = 20  # cells: changes this close may be one with its jolt


def fused(places: list[int], cells: Cells, penalty: float) -> list[int]:
    """Places with two close changes made one wherever the cells away from that one need no more."""
    place = 1
    while place < len(places) - 2:
        first, left, right, last = places[place - 1 : place + 3]
        close = right - left <= NARROW
        one = left + int(np.argmin(_costs(cells, first, left, right, last))) if close else left
        if close and _gain(cells, (first, left, right, last), one) < penalty:
            places = [*places[:place], one, *places[place + 2 :]]
        else:
            place += 1
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
    before, after = (_misfit(cells.part(first, last), *ends) for ends in ((0, low - first), (high - first, None)))
    left, right = (np.concatenate([[0.0], np.cumsum(misfit)]) for misfit in (before, after))
    change = np.arange(low, high + 1) - first
    return np.asarray(left[np.maximum(change - GUARD, 0)] + right[-1] - right[np.minimum(change + GUARD, last - first)])


def _misfit(cells: Cells, start: int, stop: int | None) -> FloatArray:
    """Each cell's squares about the mass of those from `start` to `stop`, less what these usually have (C,)."""
    known = slice(start, stop)
    # medians: the stretch's other end may hold a jolt too, and cells of the next mass
    mass = _median(cells.B[known] / np.maximum(cells.A[known], 1e-300), cells.A[known])
    squares = cells.squares(mass)
    return np.asarray(squares - cells.rows * np.median(squares[known] / cells.rows[known]))


def _median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(total, total[-1] / 2), values.size - 1)])


def _gain(cells: Cells, ends: tuple[int, int, int, int], one: int) -> float:
    """What the stretch between two changes explains beyond `one` change, cells around that one left out."""
    first, left, right, last = ends
    kept = np.abs(np.arange(first, last) + 0.5 - one) > GUARD
    A, B = np.where(kept, cells.A[first:last], 0.0), np.where(kept, cells.B[first:last], 0.0)
    return _worth(A, B, (left - first, right - first)) - _worth(A, B, (one - first,))


def _worth(A: FloatArray, B: FloatArray, cuts: tuple[int, ...]) -> float:
    edges = [0, *cuts]
    return float(np.sum(np.add.reduceat(B, edges) ** 2 / np.maximum(np.add.reduceat(A, edges), 1e-300)))
