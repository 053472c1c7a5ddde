"""Instruments against least squares where an unmodelled torque drives the motion, and where none
does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from algid.estimators import instruments, refined, weak
from algid.estimators.combine import Prior
from algid.estimators.parametrisation import Shared
from algid.model import Model

from .conftest import Bench, problem_of


def test_a_payload_of_nothing_has_its_error_bar_where_lengths_are_known(bench: Bench) -> None:
    lengths = {"l1": bench.arm.l1, "l2": bench.arm.l2}
    first, second = (bench.log(sigma=1e-3, seed=seed) for seed in (1, 2))
    known = problem_of(first, loaded=[second], lengths=lengths)
    for fit in (weak.fit(known), refined.fit(known)):
        place = fit.names.index("m_p")
        assert fit.status[place] == "OK"
        assert abs(fit.values[place]) < 4 * fit.std[place]
        assert fit.std[place] < 0.02 * bench.payload


def _rows(seed: int, q: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Z (2, q, R), X (2, q, R) with an error in common with y (2, R), which X at c = (1, 2, 3)
    explains.
    """
    rng = np.random.default_rng(seed)
    Z, error = rng.standard_normal((2, q, 90)), 0.5 * rng.standard_normal((2, 90))
    X = Z + 0.3 * rng.standard_normal(Z.shape) + error[:, None]
    y = np.einsum("q,aqr->ar", np.arange(1.0, q + 1), X) + error * np.array([[1.0], [3.0]])
    return Z, X, y


def test_the_estimate_is_that_of_two_stages_of_least_squares() -> None:
    """Regress X on Z, then y on what that gives (Theil 1953), rows of each joint over its
    residual's deviation.
    """
    start = np.array([1.1, 1.8, 3.3])
    Z, X, y = _rows(1)
    # nine stretches of ten rows
    columns = np.concatenate([Z, X, y[:, None]], axis=1).reshape(2, 7, 9, 10)
    gram = np.einsum("axbr,aybr->baxy", columns, columns)
    found = weak.evidence(gram, 90, start, True, every=2)
    assert (found.loaded, found.S.shape) == (True, (9, 3, 3))
    residual = y - np.einsum("q,aqr->ar", start, X)
    level = np.sqrt(np.sum(residual**2, axis=1) / 90)
    z, x = (np.concatenate(part / level[:, None, None], axis=1).T for part in (Z, X))
    first = z @ np.linalg.lstsq(z, x, rcond=None)[0]
    # windows overlap eight-fold, every second is taken: a window's worth of rows counts as two
    S, g = found.total
    np.testing.assert_allclose(S, 0.5 * first.T @ first, rtol=1e-9)
    two_stages = np.linalg.lstsq(first, np.concatenate(y / level[:, None]), rcond=None)[0]
    np.testing.assert_allclose(start + np.linalg.solve(S, g), two_stages, rtol=1e-9)


def test_coefficients_that_move_no_arm_and_windows_that_run_away_are_told(bench: Bench) -> None:
    k, log = bench.arm.constants(), bench.log()
    wild = k * np.array([1, 1, 1, 1, 1, -500, -500])
    least = weak.fit(problem_of(log))
    for astray_at in (-k, wild):
        assert not instruments.evidence(problem_of(log), Shared(Model()), astray_at)
    astray = instruments.fit(problem_of(log), start=replace(least, values=-least.values))
    assert (astray.converged, set(astray.status), astray.estimator) == (
        False,
        {"NOT_CONVERGED"},
        "weak",
    )


def test_what_start_and_prior_know_stays_known(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    least = weak.fit(problem_of(log))
    found = instruments.fit(problem_of(log), start=least)
    np.testing.assert_array_equal(found.moved, least.moved)
    k4 = float(least.values[3])
    sure = Prior(
        ("k1", "k2", "k3", "k4"),
        np.array([*least.values[:3], 1.01 * k4]),
        np.diag([0, 0, 0, 1e10 / k4**2]),
    )
    told = instruments.fit(problem_of(log, prior=sure))
    assert told.prior is sure
    assert told.values[3] == pytest.approx(1.01 * k4, rel=1e-3)
    assert told.std[3] < 2e-5 * k4
