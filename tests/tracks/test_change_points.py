"""Where a payload changes: against exact dynamic programming, every placing tried, and variances
in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from algid.arm import FloatArray
from algid.tracks.cells import CELL, Cells
from algid.tracks.change_points import (
    CHANCE,
    cuts,
    excess,
    first_segmentation,
)


def cells_of(
    masses: FloatArray, rng: np.random.Generator, spread: float = 1.0, rows: int = 20
) -> Cells:
    """Cells (C,) of `rows` rows e = g m + noise of `spread`, g of size one."""
    g = rng.standard_normal((masses.size, rows))
    e = g * masses[:, None] + spread * rng.standard_normal(g.shape)
    start = CELL * np.arange(masses.size)
    return Cells(
        start,
        start + CELL,
        np.sum(g * g, axis=1)[:, None, None],
        np.sum(g * e, axis=1)[:, None],
        np.sum(e * e, axis=1),
        np.sum(e * e, axis=1),
        np.full(masses.size, float(rows)),
        np.eye(1),
    )


def cost_of(chosen: Sequence[int], A: FloatArray, B: FloatArray, penalty: float) -> float:
    parts = pairwise([0, *chosen, A.size])
    return penalty * len(chosen) - sum(
        B[a:b].sum() ** 2 / max(A[a:b].sum(), 1e-300) for a, b in parts
    )


def brute(A: FloatArray, B: FloatArray, penalty: float, shortest: int) -> float:
    """Cost of the best cut by trying every one: 2^(C - 1), less those with too short a stretch."""
    return min(
        cost_of(chosen, A, B, penalty)
        for count in range(A.size // shortest)
        for chosen in combinations(range(shortest, A.size - shortest + 1), count)
        if min(b - a for a, b in pairwise([0, *chosen, A.size])) >= shortest
    )


@settings(max_examples=60)
# a start that was given up before its better might stand
@example(seed=10_000, count=13, shortest=3, penalty=3.0, still=0.0)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(3, 13),
    shortest=st.integers(1, 4),
    penalty=st.floats(0.1, 30.0),
    still=st.sampled_from([0.0, 0.3, 0.7]),
)
def test_cuts_are_the_best_of_all(
    seed: int, count: int, shortest: int, penalty: float, still: float
) -> None:
    rng = np.random.default_rng(seed)
    A = rng.uniform(0.5, 2.0, count)
    B = A * np.repeat(rng.normal(0, 3, count), rng.integers(1, 5, count))[
        :count
    ] + rng.standard_normal(count)
    shortest = min(shortest, count)
    moving = rng.uniform(size=count) >= still  # an arm that rests weighs nothing
    A, B = A * moving, B * moving
    found = cuts(A, B, penalty, shortest)
    assert cost_of(found, A, B, penalty) == pytest.approx(brute(A, B, penalty, shortest), abs=1e-9)
    assert min(b - a for a, b in pairwise([0, *found, count])) >= shortest


@pytest.mark.parametrize("robust", [True, False])
def test_white_rows_have_no_excess_and_slow_errors_have_theirs(robust: bool) -> None:
    """Scores that are white but of nine times the variance have nine times the blocks' scatter,
    whatever the span.
    """
    rng = np.random.default_rng(0)
    A = rng.uniform(1, 3, 4000)
    B, whole = np.sqrt(A) * rng.standard_normal(4000), [(0, 4000)]
    assert excess(A, B, whole, robust=robust) == 1.0
    # the largest of ten spans, of which the longest has 80 blocks: 9 and up to four deviations of
    # its median more
    assert 8.5 < excess(A, 3 * B, whole, robust=robust) < 9 * (1 + 4 * 2.33 / np.sqrt(79))
    # in blocks of 50 cells a mass error of 0.3 that turns once a second adds 0.3² 50 · 2 / 2 and
    # more
    slow = 0.5 * np.sign(np.sin(np.arange(4000) * np.pi / 50))
    assert excess(A, B + A * slow, whole, robust=robust) > 10


@pytest.mark.parametrize("robust", [True, False])
@pytest.mark.parametrize("pairs", [8, 15, 60])
def test_few_blocks_of_white_rows_have_no_excess_by_chance(pairs: int, robust: bool) -> None:
    """Once in `CHANCE`: the median of few squares is far from normal, and so is their mean."""
    rng, count = np.random.default_rng(8), 3000
    A = np.ones(pairs + 1)
    false = 0
    for _ in range(count):
        B = rng.standard_normal(pairs + 1)
        false += excess(A, B, [(0, pairs + 1)], [1], robust=robust) > 1
    assert false <= binom.isf(1e-3, count, CHANCE)


def test_changes_each_second_hide_behind_no_error_of_their_own() -> None:
    """Most blocks of a second hold one; blocks within stretches do not."""
    rng = np.random.default_rng(9)
    places = 50 * np.arange(31) + rng.integers(-7, 7, 31) * (np.arange(31) % 30 > 0)
    masses = np.repeat(np.cumsum(rng.choice([-1, 1], 30) * rng.uniform(1, 3, 30)), np.diff(places))
    found = first_segmentation(cells_of(masses, rng))[0]
    assert found == pytest.approx(places.tolist(), abs=1)


def test_white_logs_are_left_whole() -> None:
    """A penalty of 60 is 7.7 deviations: 40 logs of 300 cells are never cut."""
    rng = np.random.default_rng(6)
    assert [first_segmentation(cells_of(np.full(300, 0.5), rng))[0] for _ in range(40)] == [
        [0, 300]
    ] * 40
