"""Viscous friction of both joints, the rest of eq. (1)."""

from algid.physics.parameters import VISCOUS as SCALE
from algid.physics.parameters import Parameter
from algid.physics.signals import NOTHING, Q1, Q2
from algid.physics.terms.base import Term, TorqueColumn

VISCOUS = Term(
    name="viscous",
    title="viscous friction",
    equation="k6 ω_1 (joint 1), k7 ω_2 (joint 2)",
    parameters=(
        Parameter("k6", "k₆", "N m s/rad", "viscous friction of joint 1", SCALE, "+"),
        Parameter("k7", "k₇", "N m s/rad", "viscous friction of joint 2", SCALE, "+"),
    ),
    damping=(("k6", 0), ("k7", 1)),
    columns=(TorqueColumn("k6", p=(Q1, NOTHING)), TorqueColumn("k7", p=(NOTHING, Q2))),
)
K6, K7 = VISCOUS.names
