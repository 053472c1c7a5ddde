import math

import numpy as np

from algid import arm
from algid.model import Model, Motion, partials, regressor, sine_cosine

FULL = Model(coulomb=True, offset=True, rotor=True, coulomb_speed=0.5)
C = np.array([0.03, 1.4, 0.05, 1.9, 0.06, 0.1, 0.2, 0.25, 0.15, 0.01, -0.02, 0.003])


def _motion(seed: int = 0) -> Motion:
    rng = np.random.default_rng(seed)
    return Motion(rng.uniform(-3, 3, (2, 50)), rng.uniform(-5, 5, (2, 50)), rng.uniform(-40, 40, (2, 50)))


def _torque(motion: Motion) -> np.ndarray:
    return np.einsum("aqn,q->an", regressor(FULL, motion), C)


def test_plain_columns_are_those_of_the_arm() -> None:
    motion = _motion()
    ours = regressor(Model(), motion)
    assert np.allclose(ours, arm.regressor(motion.theta, motion.omega, motion.alpha), atol=1e-13)  # rounding


def test_sine_and_cosine_are_exact_at_every_angle() -> None:
    corners = np.pi / 2 * np.arange(-40, 41)  # where the half angle's tangent has its poles and zeros
    around = [corners, np.nextafter(corners, 1e9), np.nextafter(corners, -1e9), corners + 1e-8, corners - 1e-8]
    wide = 1e6 * np.random.default_rng(3).standard_normal(1000)  # an encoder that has turned for days
    theta = np.concatenate([*around, wide])
    sine, cosine = sine_cosine(theta)
    unit = np.finfo(float).eps  # a unit in the last place of 1
    assert np.max(np.abs(sine - [math.sin(angle) for angle in theta])) <= unit
    assert np.max(np.abs(cosine - [math.cos(angle) for angle in theta])) <= unit


def test_partials_are_the_slopes_of_the_torque() -> None:
    motion, step = _motion(), 1e-6
    slopes = partials(FULL, C, motion)
    for order in range(3):
        for joint in range(2):
            signals = [motion.theta, motion.omega, motion.alpha]
            move = np.zeros((2, 1))
            move[joint] = step
            ahead = [s + move * (place == order) for place, s in enumerate(signals)]
            behind = [s - move * (place == order) for place, s in enumerate(signals)]
            expected = (_torque(Motion(*ahead)) - _torque(Motion(*behind))) / (2 * step)
            assert np.allclose(slopes[order, :, joint], expected, atol=1e-6)  # central differences


def test_a_horizontal_arm_has_no_gravity_columns() -> None:
    model = Model(gravity=0.0)
    assert model.names == ("k1", "k3", "k5", "k6", "k7")
    assert regressor(model, _motion()).shape == (2, 5, 50)
    assert model.expand(np.ones(5))[[1, 3]].tolist() == [0.0, 0.0]
