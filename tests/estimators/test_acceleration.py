"""The torque solved for the accelerations, and friction's slopes: inverses and differences of what
SymPy holds.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.model import (
    TERMS,
    Model,
    Motion,
    acceleration,
    torque,
)
from tests.estimators.test_model import VALUES
from tests.exports.arms import states

WITHOUT_LAG = tuple(term for term in TERMS if term != "lag")
MODELS = [(), *((term,) for term in WITHOUT_LAG), ("coulomb", "stribeck", "asymmetry"), WITHOUT_LAG]


def _constants(model: Model) -> FloatArray:
    return np.array([VALUES[name] for name in model.names])


@pytest.mark.parametrize("gravity", [9.81, 0.0])
@pytest.mark.parametrize("terms", MODELS, ids=lambda terms: "+".join(terms) or "plain")
def test_accelerations_are_those_whose_torque_it_is(terms: tuple[str, ...], gravity: float) -> None:
    model = Model(terms, gravity, coulomb_speed=0.5)
    theta, omega, alpha = states(400)
    c = _constants(model)
    found = acceleration(model, c, theta, omega, torque(model, c, Motion(theta, omega, alpha)))
    # the mass matrix has a condition number of about 10
    np.testing.assert_allclose(found, alpha, rtol=1e-9, atol=1e-9)


def test_a_load_whose_sign_turns_is_found_from_either_side() -> None:
    """Friction by load of a third: loads near nothing have the sign of the torque left for them,
    or the other.
    """
    model = Model(("load",), coulomb_speed=0.1)
    c = np.array([*_constants(Model()), 0.3, 0.3])
    theta, omega, _ = states(2000)
    alpha = np.random.default_rng(3).normal(0, 2, theta.shape)
    tau = torque(model, c, Motion(theta, omega, alpha))
    kept = tau.copy()
    found = acceleration(model, c, theta, omega, tau)
    np.testing.assert_array_equal(tau, kept)
    again = torque(model, c, Motion(theta, omega, found))
    np.testing.assert_allclose(again, tau, rtol=1e-9, atol=1e-9)
