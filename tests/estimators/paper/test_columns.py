"""The paper's integrals in closed form, its rows, and what windows and logs make of its
estimates.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from algid.arm import FloatArray, inverse_dynamics
from algid.estimators import paper
from algid.estimators.paper import (
    columns,
    estimates,
    quartiles,
    wanders,
)
from algid.synth.cases import load_case


def _by_sympy(
    t: FloatArray, q1: sp.Expr, q2: sp.Expr, torques: tuple[sp.Expr, sp.Expr]
) -> dict[str, FloatArray]:
    """∫∫ t² of what stands beside each unknown of eq. (1), twice from nought, with no integration
    by parts.
    """
    s = sp.Symbol("s")
    v1, v2 = sp.diff(q1, s), sp.diff(q2, s)
    signals = {
        "inertia1": sp.diff(v1, s),
        "inertia2": sp.diff(v2, s),
        "viscous1": v1,
        "viscous2": v2,
        "torque1": torques[0],
        "torque2": torques[1],
    }
    twice = {}
    for name, signal in signals.items():
        once = sp.integrate(sp.expand(s**2 * signal), s)
        twice[name] = sp.integrate(sp.expand(once - once.subs(s, 0)), s)
    return {
        name: sp.lambdify(s, found - found.subs(s, 0), "numpy")(t) for name, found in twice.items()
    }


@pytest.mark.parametrize("start", [0.0, 0.8])
def test_columns_are_the_integrals_of_polynomial_motions(start: float) -> None:
    """Whatever the angles and velocities at the window's start: t² takes them out."""
    s, dt = sp.Symbol("s"), 2e-3
    t = dt * np.arange(501)
    q1, q2 = start + sp.Rational(3, 10) * s - s**2 / 2 + s**3 / 5, -2 * start + s**2 - s**3 / 3
    torques = (1 + s - s**2, 2 * s**3)
    exact = _by_sympy(t, q1, q2, torques)

    def at(expression: sp.Expr) -> FloatArray:
        return np.asarray(
            np.broadcast_to(sp.lambdify(s, expression, "numpy")(t), t.shape), dtype=np.float64
        )

    theta, omega = np.stack([at(q1), at(q2)]), np.stack([at(sp.diff(q1, s)), at(sp.diff(q2, s))])
    found = columns(theta, omega, np.stack([at(one) for one in torques]), dt)
    for name, expected in exact.items():
        # Simpson's dt⁴ and rounding
        np.testing.assert_allclose(getattr(found, name), expected, atol=1e-8)


def test_joint_2_at_rest_leaves_k7_open_and_its_condition_infinite() -> None:
    t = 1e-3 * np.arange(1001)
    still = np.zeros_like(t)
    theta, omega = np.stack([np.sin(5 * t), still]), np.stack([5 * np.cos(5 * t), still])
    alpha = np.stack([-25 * np.sin(5 * t), still])
    found = paper.stage1(
        theta,
        omega,
        inverse_dynamics(load_case("case1").arm.constants(), theta, omega, alpha),
        1e-3,
    )
    assert np.isinf(found[9]).all()
    assert np.isnan(found[6]).all()


def test_an_estimate_is_the_median_of_medians_and_wanders_by_half_its_quartiles() -> None:
    assert np.isnan(estimates([], 3)).all()
    nan = np.nan
    windows = [quartiles(np.array([[1, 2, 3, 4], [nan, 5, 5, 5], [nan] * 4]))]
    estimate, wander = estimates(windows, 3)
    np.testing.assert_allclose(estimate, [2.5, 5, nan])
    np.testing.assert_allclose(wander, [0.5 * (3.25 - 1.75), 0, nan])
    windows.append(quartiles(np.array([[7.0] * 4, [nan] * 4, [nan] * 4])))
    windows.append(quartiles(np.array([[3.0] * 4, [1.0] * 4, [nan] * 4])))
    estimate, wander = estimates(windows, 3)
    np.testing.assert_allclose(estimate, [3, 3, nan])  # medians 2.5, 7, 3 and 5, 1
    # between windows more than within
    np.testing.assert_allclose(wander, [0.5 * (5 - 2.75), 0.5 * (4 - 2), nan])
    assert wanders(estimate, wander).tolist() == [False, False, True]
    assert wanders(np.array([-1.0, 1.0]), np.array([1.0, 1.1])).tolist() == [False, True]
