"""The running estimate: where it ends, what its band holds on the way, and that it shrinks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.estimators import refined, weak
from algid.estimators.fit import Fit, has_running, running
from algid.estimators.whitening import NoiseLevels

from .conftest import Bench, problem_of


def _fit(bench: Bench, estimator: str, seed: int, loaded: bool) -> Fit:
    bare, burdened = (bench.log(carries, 1e-4, seed) for carries in (False, True))
    known = problem_of(bare, loaded=[burdened] * loaded)
    return weak.fit(known) if estimator == "weak" else refined.fit(known)


@pytest.mark.parametrize("estimator", ["weak", "refined"])
def test_it_ends_where_the_fit_does(bench: Bench, estimator: str) -> None:
    fit = _fit(bench, estimator, 1, loaded=True)
    found = running(fit, [4.0, 4.0], 40)
    assert has_running(fit)
    assert list(np.unique(found["log"])) == [0, 1]
    last = {name: column[-1] for name, column in found.items()}
    # both are optima, found to 1e-5 deviations
    np.testing.assert_allclose([last[name] for name in fit.names], fit.values, rtol=1e-6)
    halves = [last[f"{name}_half"] for name in fit.names]
    np.testing.assert_allclose(halves, fit.quantile * fit.std, rtol=1e-6)
    first_loaded = int(np.flatnonzero(found["log"])[0])
    assert all(np.isnan(found[name][first_loaded - 1]) for name in ("m_p", "l1", "l2"))


def test_half_way_it_is_what_half_of_the_log_tells(bench: Bench) -> None:
    """Its value and its band are those of a fit of that half alone, whose intervals hold the truth
    19 times of 20.
    """
    log = bench.log(sigma=1e-4, seed=2)
    known = NoiseLevels(np.full(2, 1e-4), np.full(2, 1e-3))
    whole, half = (refined.fit(problem_of(log.part(0, end)), noise=known) for end in (4001, 2001))
    found = running(whole, [4.0], 8)
    place = int(np.argmin(np.abs(found["t"] - 2.0)))
    assert found["t"][place] == pytest.approx(2.0, abs=0.04)
    beta, width = (
        np.array([found[name + end][place] for name in whole.names]) for end in ("", "_half")
    )
    # blocks end within 1 % of the half, and each is linearised at the whole's estimate; intervals
    # of 90 %: 16 % less
    np.testing.assert_allclose(width, half.quantile * half.std, rtol=0.03)
    assert np.all(np.abs(beta - half.values) < 0.5 * half.std)


def test_a_fit_held_within_bounds_has_none(bench: Bench) -> None:
    fit = _fit(bench, "weak", 1, loaded=False)
    assert not has_running(replace(fit, values=fit.values * 1.01))
    assert not has_running(replace(fit, converged=False))
