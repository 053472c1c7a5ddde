"""Shared parameters and each log's own: Table 2 in complex form, and its derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators.parametrisation import Shared
from algid.model import Model

VALUES = {f"k{number}": 0.1 * number for number in range(1, 8)}
VALUES |= {"k1s": 0.02, "k2s": -0.03, "k4s": 0.05, "f1": 0.3, "f2": 0.2, "delay": 5e-3}
VALUES |= {"m_p": 0.35, "l1": 0.2, "l2": 0.3, "y_p": 0.04, "J_p": 0.003}


@pytest.mark.parametrize("body", [(), ("J_p",), ("y_p",), ("y_p", "J_p")], ids="+".join)
@pytest.mark.parametrize("given", [(), ("l1",), ("l2",), ("l1", "l2")], ids="+".join)
@pytest.mark.parametrize(
    ("model", "delay"),
    [
        (Model(), False),
        (Model(("coulomb",)), True),
        (Model(("phases",)), False),
        (Model(("phases",), gravity=0.0), True),
    ],
    ids=["plain", "terms", "phases", "flat"],
)
def test_a_loaded_log_has_the_constants_of_table_2(
    model: Model, delay: bool, given: tuple[str, ...], body: tuple[str, ...]
) -> None:
    """k + z of eq. (5): kinetic and potential energy of a body that is carried along."""
    shared = Shared(model, delay, True, {name: VALUES[name] for name in given}, body)
    own = shared.log_names
    free = [name for name in ("m_p", "l1", "l2") if name not in given]
    assert shared.names == (*own, *free, *body)
    beta = np.array([VALUES[name] for name in shared.names])
    r, J = complex(0.3, 0.04 * ("y_p" in body)), 0.003 * ("J_p" in body)
    assert shared.physical(beta) == pytest.approx((0.35, 0.2, r, J))
    turn = np.angle(complex(0.2, -0.03)) - np.angle(complex(0.1, 0.02)) if "k2s" in own else 0.0
    up = model.gravity * 0.35 * np.exp(1j * turn)
    moments = {"k1": 0.35 * 0.2 * r, "k2": up * r, "k4": up * 0.2}
    z = {name: one.real for name, one in moments.items()}
    z |= {f"{name}s": one.imag for name, one in moments.items()}
    z |= {"k3": 0.35 * abs(r) ** 2 + J, "k5": 0.35 * 0.2**2}
    c = beta[: len(own)] + [z.get(name, 0.0) for name in own]
    np.testing.assert_allclose(shared.coefficients(beta, True), c, rtol=1e-13)
    np.testing.assert_array_equal(shared.coefficients(beta, False), beta[: len(own)])
    np.testing.assert_array_equal(shared.jacobian(beta, False), np.eye(len(own), beta.size))
    T, steps = shared.jacobian(beta, True), 1e-6 * np.eye(beta.size)
    ahead, behind = (
        np.array([shared.coefficients(beta + sign * step, True) for step in steps]).T
        for sign in (1, -1)
    )
    np.testing.assert_allclose(T, (ahead - behind) / 2e-6, atol=1e-8)
