"""The torque in an expression that C99 and Python read alike: what the modules of both languages are made of.

Written out for the model's own terms only. In them c1, c2, s2, c12 are cosines and sines of θ1, θ2 and θ1 + θ2, w1 and
w2 velocities, t1 and t2 tanh(ω / ω_s); constants have the names of `algid.model.COLUMN_NAMES` in capitals.
"""

from __future__ import annotations

from algid.export.description import Description

HELD = frozenset({"coulomb", "offset", "rotor", "stribeck", "asymmetry", "load", "gain", "zero"})
SMOOTH = frozenset({"coulomb", "stribeck", "asymmetry", "load"})  # terms with tanh(ω / ω_s)
M11 = "K5 + K3 + 2 * K1 * c2"
M12 = "K3 + K1 * c2"
MOTION = (
    "-K1 * s2 * (2 * w1 + w2) * w2 + K4 * c1 + K2 * c12",
    "K1 * s2 * w1 * w1 + K2 * c12",
)
"""n of both joints: the load L = M θ̈ + n less its inertial part."""


def constants(arm: Description) -> dict[str, float]:
    """Constants of the module by their names."""
    model, value = arm.coefficients.model, arm.coefficients.value
    found = {f"K{number}": value[f"k{number}"] for number in range(1, 8)}
    found |= {name.upper(): value[name] for name in model.names if name not in found and name[0] != "k"}
    if "gain" in model.terms:
        found["GAIN2"] = 1 + value["gain2"]
    if smooth(arm):
        found["COULOMB_SPEED"] = model.coulomb_speed
    if "stribeck" in model.terms:
        found["STRIBECK_SPEED"] = model.stribeck_speed
    return {name: one for name, one in found.items() if name != "LAG"}


def smooth(arm: Description) -> bool:
    """Whether a term follows tanh(ω / ω_s)."""
    return bool(SMOOTH & set(arm.coefficients.model.terms))


def angle(arm: Description, joint: int, name: str) -> str:
    """θ_i, with its zero offset."""
    return f"{name} + ZERO{joint}" if f"zero{joint}" in arm.coefficients.model.names else name


def friction(arm: Description, joint: int) -> str:
    """What joint i loses by its own velocity, and its offset."""
    terms, found = arm.coefficients.model.terms, [f"K{joint + 5} * w{joint}"]
    if "coulomb" in terms:
        found.append(f"F{joint} * t{joint}")
    if "stribeck" in terms:
        found.append(f"S{joint} * t{joint} * exp(-(w{joint} / STRIBECK_SPEED) * (w{joint} / STRIBECK_SPEED))")
    if "asymmetry" in terms:
        found.append(f"A{joint} * t{joint} * t{joint}")
    if "offset" in terms:
        found.append(f"O{joint}")
    return " + ".join(found)


def rotor(arm: Description) -> str:
    """What joint 2's rotor adds to M22."""
    return " + J2" if "rotor" in arm.coefficients.model.terms else ""


def gained(arm: Description) -> bool:
    """Whether the log's torque of joint 2 has a gain."""
    return "gain" in arm.coefficients.model.terms


def loaded(arm: Description) -> bool:
    """Whether friction grows with a joint's load."""
    return "load" in arm.coefficients.model.terms
