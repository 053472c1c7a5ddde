"""Residuals of joints that move and that stand, and what dry friction may be at rest."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators.prediction import PredictionScore, sums_of
from algid.model import Model

MODEL = Model(("coulomb",), coulomb_speed=0.1)
FRICTION = 0.3


def coefficients() -> FloatArray:
    c = np.zeros(len(MODEL.names))
    c[MODEL.names.index("f1")] = FRICTION
    return c


def rows(omega: FloatArray, torque: FloatArray) -> FloatArray:
    """X of joint 1's friction alone, the same torque on both joints."""
    X = np.zeros((2, len(MODEL.names) + 1, omega.shape[1]))
    X[0, MODEL.names.index("f1")] = np.tanh(omega[0] / MODEL.coulomb_speed)
    X[:, -1] = torque
    return X


def test_a_torque_within_friction_at_rest_is_no_error() -> None:
    """By hand: at rest 0.25 lies within ± 0.3, 0.5 lies 0.2 beyond; moving, friction is 0.3."""
    omega = np.array([[0.0, 0.0, 9.0], [0.0, 0.0, 9.0]])
    sums = sums_of(MODEL, coefficients(), rows(omega, np.array([0.25, -0.5, 0.4])), omega)
    assert sums[6] == pytest.approx([2, 2])
    moving, rest, held = PredictionScore(3.0, sums).by_state
    assert held[0] == pytest.approx(0.2 / np.sqrt(2))
    assert held[1] == pytest.approx(rest[1])  # joint 2 has no friction
    assert rest[0] == pytest.approx(np.sqrt((0.25**2 + 0.5**2) / 2))
    assert moving[0] == pytest.approx(0.1)
    assert np.isnan(PredictionScore().by_state).all()
