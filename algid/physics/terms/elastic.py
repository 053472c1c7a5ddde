"""Joints that give: a link stands at θ - L / k_e behind its motor, with L the load on the link.

The links' inertia, Coriolis torque and weight are those of their own motion,

    θ - h L,   ω - h dL/dt,   α - h d²L/dt²,   h = 1 / k_e

friction and rotors those of the motors' (Spong 1987). The load is that of the estimate at hand.
"""

from math import inf

from algid.physics.parameters import COMPLIANCE, SHARE, Parameter
from algid.physics.signals import NOTHING, Q1
from algid.physics.terms.base import PriorSpread, Term, TorqueColumn

ELASTIC = Term(
    name="elastic",
    title="elastic joints",
    equation="the links at θ_i - h_i L_i, h_i = 1 / k_e",
    parameters=(
        Parameter(
            "h1",
            "h₁",
            "rad/(N m)",
            "compliance of joint 1, one over its stiffness",
            COMPLIANCE,
            "+",
            (0.0, inf),
        ),
        Parameter(
            "h2",
            "h₂",
            "rad/(N m)",
            "compliance of joint 2, one over its stiffness",
            COMPLIANCE,
            "+",
            (0.0, inf),
        ),
        Parameter(
            "r1", "r₁", "1", "share of joint 1's rotor in k5, which is what moves behind it", SHARE
        ),
    ),
    columns=(TorqueColumn("r1", s=(Q1, NOTHING)),),
    of_motor=(("r1", "k5"),),
    elastic=(("h1", 0), ("h2", 1)),
    spread=PriorSpread(1 / 20.0**2, "compliance"),  # s²: a link that swings at 20 rad/s
)
