"""Signals of the terms of motion: angles, their sines and cosines, velocities, friction shapes.

=========  ==========================================  ======
name       meaning                                     unit
=========  ==========================================  ======
Q1, Q2     θ1, θ2                                      rad
W1, W2     ω1, ω2                                      rad/s
A1, A2     θ̈1, θ̈2                                      rad/s²
S1 … C12   sine and cosine of θ1, θ2, θ1 + θ2          1
T1, T2     tanh(ω / ω_s), the smooth sign              1
H1, H2     exp(-(ω / ω_S)²), Stribeck's fading         1
=========  ==========================================  ======
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from algid.arm import FloatArray
from algid.physics.expressions import ONE, Atom, Expression
from algid.physics.motion import Motion, Widths


def expression(atom: Atom) -> Expression:
    """An atom as an expression."""
    return Expression({(atom,): 1.0})


def _channel(name: str, quantity: str, joint: int) -> Atom:
    """A row of the motion itself."""
    signal = f"{quantity}{joint + 1}"

    def value(motion: Motion, _shape: Widths) -> FloatArray:
        row: FloatArray = getattr(motion, quantity)[joint]
        return row

    return Atom(name, value, "", lambda: {signal: ONE})


def _trigonometric(name: str, place: int, source: str, turned: str, sign: float) -> Atom:
    """A sine or a cosine; its derivative is `sign` times the one called `turned`."""

    def slopes() -> Mapping[str, Expression]:
        slope = expression(_TRIGONOMETRIC[turned]) * sign
        return {f"theta{joint}": slope for joint in name[1:]}

    return Atom(name, lambda motion, _shape: motion.trigonometry[place], source, slopes)


_TRIGONOMETRIC = {
    "s1": _trigonometric("s1", 0, "sin(q1)", "c1", 1.0),
    "c1": _trigonometric("c1", 1, "cos(q1)", "s1", -1.0),
    "s2": _trigonometric("s2", 2, "sin(q2)", "c2", 1.0),
    "c2": _trigonometric("c2", 3, "cos(q2)", "s2", -1.0),
    "s12": _trigonometric("s12", 4, "sin(q1 + q2)", "c12", 1.0),
    "c12": _trigonometric("c12", 5, "cos(q1 + q2)", "s12", -1.0),
}


def _none() -> Mapping[str, Expression]:
    return {}


def _width(name: str, which: str) -> Atom:
    """One over a width of friction."""

    def constant(shape: Widths) -> float:
        return 1 / float(getattr(shape, which))

    return Atom(
        name, lambda _motion, shape: np.asarray(constant(shape)), "", _none, constant, (which,)
    )


COULOMB_RATE = expression(_width("COULOMB_RATE", "coulomb_speed"))
STRIBECK_RATE = expression(_width("STRIBECK_RATE", "stribeck_speed"))


def _sign(joint: int) -> Atom:
    """The smooth sign of a velocity, tanh(ω / ω_s)."""

    def slopes() -> Mapping[str, Expression]:
        t = expression(_SIGNS[joint])
        return {f"omega{joint + 1}": (1 - t * t) * COULOMB_RATE}

    def value(motion: Motion, shape: Widths) -> FloatArray:
        return np.tanh(motion.omega[joint] / shape.coulomb_speed)

    text = f"tanh(w{joint + 1} / COULOMB_SPEED)"
    return Atom(f"t{joint + 1}", value, text, slopes, shapes=("coulomb_speed",))


def _fading(joint: int) -> Atom:
    """What is left of Stribeck's friction at a velocity, exp(-(ω / ω_S)²)."""

    def slopes() -> Mapping[str, Expression]:
        w = (W1, W2)[joint]
        return {
            f"omega{joint + 1}": expression(_FADINGS[joint])
            * w
            * STRIBECK_RATE
            * STRIBECK_RATE
            * -2.0
        }

    def value(motion: Motion, shape: Widths) -> FloatArray:
        return np.exp(-((motion.omega[joint] / shape.stribeck_speed) ** 2))

    part = f"(w{joint + 1} / STRIBECK_SPEED)"
    text = f"exp(-{part} * {part})"
    return Atom(f"h{joint + 1}", value, text, slopes, shapes=("stribeck_speed",))


_SIGNS, _FADINGS = (_sign(0), _sign(1)), (_fading(0), _fading(1))
ACCELERATIONS = (_channel("alpha1", "alpha", 0), _channel("alpha2", "alpha", 1))

Q1, Q2 = (expression(_channel(f"q{joint + 1}", "theta", joint)) for joint in range(2))
W1, W2 = (expression(_channel(f"w{joint + 1}", "omega", joint)) for joint in range(2))
A1, A2 = map(expression, ACCELERATIONS)
S1, C1, S2, C2, S12, C12 = map(expression, _TRIGONOMETRIC.values())
T1, T2 = map(expression, _SIGNS)
H1, H2 = map(expression, _FADINGS)

RATES = {"theta1": W1, "theta2": W2, "omega1": A1, "omega2": A2}
"""What each signal's derivative by time is."""


def rate(e: Expression) -> Expression:
    """The derivative by time of an expression without accelerations."""
    total = Expression({})
    for signal, speed in RATES.items():
        total = total + e.by(signal) * speed
    return total
