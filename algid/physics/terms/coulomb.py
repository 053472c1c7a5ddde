"""Coulomb friction.

tanh(ω / ω_s) in place of a jump, so that noise at standstill flips no sample.
"""

from math import inf

from algid.physics.parameters import MOMENT, Parameter
from algid.physics.signals import NOTHING, T1, T2
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

COULOMB = Term(
    name="coulomb",
    title="Coulomb friction",
    equation="f_i tanh(ω_i / ω_s)",
    parameters=(
        Parameter("f1", "f₁", "N m", "Coulomb friction of joint 1", MOMENT, "+", (0.0, inf)),
        Parameter("f2", "f₂", "N m", "Coulomb friction of joint 2", MOMENT, "+", (0.0, inf)),
    ),
    columns=(TorqueColumn("f1", f=(T1, NOTHING)), TorqueColumn("f2", f=(NOTHING, T2))),
    usual=True,
    friction=(("f1", 0), ("f2", 1)),
    shapes=("coulomb_speed",),
    spread=PriorSpread(0.3, "torque"),
)
F1, F2 = COULOMB.names
