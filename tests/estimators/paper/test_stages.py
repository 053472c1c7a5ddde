"""The paper's two stages on simulated motions, whose constants they were not built on."""

from __future__ import annotations

import numpy as np

from algid.estimators.paper import (
    STAGE1_SERIES,
    estimates,
    series_of,
    solve_scaled,
    stage1,
    wanders,
)
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from algid.synth.excitation import no_torque
from algid.synth.simulator import simulate

DT = 1e-3
T = DT * np.arange(1001)


def test_an_arm_that_hangs_still_is_singular_everywhere() -> None:
    k = load_case("case1").arm.constants()
    still = simulate(k, no_torque, T)
    with np.errstate(invalid="raise"):
        found = stage1(still.theta, np.zeros_like(still.omega), still.tau, DT)
    assert np.isnan(found[:7]).all()


def test_noise_alone_wanders() -> None:
    draw = np.random.default_rng(0)
    shape = (2, 4001)
    still = Segment(
        0.0,
        DT,
        draw.normal(0, 1e-3, shape),
        draw.normal(0, 1e-2, shape),
        draw.normal(0, 0.1, shape),
    )
    windows = list(series_of([still], 2.0, stage1))
    assert wanders(*estimates([one.settled for one in windows], len(STAGE1_SERIES)))[:7].any()
    # what is not settled counts nothing: the last 0.2 s alone
    late = windows[0].values[:, -200:]
    np.testing.assert_allclose(windows[0].settled[1], np.nanmedian(late, axis=1))


def test_systems_of_any_scale_are_solved_alike() -> None:
    draw = np.random.default_rng(5)
    matrix, x = draw.normal(size=(6, 6, 40)), draw.normal(size=(6, 40))
    rows, columns = 10.0 ** draw.integers(-9, 9, 6), 10.0 ** draw.integers(-9, 9, 6)
    scaled = matrix * rows[:, None, None] * columns[None, :, None]
    rhs = rows[:, None] * np.einsum("ijn,jn->in", matrix, x)
    x_found, condition = solve_scaled(scaled, rhs)
    # condition numbers to 1e3, times rounding
    np.testing.assert_allclose(x_found * columns[:, None], x, rtol=1e-10)
    expected = np.linalg.cond(np.moveaxis(matrix, -1, 0))
    assert np.all(condition < 200 * expected)


def test_a_condition_that_leaves_less_than_a_percent_is_singular() -> None:
    """[[1, 1], [1, 1 + e]] has the condition (2 + e)² / e in the 1-norm.

    Nested sums round by 1e-12.
    """
    e = np.array([1e-3, 1e-8, 1e-9, 5e-10, 3e-10, 1e-11])
    ones = np.ones_like(e)
    x, condition = solve_scaled(
        np.array([[ones, ones], [ones, 1 + e]]), np.array([2 * ones, 2 + e])
    )
    np.testing.assert_allclose(condition, 4 / e, rtol=2e-3)
    np.testing.assert_allclose(x[:, :4], 1, rtol=1e-5)
    assert np.isnan(x[:, 4:]).all()
