"""A logged torque that a first-order low-pass has made late."""

from algid.physics.parameters import TIME, Parameter
from algid.physics.terms.base import Term

LAG = Term(
    name="lag",
    title="first-order low-pass of the torque",
    equation="-lag dτ_log/dt: the logged torque lags behind",
    parameters=(Parameter("lag", "T", "s", "time constant of the logged torque's low-pass", TIME),),
    timing="lag",
)
