"""Torque offsets: what a sensor or a drive adds whatever the arm does."""

from algid.physics.parameters import MOMENT, Parameter
from algid.physics.signals import NOTHING, ONE
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

OFFSET = Term(
    name="offset",
    title="torque offsets",
    equation="o_i",
    parameters=(
        Parameter("o1", "o₁", "N m", "torque offset of joint 1", MOMENT),
        Parameter("o2", "o₂", "N m", "torque offset of joint 2", MOMENT),
    ),
    columns=(TorqueColumn("o1", f=(ONE, NOTHING)), TorqueColumn("o2", f=(NOTHING, ONE))),
    usual=True,
    spread=PriorSpread(0.02, "torque"),
)
