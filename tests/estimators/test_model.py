import math

import numpy as np
import pytest
import sympy as sp

from algid.model import (
    TERMS,
    UNITS,
    Model,
    Motion,
    regressor,
    sensitivity,
    sine_cosine,
    torque,
)
from tests.estimators.by_hand import evaluated, torque_by_hand

FULL = Model(tuple(TERMS), coulomb_speed=0.5, stribeck_speed=0.8)
VALUES = {
    **dict(
        zip(
            ("k1", "k2", "k3", "k4", "k5", "k6", "k7"),
            (0.03, 1.4, 0.05, 1.9, 0.06, 0.1, 0.2),
            strict=True,
        )
    ),
    "f1": 0.25,
    "f2": 0.15,
    "o1": 0.01,
    "o2": -0.02,
    "j2": 0.003,
    "s1": 0.05,
    "s2": 0.04,
    "a1": 0.02,
    "a2": -0.03,
    "e1": 0.05,
    "e2": 0.08,
    "gain2": 0.06,
    "k1s": 0.004,
    "k2s": -0.2,
    "k4s": 0.3,
    "h1": 2e-3,
    "h2": 5e-3,
    "r1": 0.0,
    "lag": 0.0,
}
C = np.array([VALUES[name] for name in FULL.names])


def _motion(seed: int = 0) -> Motion:
    rng = np.random.default_rng(seed)
    return Motion(
        rng.uniform(-3, 3, (2, 50)), rng.uniform(-2, 2, (2, 50)), rng.uniform(-40, 40, (2, 50))
    )


def test_the_torque_of_every_term_is_that_of_sympy() -> None:
    expected = evaluated(torque_by_hand(), FULL, VALUES, _motion())[:, 0]
    assert np.allclose(torque(FULL, C, _motion()), expected, rtol=1e-12, atol=1e-12)  # rounding


def test_the_sensitivity_of_every_term_is_that_of_sympy() -> None:
    slopes = torque_by_hand().jacobian([sp.Symbol(name) for name in FULL.names if name != "lag"])
    expected = evaluated(slopes, FULL, VALUES, _motion())
    ours = np.delete(sensitivity(FULL, C, _motion()), FULL.names.index("lag"), axis=1)
    assert np.allclose(ours, expected, rtol=1e-11, atol=1e-11)  # rounding


def test_the_regressor_gives_the_torque_and_is_its_slope_where_the_torque_is_linear() -> None:
    linear = Model(("coulomb", "stribeck", "asymmetry", "offset", "rotor"))
    c = np.array([VALUES[name] for name in linear.names])
    assert linear.linear
    assert not FULL.linear
    assert np.array_equal(regressor(linear, _motion()), sensitivity(linear, c, _motion()))
    assert np.allclose(
        np.einsum("aqn,q->an", regressor(FULL, _motion(), C), C), torque(FULL, C, _motion())
    )
    with pytest.raises(ValueError, match=r"load, gain.* depends on the coefficients"):
        regressor(FULL, _motion())


def test_terms_are_named_in_one_order_and_unknown_ones_refused() -> None:
    assert Model(("rotor", "coulomb")) == Model(("coulomb", "rotor"))
    assert Model(("rotor", "coulomb")).names[-3:] == ("f1", "f2", "j2")
    assert all(name in UNITS for name in FULL.names)
    assert all(term.needs is None or term.needs in TERMS for term in TERMS.values())
    with pytest.raises(ValueError, match="got 'backlash'"):
        Model(("coulomb", "backlash"))


def test_sine_and_cosine_are_exact_at_every_angle() -> None:
    # where the half angle's tangent has its poles and zeros
    corners = np.pi / 2 * np.arange(-40, 41)
    around = [
        corners,
        np.nextafter(corners, 1e9),
        np.nextafter(corners, -1e9),
        corners + 1e-8,
        corners - 1e-8,
    ]
    # an encoder that has turned for days
    wide = 1e6 * np.random.default_rng(3).standard_normal(1000)
    theta = np.concatenate([*around, wide])
    sine, cosine = sine_cosine(theta)
    unit = np.finfo(float).eps  # a unit in the last place of 1
    assert np.max(np.abs(sine - [math.sin(angle) for angle in theta])) <= unit
    assert np.max(np.abs(cosine - [math.cos(angle) for angle in theta])) <= unit


def test_a_horizontal_arm_has_no_gravity_columns() -> None:
    model = Model(("phases",), gravity=0.0)
    assert model.names == ("k1", "k3", "k5", "k6", "k7", "k1s")
    assert regressor(model, _motion(), np.zeros(6)).shape == (2, 6, 50)
    value = model.values(np.ones(6))
    assert value["k2"] == value["k4"] == 0.0 != value["k1s"]
