"""What repeats of a motion share is the model's error: told from noise, and held by the intervals.

Scores are drawn, so that the truth is known: those of noise are each run's own, those of a lack of
the model are the same in each.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators.agreement import agree
from algid.estimators.combine import LogInformation, combine
from algid.estimators.fit import Fit, conclude
from algid.estimators.parametrisation import Shared
from algid.model import Model

SHARED = Shared(Model(), False, False, {})
SIZE = len(SHARED.names)
TRUTH = np.linspace(1.0, 2.0, SIZE)
RUNS, STRETCHES = 6, 150
TOGETHER = (tuple(range(RUNS)),)


def drawn(rng: np.random.Generator, lack: float) -> list[LogInformation]:
    """Likelihoods of repeats whose model lacks `lack` of the noise's size, about the truth."""
    roots = rng.standard_normal((STRETCHES, SIZE, SIZE))
    S = 100 * roots @ roots.swapaxes(1, 2)

    def scores() -> FloatArray:
        return 10 * np.einsum("tqr,tr->tq", roots, rng.standard_normal((STRETCHES, SIZE)))

    shared = lack * scores()
    return [LogInformation(False, TRUTH, S, scores() + shared) for _ in range(RUNS)]


def fitted(logs: list[LogInformation], repeats: tuple[tuple[int, ...], ...]) -> Fit:
    moved = np.full(2, np.inf)
    return conclude("refined", SHARED, logs, TRUTH, moved, coloured=False, repeats=repeats)


def agreeing(logs: list[LogInformation], repeats: tuple[tuple[int, ...], ...]) -> bool:
    beta, H, _ = combine(SHARED, logs, TRUTH)
    return agree(SHARED, logs, beta, H, repeats)


def test_noise_agrees_once_in_twenty_and_what_is_lacking_always() -> None:
    """400 sets of pure noise: 20 agree by chance, 3.5 standard deviations of that are 16."""
    rng = np.random.default_rng(1)
    sound = [agreeing(drawn(rng, 0.0), TOGETHER) for _ in range(400)]
    assert 4 <= sum(sound) <= 36
    assert all(agreeing(drawn(rng, 0.5), TOGETHER) for _ in range(20))


def test_two_pairs_of_repeats_tell_less_than_six_and_single_runs_nothing() -> None:
    rng = np.random.default_rng(2)
    sets = [drawn(rng, 0.2) for _ in range(100)]
    pairs = ((0, 1), (2, 3), (4,), (5,))
    found = [sum(agreeing(logs, how) for logs in sets) for how in (TOGETHER, pairs, ())]
    assert found[0] > found[1] + 20
    assert found[1] > 10
    assert found[2] == 0
    assert not agreeing(sets[0], tuple((place,) for place in range(RUNS)))


@pytest.mark.parametrize(("lack", "least", "most"), [(0.0, 0.93, 0.97), (1.0, 0.92, 0.98)])
def test_intervals_hold_what_repeats_share(lack: float, least: float, most: float) -> None:
    """Of 2,800 intervals 95 % hold, give or take 0.8 (two standard deviations).

    Of white noise alone a lack as large as the noise leaves 54 % of them: σ is √7 too small.
    """
    rng = np.random.default_rng(3)
    held: list[float] = []
    alone: list[float] = []
    for _ in range(400):
        logs = drawn(rng, lack)
        for groups, inside in ((TOGETHER, held), ((), alone)):
            fit = fitted(logs, groups)
            within = np.abs(fit.values - TRUTH) <= fit.quantile * fit.std
            inside.append(float(np.mean(within)))
    assert least < np.mean(held) < most
    if lack:
        assert np.mean(alone) < 0.6


def test_repeats_count_as_one_log_where_residuals_are_coloured() -> None:
    """Of six repeats there is none to be left out; of four motions, two runs each, there is."""
    rng = np.random.default_rng(4)
    logs = drawn(rng, 1.0)
    moved = np.full(2, np.inf)

    def coloured(repeats: tuple[tuple[int, ...], ...]) -> Fit:
        return conclude("refined", SHARED, logs, TRUTH, moved, coloured=True, repeats=repeats)

    assert coloured(TOGETHER).intervals == "sandwich"
    assert coloured(()).intervals == "jackknife"
    assert coloured(((0, 1), (2, 3), (4,), (5,))).intervals == "jackknife"
    assert np.all(coloured(TOGETHER).std > 1.5 * coloured(()).std)
    without = coloured(TOGETHER).without
    assert without is not None
    assert len(without) == RUNS  # each log is predicted from all others
