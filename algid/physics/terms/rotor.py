"""Rotor of joint 2, as its joint feels it.

That of joint 1 adds to k5 alone, which is why it has no column.
"""

from math import inf

from algid.physics.parameters import INERTIA, Parameter
from algid.physics.signals import NOTHING, Q2
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

ROTOR = Term(
    name="rotor",
    title="rotor inertia of joint 2",
    equation="j2 θ̈_2 (joint 2)",
    parameters=(
        Parameter(
            "j2", "j₂", "kg m^2", "rotor inertia of joint 2 at its joint", INERTIA, "+", (0.0, inf)
        ),
    ),
    columns=(TorqueColumn("j2", s=(NOTHING, Q2)),),
    usual=True,
    rotor=(("j2", 1),),
    spread=PriorSpread(1.0, "inertia"),
)
(J2,) = ROTOR.names
