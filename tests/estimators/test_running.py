"""The running estimate: where it ends, what its band holds on the way, and that it shrinks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.estimators import refined, weak
from algid.estimators.fit import Fit, has_running, running

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
    """By the normal equations of the stretches up to then, as wide beside them as the fit is."""
    whole = _fit(bench, "refined", 2, loaded=False)
    (log,) = whole.logs
    found = running(whole, [4.0], 8)
    place = int(np.argmin(np.abs(found["t"] - 2.0)))
    assert found["t"][place] == pytest.approx(2.0, abs=0.04)
    end = round(found["t"][place] / 4.0 * len(log.S))
    every, half = (np.linalg.inv(log.S[:one].sum(axis=0)) for one in (None, end))
    wider = whole.quantile * whole.std / np.sqrt(np.diag(every))
    values = log.c0 + half @ log.g[:end].sum(axis=0)
    beta, width = ([found[name + tail][place] for name in whole.names] for tail in ("", "_half"))
    np.testing.assert_allclose(beta, values, rtol=1e-6)
    np.testing.assert_allclose(width, wider * np.sqrt(np.diag(half)), rtol=1e-6)


def test_a_fit_held_within_bounds_has_none(bench: Bench) -> None:
    fit = _fit(bench, "weak", 1, loaded=False)
    assert not has_running(replace(fit, values=fit.values * 1.01))
    assert not has_running(replace(fit, converged=False))
