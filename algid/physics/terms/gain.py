"""Torques whose gains differ: a wrong torque constant of one drive.

A gain of both is in every other parameter.
"""

from algid.physics.parameters import GAIN as SCALE
from algid.physics.parameters import Parameter
from algid.physics.terms.base import PriorSpread, Term

GAIN = Term(
    name="gain",
    title="torque gain of joint 2 over that of joint 1, less 1",
    equation="τ_2 times 1 + gain2",
    parameters=(
        Parameter(
            "gain2",
            "g₂",
            "1",
            "gain of joint 2's torque over joint 1's, less 1",
            SCALE,
            "±",
            (-0.5, 0.5),
        ),
    ),
    gains=(("gain2", 1),),
    spread=PriorSpread(0.03),  # what a torque constant may be off
)
