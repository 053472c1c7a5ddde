"""Where a log's stretches of constant payload begin and end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.track.cells import Arm, Cells
from algid.track.changes import cuts
from algid.track.colour import excess
from algid.track.jolts import CALM, GUARD, fused, placed

SHORTEST = 10  # cells: no object is carried for less than 0.2 s
PENALTY = 60.0  # of a change: 7.7 standard deviations, far beyond what white rows reach
MOST_ROUNDS = 6


@dataclass(frozen=True)
class Edges:
    """Cells at which stretches begin, and the last one's end; the cells between which each change surely lies."""

    places: list[int]
    spans: list[tuple[int, int]]


def edges(cells: Cells, arm: Arm) -> Edges:
    """The changes of payload among `cells`.

    What a change would explain counts as an error at first, and no longer once the change is found: errors are
    told again from what the stretches leave, until the changes stay.
    """
    places: list[int] = [0, len(cells)]
    spans: list[tuple[int, int]] = []
    masses: FloatArray = np.zeros(len(cells))
    exact = np.zeros((arm.k.size + 2,) * 2)
    for _ in range(MOST_ROUNDS):
        # a change must stand up to slow errors whatever their reason, wrong constants of the arm included
        penalty = PENALTY * variance(_calm(cells, spans), masses, arm, exact)
        before = places
        places = [0, *cuts(cells.A, cells.B, penalty, SHORTEST), len(cells)]
        places, spans = placed(_merged(fused(places, cells, penalty), cells, penalty), cells)
        if places == before:
            break
        masses = _masses(cells, places)
    return Edges(places, spans)


def _calm(cells: Cells, spans: Sequence[tuple[int, int]]) -> Cells:
    """The cells, those around changes emptied: their jolts are no errors of the arm's model."""
    calm = np.ones(len(cells))
    for low, high in spans:
        calm[max(low - GUARD - CALM, 0) : high + GUARD + CALM] = 0.0
    return replace(cells, A=calm * cells.A, B=calm * cells.B, S=calm[:, None] * cells.S, E=calm * cells.E)


def variance(cells: Cells, masses: FloatArray, arm: Arm, covariance: FloatArray) -> float:
    """Variance of the rows about `masses` (C,), of the constants' errors freed, one at least."""
    T = cells.sensitivity(arm, masses)
    return max(_roughness(cells), excess(cells.A, cells.B - cells.A * masses, T, covariance))


def _masses(cells: Cells, places: list[int]) -> FloatArray:
    """Mass of each cell's stretch (C,)."""
    starts = places[:-1]
    masses = np.add.reduceat(cells.B, starts) / np.maximum(np.add.reduceat(cells.A, starts), 1e-300)
    return np.repeat(masses, np.diff(places))


def _roughness(cells: Cells) -> float:
    """Variance of the rows about masses that hold for a few cells, one at least."""
    groups = len(cells) // SHORTEST
    A, B, E, rows = (
        x[: groups * SHORTEST].reshape(groups, -1).sum(axis=1) for x in (cells.A, cells.B, cells.E, cells.rows)
    )
    left = (E - B**2 / np.maximum(A, 1e-300)) / rows
    return max(1.0, float(np.median(left)))  # groups that hold a change are few


def _merged(places: list[int], cells: Cells, penalty: float) -> list[int]:
    """Edges less those that cells away from them do not need: a grasp jolts the cells it falls among."""
    while len(places) > 2:
        worths = [_worth(cells, *places[place : place + 3]) for place in range(len(places) - 2)]
        weakest = int(np.argmin(worths))
        if worths[weakest] > penalty:
            break
        places = places[: weakest + 1] + places[weakest + 2 :]
    return places


def _worth(cells: Cells, first: int, cut: int, last: int) -> float:
    """Squared difference of the masses on both sides of a cut over its variance."""
    left, right = cells.part(first + GUARD, cut - GUARD), cells.part(cut + GUARD, last - GUARD)
    A, B = (np.array([x.A.sum() for x in (left, right)]), np.array([x.B.sum() for x in (left, right)]))
    A = np.maximum(A, 1e-300)
    return float(np.diff(B / A)[0] ** 2 / np.sum(1 / A))
