"""The torque of every term, derived by SymPy from Lagrange's equations: the truth beside
`algid.model`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import sympy as sp

from algid.arm import FloatArray
from algid.model import COLUMN_NAMES, Model, Motion


@cache
def torque_by_hand() -> sp.Matrix:
    """The torque (2, 1) in the symbols of `COLUMN_NAMES`, of ws and wS (ω_s and ω_S) and of the
    motion.
    """
    t = sp.Symbol("t")
    angles = [sp.Function(f"q{joint}")(t) for joint in (1, 2)]
    speeds = [angle.diff(t) for angle in angles]
    value = {name: sp.Symbol(name) for name in COLUMN_NAMES}
    q1, q2 = angles
    k1, k2, k3, k4, k5 = (value[f"k{number}"] for number in range(1, 6))
    coupling = k1 * sp.cos(q2) - value["k1s"] * sp.sin(q2)
    kinetic = ((k5 + k3 + 2 * coupling) * speeds[0] ** 2 + k3 * speeds[1] ** 2) / 2
    kinetic += (k3 + coupling) * speeds[0] * speeds[1]
    potential = k4 * sp.sin(q1) + k2 * sp.sin(q1 + q2)
    potential += value["k4s"] * sp.cos(q1) + value["k2s"] * sp.cos(q1 + q2)
    lagrangian = kinetic - potential
    torques = []
    for joint, (angle, speed) in enumerate(zip(angles, speeds, strict=True), 1):
        load = lagrangian.diff(speed).diff(t) - lagrangian.diff(angle)
        sign = sp.tanh(speed / sp.Symbol("ws"))
        friction = (
            value[f"k{joint + 5}"] * speed
            + value[f"f{joint}"] * sign
            + value[f"a{joint}"] * sign**2
        )
        friction += value[f"s{joint}"] * sign * sp.exp(-((speed / sp.Symbol("wS")) ** 2))
        friction += value[f"e{joint}"] * sp.sqrt(load**2) * sign
        torques.append(load + friction + value[f"o{joint}"])
    torques[1] = (torques[1] + value["j2"] * speeds[1].diff(t)) * (1 + value["gain2"])
    plain = [
        (angle.diff(t, order), sp.Symbol(f"{letter}{joint}"))
        for order, letter in ((2, "alpha"), (1, "omega"), (0, "theta"))
        for joint, angle in enumerate(angles, 1)
    ]
    return sp.Matrix([torque.doit().subs(plain) for torque in torques])


def evaluated(
    expression: sp.Matrix, model: Model, values: Mapping[str, float], motion: Motion
) -> FloatArray:
    """The matrix (n, m, N) along a motion, coefficients by name; those not named are nothing."""
    signals = {
        f"{letter}{j + 1}": x[j]
        for letter, x in vars(motion).items()
        if letter in ("theta", "omega", "alpha")
        for j in range(2)
    }
    known = {
        **dict.fromkeys(COLUMN_NAMES, 0.0),
        **values,
        "ws": model.coulomb_speed,
        "wS": model.stribeck_speed,
        **signals,
    }
    names = sorted(map(str, expression.free_symbols))
    rows = [
        sp.lambdify(names, entry, "numpy")(*(known[name] for name in names)) for entry in expression
    ]
    return np.array([np.broadcast_to(row, motion.theta.shape[1:]) for row in rows]).reshape(
        *expression.shape, -1
    )
