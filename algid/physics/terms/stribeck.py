"""Stribeck friction: what Coulomb friction has more at low speed."""

from algid.physics.parameters import MOMENT, Parameter
from algid.physics.signals import H1, H2, NOTHING, T1, T2
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

STRIBECK = Term(
    name="stribeck",
    title="Stribeck friction",
    equation="s_i tanh(ω_i / ω_s) exp(-(ω_i / ω_S)²)",
    parameters=(
        Parameter(
            "s1",
            "s₁",
            "N m",
            "Stribeck friction of joint 1, beside Coulomb's: its interval is too narrow",
            MOMENT,
        ),
        Parameter(
            "s2",
            "s₂",
            "N m",
            "Stribeck friction of joint 2, beside Coulomb's: its interval is too narrow",
            MOMENT,
        ),
    ),
    columns=(TorqueColumn("s1", f=(T1 * H1, NOTHING)), TorqueColumn("s2", f=(NOTHING, T2 * H2))),
    needs="coulomb",
    shapes=("coulomb_speed", "stribeck_speed"),
    spread=PriorSpread(0.05, "torque"),
)
