"""Residuals of joints that move and that stand, and what dry friction may be at rest."""

from __future__ import annotations

import numpy as np
import pytest

from algid.estimators.prediction import sums_of
from algid.identification.validate import prediction
from algid.model import Model

MODEL = Model(("coulomb",), coulomb_speed=0.1)


def test_a_torque_within_friction_at_rest_is_no_error() -> None:
    """By hand: at rest 0.25 lies within ± 0.3, 0.5 lies 0.2 beyond; moving, friction is 0.3."""
    omega = np.array([[0.0, 0.0, 9.0], [0.0, 0.0, 9.0]])
    place, c = MODEL.names.index("f1"), np.zeros(len(MODEL.names))
    X = np.zeros((2, c.size + 1, 3))
    c[place], X[0, place], X[:, -1] = 0.3, [0.0, 0.0, 1.0], [0.25, -0.5, 0.4]
    sums = sums_of(MODEL, c, X, omega)
    assert sums[6] == pytest.approx([2, 2])
    found = prediction(sums)
    moving, rest, held = found.rmse_moving, found.rmse_rest, found.rmse_held
    assert held[0] == pytest.approx(0.2 / np.sqrt(2))
    assert held[1] == pytest.approx(rest[1])  # joint 2 has no friction
    assert rest[0] == pytest.approx(np.sqrt((0.25**2 + 0.5**2) / 2))
    assert moving[0] == pytest.approx(0.1)
    sums[4:6] = 0
    assert prediction(sums).rmse_moving == (None, None)
