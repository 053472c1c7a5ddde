"""Eq. (1) against a Lagrangian derived by SymPy, and the tables against their own definitions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp

from algid.arm import (
    Arm,
    forward_dynamics,
    inverse_dynamics,
    read_only,
)
from algid.synth.cases import load_case
from tests.exports.arms import states

PAYLOAD = 0.35


@pytest.fixture(scope="module")
def lagrangian_torque() -> Callable[..., list[float]]:
    """τ(θ, ω, α, arm, m_p) by the Euler-Lagrange equations of two rigid links and a point mass."""
    time = sp.symbols("t")
    angle = [sp.Function(f"q{i}")(time) for i in (1, 2)]
    m1, m2, lc1, lc2, l1, l2, i1, i2, b1, b2, g, m_p = symbols = sp.symbols(
        "m1 m2 lc1 lc2 l1 l2 I1 I2 b1 b2 g m_p"
    )
    absolute = angle[0] + angle[1]
    elbow = sp.Matrix([l1 * sp.cos(angle[0]), l1 * sp.sin(angle[0])])
    direction = sp.Matrix([sp.cos(absolute), sp.sin(absolute)])
    points = [(m1, elbow * lc1 / l1), (m2, elbow + lc2 * direction), (m_p, elbow + l2 * direction)]
    kinetic = i1 * angle[0].diff(time) ** 2 / 2 + i2 * absolute.diff(time) ** 2 / 2
    kinetic += sum(m * place.diff(time).dot(place.diff(time)) / 2 for m, place in points)
    potential = sum(m * g * place[1] for m, place in points)
    lagrangian = kinetic - potential
    torque = [
        lagrangian.diff(q.diff(time)).diff(time) - lagrangian.diff(q) + b * q.diff(time)
        for q, b in zip(angle, (b1, b2), strict=True)
    ]
    plain = sp.symbols("a1 a2 v1 v2 x1 x2")
    order = [q.diff(time, 2) for q in angle] + [q.diff(time) for q in angle] + angle
    flat = [expression.subs(list(zip(order, plain, strict=True))) for expression in torque]
    return sp.lambdify((*plain, *symbols), flat, "numpy")


def physical(arm: Arm) -> tuple[float, ...]:
    return (arm.m1, arm.m2, arm.lc1, arm.lc2, arm.l1, arm.l2, arm.I1, arm.I2, arm.b1, arm.b2, arm.g)


@pytest.mark.parametrize("case", ["case1", "case2"])
@pytest.mark.parametrize("payload", [0.0, PAYLOAD])
def test_inverse_dynamics_is_the_lagrangian_s(
    case: str, payload: float, lagrangian_torque: Callable[..., list[float]]
) -> None:
    arm = load_case(case).arm
    theta, omega, alpha = states(200)
    k = arm.constants(payload)
    expected = np.array(lagrangian_torque(*alpha, *omega, *theta, *physical(arm), payload))
    # rounding of sums of terms up to 1 N m
    np.testing.assert_allclose(inverse_dynamics(k, theta, omega, alpha), expected, atol=1e-12)


def test_forward_dynamics_inverts_inverse_dynamics() -> None:
    k = load_case("case1").arm.constants()
    theta, omega, alpha = states(200)
    tau = inverse_dynamics(k, theta, omega, alpha)
    # the mass matrix has a condition number of about 10
    np.testing.assert_allclose(
        forward_dynamics(k, theta, omega, tau), alpha, rtol=1e-10, atol=1e-10
    )


def test_what_is_handed_out_read_only_cannot_be_written_to() -> None:
    own = np.arange(3.0)
    view = read_only(own)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0
    own[0] = 5.0
    assert view[0] == 5.0  # a view: no copy was made, and whose it is may still write
    assert own.flags.writeable
