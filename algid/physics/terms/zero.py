"""Zeros of the angles that are a little off."""

from algid.physics.parameters import ANGLE, Parameter
from algid.physics.terms.base import Term

ZERO = Term(
    name="zero",
    title="zero offsets of the angles",
    equation="θ_i + zero_i in place of θ_i",
    parameters=(
        Parameter("zero1", "θ₁₀", "rad", "zero offset of θ1", ANGLE, "±", (-0.35, 0.35), weighs=True),
        Parameter("zero2", "θ₂₀", "rad", "zero offset of θ2", ANGLE, "±", (-0.35, 0.35)),
    ),
    turns=(("zero1", 0), ("zero2", 1)),
)
