"""Where a payload changes: against exact dynamic programming, every placing tried, and variances in closed form."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from algid.arm import FloatArray
from algid.estimators.whitening import NoiseLevels
from algid.model import Model
from algid.tracks.bins import CELL, Cells, IdentifiedArm
from algid.tracks.change_points import (
    GUARD,
    NARROW,
    PENALTY,
    SHORTEST,
    Starts,
    cuts,
    edges,
    excess,
    fused,
    placed,
    variance,
)
from tests.tracks.folders import CASE

ARM = IdentifiedArm(
    Model(), CASE.arm.constants(), CASE.arm.l1, CASE.arm.l2, NoiseLevels(np.ones(2), np.ones(2))
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
        np.sum(g * g, axis=1),
        np.sum(g * e, axis=1),
        np.zeros((masses.size, ARM.k.size)),
        np.sum(e * e, axis=1),
        np.sum(e * e, axis=1),
        np.full(masses.size, float(rows)),
    )


def brute(A: FloatArray, B: FloatArray, penalty: float, shortest: int) -> list[int]:
    """The best cut by trying every one: 2^(C - 1) of them, less those with a stretch too short."""
    best, found = np.inf, list[int]()
    inner = range(shortest, A.size - shortest + 1)
    for count in range(A.size // shortest):
        for chosen in combinations(inner, count):
            ends = [0, *chosen, A.size]
            if min(b - a for a, b in pairwise(ends)) < shortest:
                continue
            cost = count * penalty - sum(
                B[a:b].sum() ** 2 / A[a:b].sum() for a, b in pairwise(ends)
            )
            if cost < best - 1e-12:
                best, found = cost, list(chosen)
    return found


@settings(max_examples=60)
@example(
    seed=10_000, count=13, shortest=3, penalty=3.0
)  # a start that was given up before its better might stand
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(3, 13),
    shortest=st.integers(1, 4),
    penalty=st.floats(0.1, 30.0),
)
def test_cuts_are_the_best_of_all(seed: int, count: int, shortest: int, penalty: float) -> None:
    rng = np.random.default_rng(seed)
    A = rng.uniform(0.5, 2.0, count)
    B = A * np.repeat(rng.normal(0, 3, count), rng.integers(1, 5, count))[
        :count
    ] + rng.standard_normal(count)
    shortest = min(shortest, count)
    assert cuts(A, B, penalty, shortest) == brute(A, B, penalty, shortest)


def unpruned(A: FloatArray, B: FloatArray, penalty: float, shortest: int) -> list[int]:
    """The best cut by dynamic programming that drops no start."""
    a, b = np.concatenate([[0.0], np.cumsum(A)]), np.concatenate([[0.0], np.cumsum(B)])
    best, last = np.full(A.size + 1, np.inf), np.zeros(A.size + 1, dtype=int)
    best[0] = -penalty
    for end in range(shortest, A.size + 1):
        start = np.arange(end - shortest + 1)
        information = np.maximum(a[end] - a[start], 1e-300)
        cost = best[start] - (b[end] - b[start]) ** 2 / information
        last[end] = np.argmin(cost)
        best[end] = cost[last[end]] + penalty
    found = [int(last[-1])]
    while found[-1] > 0:
        found.append(int(last[found[-1]]))
    return found[-2::-1]


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(10, 300),
    changes=st.integers(0, 20),
    empty=st.booleans(),
    penalty=st.floats(0.1, 60.0),
)
def test_no_start_is_dropped_that_would_serve(
    seed: int, count: int, changes: int, empty: bool, penalty: float
) -> None:
    rng = np.random.default_rng(seed)
    places = np.sort(rng.integers(0, count, changes))
    masses = rng.normal(0, 2, changes + 1)[np.searchsorted(places, np.arange(count), "right")]
    A = rng.uniform(0.1, 3.0, count) * (rng.random(count) > 0.3 if empty else 1.0)
    B = A * masses + np.sqrt(A) * rng.standard_normal(count)
    assert cuts(A, B, penalty, 10) == unpruned(A, B, penalty, 10)


def test_few_starts_are_kept_where_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 20,000 starts; what a search costs grows with those that it keeps."""
    kept, prune = list[int](), Starts.prune

    def counted(starts: Starts, leading: int) -> None:
        prune(starts, leading)
        kept.append(starts.place.size)

    monkeypatch.setattr(Starts, "prune", counted)
    A = np.full(20_000, 4.0)
    assert cuts(A, 2 * np.random.default_rng(8).standard_normal(A.size), PENALTY, SHORTEST) == []
    assert max(kept) < 300


def test_a_log_of_one_mass_is_not_cut_and_a_step_is_where_it_is() -> None:
    A = np.ones(60)
    assert cuts(A, 3.0 * A, 10.0, 5) == []
    assert cuts(A, np.repeat([0.0, 5.0, 1.0], 20), 10.0, 5) == [20, 40]
    # a step of d between n cells each of information one explains n d²/2: 20 · 1.0²/2 = 10
    for step, found in ((0.99, []), (1.01, [20])):
        assert cuts(np.ones(40), np.repeat([0.0, step], 20), 10.0, 5) == found


def test_cells_without_information_do_not_stop_the_cut() -> None:
    A = np.where(np.arange(60) % 3 == 0, 0.0, 1.0)
    assert cuts(A, A * np.repeat([0.0, 5.0, 1.0], 20), 10.0, 5) == pytest.approx([20, 40], abs=1)


def test_white_rows_have_no_excess_and_slow_errors_have_theirs() -> None:
    """Scores that are white but of nine times the variance have nine times the blocks' scatter, whatever the span."""
    rng = np.random.default_rng(0)
    A = rng.uniform(1, 3, 4000)
    B, exact = np.sqrt(A) * rng.standard_normal(4000), np.zeros((2, 2))
    T = rng.standard_normal((4000, 2))
    assert excess(A, B, T, exact) == 1.0
    # the largest of ten spans, of which the longest has 80 blocks: 9 and up to four deviations of
    # its median more
    assert 8.5 < excess(A, 3 * B, T, exact) < 9 * (1 + 4 * 2.33 / np.sqrt(79))
    # in blocks of 50 cells a mass error of 0.3 that turns once a second adds 0.3² 50 · 2 / 2 and
    # more
    slow = 0.5 * np.sign(np.sin(np.arange(4000) * np.pi / 50))
    assert excess(A, B + A * slow, T, exact) > 10


def test_errors_of_the_constants_are_taken_from_the_excess() -> None:
    rng = np.random.default_rng(1)
    A, T = np.full(2000, 2.0), np.repeat(rng.standard_normal((40, 1)), 50, axis=0)
    wrong = 3.0
    B = np.sqrt(A) * rng.standard_normal(2000) + T[:, 0] * wrong
    assert excess(A, B, T, np.zeros((1, 1))) > 5
    assert excess(A, B, T, np.array([[4 * wrong**2]])) < 2


@pytest.mark.parametrize("size", [0, 3, 8])
def test_too_few_cells_tell_no_excess(size: int) -> None:
    A = np.ones(size)
    assert excess(A, 1e3 * (-A) ** np.arange(size), np.zeros((size, 1)), np.zeros((1, 1))) == 1.0


@pytest.mark.parametrize("spread", [1.0, 3.0])
def test_the_rows_variance_is_that_of_their_noise_one_at_least(spread: float) -> None:
    cells = cells_of(np.full(500, 0.4), np.random.default_rng(2), spread)
    found = variance(cells, np.full(500, 0.4), ARM, np.zeros((9, 9)))
    assert found == pytest.approx(spread**2, rel=0.15)
    assert (
        variance(
            cells_of(np.zeros(500), np.random.default_rng(2), 0.1),
            np.zeros(500),
            ARM,
            np.zeros((9, 9)),
        )
        == 1.0
    )


@pytest.mark.parametrize("place", [40, 57, 80])
def test_a_change_is_placed_where_the_masses_on_both_sides_fit_best(place: int) -> None:
    rng = np.random.default_rng(place)
    masses = np.repeat([0.0, 1.0], [place, 120 - place])
    cells = cells_of(masses, rng)
    for start in (place - 9, place, place + 9):
        (first, found, last), ((low, high),) = placed([0, start, 120], cells)
        assert (first, last) == (0, 120)
        assert abs(found - place) <= GUARD  # cells so near to a change tell nothing of it
        assert low <= found <= high
        assert (
            high - low <= 4 * GUARD
        )  # 20 rows of a step of a σ tell a cell by 20 squares of the 25
    jolted = Cells(*(getattr(cells, name).copy() for name in cells.__dataclass_fields__))
    jolted.B[place - 2 : place + 2] += 300.0  # within the guard nothing counts
    jolted.E[place - 2 : place + 2] += 9000.0
    (_, found, _), _ = placed([0, place + 4, 120], jolted)
    assert abs(found - place) <= GUARD


def test_a_change_without_room_stays_where_it_is() -> None:
    cells = cells_of(np.zeros(12), np.random.default_rng(3))
    assert placed([0, 6, 12], cells) == ([0, 6, 12], [(6, 6)])


def test_two_changes_of_one_jolt_are_one_and_two_of_their_own_stay() -> None:
    rng = np.random.default_rng(4)
    for masses, merged in (([0.0, 20.0, 1.0], True), ([0.0, 5.0, 1.0], False)):
        width = 2 * GUARD if merged else NARROW
        cells = cells_of(np.repeat(masses, [60, width, 60]), rng)
        found = fused([0, 60, 60 + width, 120 + width], cells, PENALTY)
        assert len(found) == (3 if merged else 4)
        assert abs(found[1] - 60) <= 2 * GUARD
    far = cells_of(np.repeat([0.0, 0.01, 0.0], [60, NARROW + 1, 60]), rng)
    assert (
        len(fused([0, 60, 81, 141], far, PENALTY)) == 4
    )  # too far apart to be one, whatever they explain


@pytest.mark.parametrize("step", [0.0, 1.0])
def test_edges_of_a_simulated_log_are_its_own(step: float) -> None:
    rng = np.random.default_rng(5)
    cells = cells_of(np.repeat([0.0, step, 0.0], [90, 60, 75]), rng)
    found = edges(cells, ARM)
    if not step:
        assert (found.places, found.spans) == ([0, 225], [])
        return
    assert found.places == pytest.approx([0, 90, 150, 225], abs=GUARD)
    for place, (low, high) in zip(found.places[1:-1], found.spans, strict=True):
        assert low <= place <= high


def test_white_logs_are_left_whole() -> None:
    """A penalty of 60 is 7.7 deviations: 40 logs of 300 cells are never cut."""
    rng = np.random.default_rng(6)
    assert [edges(cells_of(np.full(300, 0.5), rng), ARM).places for _ in range(40)] == [
        [0, 300]
    ] * 40


def test_no_stretch_is_shorter_than_the_shortest() -> None:
    rng = np.random.default_rng(7)
    cells = cells_of(np.repeat([0.0, 8.0, 0.0], [60, SHORTEST - 4, 60]), rng)
    found = edges(cells, ARM)
    assert min(b - a for a, b in pairwise(found.places)) >= 2 * GUARD
