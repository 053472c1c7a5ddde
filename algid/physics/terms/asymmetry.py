"""Coulomb friction that differs between the two directions."""

from algid.physics.parameters import MOMENT, Parameter
from algid.physics.signals import NOTHING, T1, T2
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

ASYMMETRY = Term(
    name="asymmetry",
    title="asymmetric Coulomb friction",
    equation="a_i tanh²(ω_i / ω_s)",
    parameters=(
        Parameter(
            "a1", "a₁", "N m", "half of what joint 1's Coulomb friction is larger forward", MOMENT
        ),
        Parameter(
            "a2", "a₂", "N m", "half of what joint 2's Coulomb friction is larger forward", MOMENT
        ),
    ),
    columns=(TorqueColumn("a1", f=(T1 * T1, NOTHING)), TorqueColumn("a2", f=(NOTHING, T2 * T2))),
    needs="coulomb",
    shapes=("coulomb_speed",),
    spread=PriorSpread(0.02, "torque"),
)
