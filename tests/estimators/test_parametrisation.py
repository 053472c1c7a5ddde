"""Shared parameters and each log's own: Table 2 and its derivatives by SymPy."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from algid.estimators.parametrisation import Shared
from algid.model import Model

VALUES = {
    **{f"k{number}": 0.1 * number for number in range(1, 8)},
    "f1": 0.3,
    "f2": 0.2,
    "delay": 5e-3,
    "m_p": 0.35,
    "l1": 0.2,
    "l2": 0.3,
}


def by_hand(shared: Shared) -> tuple[sp.Matrix, list[sp.Symbol]]:
    """The coefficients of a loaded log in the shared parameters: k + z, eq. (5) against eq. (3)."""
    symbol = {name: sp.Symbol(name) for name in VALUES}
    m, g = symbol["m_p"], sp.Float(shared.model.gravity)
    l1, l2 = (
        sp.Float(shared.lengths[name]) if name in shared.lengths else symbol[name]
        for name in ("l1", "l2")
    )
    added = {
        "k1": m * l1 * l2,
        "k2": m * g * l2,
        "k3": m * l2**2,
        "k4": m * g * l1,
        "k5": m * l1**2,
    }
    return sp.Matrix([symbol[name] + added.get(name, 0) for name in shared.log_names]), [
        symbol[name] for name in shared.names
    ]


@pytest.mark.parametrize("delay", [False, True])
@pytest.mark.parametrize(
    "model", [Model(), Model(("coulomb",)), Model(gravity=0.0)], ids=["plain", "terms", "flat"]
)
@pytest.mark.parametrize(
    "lengths", [{}, {"l1": 0.2}, {"l2": 0.3}, {"l1": 0.2, "l2": 0.3}], ids="+".join
)
def test_a_loaded_log_has_the_constants_of_table_2(
    lengths: dict[str, float], model: Model, delay: bool
) -> None:
    shared = Shared(model, delay, True, lengths)
    assert shared.names == (
        *shared.log_names,
        *(name for name in ("m_p", "l1", "l2") if name not in lengths),
    )
    expected, symbols = by_hand(shared)
    beta = np.array([VALUES[name] for name in shared.names])
    at = dict(zip(symbols, beta.tolist(), strict=True))
    c = np.array(expected.subs(at)).astype(float)[:, 0]
    np.testing.assert_allclose(shared.coefficients(beta, True), c, rtol=1e-14)
    T = np.array(expected.jacobian(symbols).subs(at)).astype(float)
    # rounding of differences over a unit step
    np.testing.assert_allclose(shared.jacobian(beta, True), T, rtol=1e-13, atol=1e-14)
    assert shared.physical(beta) == pytest.approx((0.35, 0.2, 0.3, 0.0))
    np.testing.assert_array_equal(shared.coefficients(beta, False), beta[: len(shared.log_names)])
    np.testing.assert_array_equal(
        shared.jacobian(beta, False), np.eye(len(shared.log_names), beta.size)
    )


@pytest.mark.parametrize("body", [(), ("J_p",), ("y_p",), ("y_p", "J_p")], ids="+".join)
def test_a_body_and_phasors_follow_from_the_complex_form(body: tuple[str, ...]) -> None:
    """Kinetic and potential energy of a body carried along, against the coefficients and their
    differences.
    """
    shared = Shared(Model(("phases",)), payload=True, body=body)
    value = {**VALUES, "k1s": 0.02, "k2s": -0.03, "k4s": 0.05, "y_p": 0.04, "J_p": 0.003}
    beta = np.array([value[name] for name in shared.names])
    turn = np.angle(complex(0.2, -0.03)) - np.angle(complex(0.1, 0.02))
    r = complex(0.3, 0.04 if "y_p" in body else 0.0)
    added = shared.coefficients(beta, True) - shared.coefficients(beta, False)
    grown = dict(zip(shared.log_names, added.tolist(), strict=True))
    up = 9.81 * 0.35 * np.exp(1j * turn)
    assert complex(grown["k1"], grown["k1s"]) == pytest.approx(0.35 * 0.2 * r)
    assert complex(grown["k2"], grown["k2s"]) == pytest.approx(up * r)
    assert complex(grown["k4"], grown["k4s"]) == pytest.approx(up * 0.2)
    assert grown["k3"] == pytest.approx(0.35 * abs(r) ** 2 + (0.003 if "J_p" in body else 0.0))
    assert grown["k5"] == pytest.approx(0.35 * 0.2**2)
    T = shared.jacobian(beta, True)
    for place in range(beta.size):
        step = np.zeros(beta.size)
        step[place] = 1e-7
        slope = (
            shared.coefficients(beta + step, True) - shared.coefficients(beta - step, True)
        ) / 2e-7
        np.testing.assert_allclose(T[:, place], slope, atol=1e-7)
