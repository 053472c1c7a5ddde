"""The simulator against what mechanics keeps, decoupled arms in closed form, MuJoCo and
Pinocchio.
"""

from __future__ import annotations

import numpy as np
import pytest

from algid.arm import FloatArray, mass_matrix
from algid.exports.formats import exported
from algid.model import Model
from tests.exports.arms import ODD, result_of, states, values_of


def test_mujocos_inertia_and_acceleration_are_alike() -> None:
    mujoco = pytest.importorskip("mujoco")
    value = values_of(ODD, j2=0.004)
    model = mujoco.MjModel.from_xml_string(
        exported(result_of(value, Model(("rotor",))), "arm", "mjcf", {})[0]
    )
    data, (theta, omega, tau) = mujoco.MjData(model), states(40)
    k = np.array(list(value.values()))[:7]
    full = np.zeros((2, 2))
    for q, v, u in zip(theta.T, omega.T, tau.T, strict=True):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, u
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        m11, m12, m22 = (float(one[0]) for one in mass_matrix(k, q[:, None]))
        expected = np.array([[m11, m12], [m12, m22 + 0.004]])
        np.testing.assert_allclose(full, expected, rtol=0, atol=1e-9 * m11)
        rest = u - _passive(k, q, v)
        np.testing.assert_allclose(data.qacc, np.linalg.solve(expected, rest), rtol=1e-7, atol=1e-7)


def _passive(k: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """Coriolis, weight and friction of eq. (1), written out."""
    k1, k2, _, k4, _, k6, k7 = k
    s2, c12 = np.sin(q[1]), np.cos(q[0] + q[1])
    return np.array(
        [
            -k1 * s2 * (2 * v[0] * v[1] + v[1] ** 2) + k6 * v[0] + k4 * np.cos(q[0]) + k2 * c12,
            k1 * s2 * v[0] ** 2 + k7 * v[1] + k2 * c12,
        ]
    )
