"""The paper's two stages on simulated motions, whose constants they were not built on."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import with_payload
from algid.estimators.paper import (
    STAGE1_SERIES,
    Summary,
    series_of,
    solve_scaled,
    stage1,
    stage2,
    wanders,
)
from algid.signals.segments import Segment
from algid.synth.cases import Case, load_case
from algid.synth.excitation import no_torque
from algid.synth.simulator import SimulatedMotion, simulate

DT = 1e-3
T = DT * np.arange(1001)


def motion(case: Case, payload: float = 0.0) -> SimulatedMotion:
    k = with_payload(case.arm.constants(), case.arm.payload_constants(payload))
    torque = case.torque
    assert torque is not None
    return simulate(k, torque, T)


@pytest.fixture(scope="module", params=["case1", "case2"])
def case(request: pytest.FixtureRequest) -> Case:
    return load_case(request.param)


def test_exact_velocities_give_every_row_within_a_thousandth_of_a_percent(case: Case) -> None:
    k = case.arm.constants()
    bare = motion(case)
    found = stage1(bare.theta, bare.omega, bare.tau, DT)
    np.testing.assert_allclose(found[:7, -1], k, rtol=1e-5)
    loaded_k = with_payload(k, case.arm.payload_constants(case.payload))
    loaded = motion(case, case.payload)
    second = stage2(loaded.theta, loaded.omega, loaded.tau, DT, found[:7, -1], case.arm.g)
    k1, k2, k3, k4, k5, _, _ = loaded_k
    np.testing.assert_allclose(second[:5, -1], [k5 + k3, k1, k3, k4, k2], rtol=1e-5)
    assert second[6, -1] == pytest.approx(case.payload, rel=1e-5)
    assert second[5, -1] == pytest.approx(case.arm.l1, rel=1e-5)


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
    summary = Summary(len(STAGE1_SERIES))
    for series in series_of([still], 2.0, stage1):
        summary.add(series)
    assert wanders(*summary.estimates())[:7].any()


def test_systems_of_any_scale_are_solved_alike() -> None:
    draw = np.random.default_rng(5)
    matrix, x = draw.normal(size=(6, 6, 40)), draw.normal(size=(6, 40))
    rows, columns = 10.0 ** draw.integers(-9, 9, 6), 10.0 ** draw.integers(-9, 9, 6)
    scaled = matrix * rows[:, None, None] * columns[None, :, None]
    rhs = rows[:, None] * np.einsum("ijn,jn->in", matrix, x)
    found = solve_scaled(scaled, rhs)
    # condition numbers to 1e3, times rounding
    np.testing.assert_allclose(found.x * columns[:, None], x, rtol=1e-10)
    expected = np.linalg.cond(np.moveaxis(matrix, -1, 0))
    assert np.all(found.condition < 200 * expected)


def test_a_condition_that_leaves_less_than_a_percent_is_singular() -> None:
    """[[1, 1], [1, 1 + e]] has the condition (2 + e)² / e in the 1-norm.

    Nested sums round by 1e-12.
    """
    e = np.array([1e-3, 1e-8, 1e-9, 5e-10, 3e-10, 1e-11])
    ones = np.ones_like(e)
    found = solve_scaled(np.array([[ones, ones], [ones, 1 + e]]), np.array([2 * ones, 2 + e]))
    np.testing.assert_allclose(found.condition, 4 / e, rtol=2e-3)
    np.testing.assert_allclose(found.x[:, :4], 1, rtol=1e-5)
    assert np.isnan(found.x[:, 4:]).all()
