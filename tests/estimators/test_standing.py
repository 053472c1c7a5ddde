"""Residuals of joints that move and that stand, and what dry friction may be at rest."""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators.prediction import PredictionSums, score
from algid.estimators.standing import Standing, standing
from algid.model import Model
from algid.signals.segments import Segment

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
    found = standing(MODEL, coefficients(), rows(omega, np.array([0.25, -0.5, 0.4])), omega)
    assert found.rest == pytest.approx([2, 2])
    assert found.rmse_held[0] == pytest.approx(0.2 / np.sqrt(2))
    assert found.rmse_held[1] == pytest.approx(found.rmse_rest[1])  # joint 2 has no friction
    assert found.rmse_rest[0] == pytest.approx(np.sqrt((0.25**2 + 0.5**2) / 2))
    assert found.rmse_moving[0] == pytest.approx(0.1)
    assert np.isnan(Standing().rmse_rest).all()


def test_a_score_splits_its_residual_among_moving_and_standing_joints() -> None:
    t = 2e-3 * np.arange(3000)
    theta = np.stack([np.where(t < 3, 0.0, np.sin(2 * (t - 3)) ** 3), 0 * t])
    log = Segment(0.0, 2e-3, theta, 0.2 * np.ones_like(theta))
    found = score(MODEL, coefficients(), [log])
    states = found.standing
    assert states.moving + states.rest == pytest.approx([found.count, found.count])
    both = states.moving_square + states.rest_square
    assert both == pytest.approx(found.residual, rel=1e-9)
    assert states.rmse_held[0] < 0.2 * states.rmse_rest[0]
    linear = PredictionSums(MODEL)
    linear.push(log)
    linear.finish()
    assert not linear.score(coefficients()).standing.rest.any()
