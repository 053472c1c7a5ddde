"""The time after which a logged torque acts."""

from algid.physics.parameters import TIME, Parameter
from algid.physics.terms.base import PriorSpread, Term

DELAY = Term(
    name="delay",
    title="delay from torque to angle",
    equation="τ(t) acts at t + delay",
    parameters=(
        Parameter(
            "delay",
            "t_d",
            "s",
            "delay from the logged torque to the angles",
            TIME,
            "±",
            (-0.05, 0.05),
        ),
    ),
    timing="delay",
    spread=PriorSpread(2e-3),  # s: a loop's, about half a sample
)
