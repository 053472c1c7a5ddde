"""Friction in proportion to the joint's load, as of gears: bilinear in parameters and motion."""

from algid.physics.parameters import LOAD_SHARE, Parameter
from algid.physics.terms.base import PriorSpread, Term

LOAD = Term(
    name="load",
    title="friction in proportion to the joint's load",
    equation="e_i |L_i| tanh(ω_i / ω_s)",
    parameters=(
        Parameter(
            "e1",
            "e₁",
            "1",
            "share of joint 1's load that is lost to friction",
            LOAD_SHARE,
            "±",
            (0.0, 0.5),
        ),
        Parameter(
            "e2",
            "e₂",
            "1",
            "share of joint 2's load that is lost to friction",
            LOAD_SHARE,
            "±",
            (0.0, 0.5),
        ),
    ),
    shapes=("coulomb_speed",),
    by_load=(("e1", 0), ("e2", 1)),
    spread=PriorSpread(0.03),
)
