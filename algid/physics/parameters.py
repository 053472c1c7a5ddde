"""What a parameter is: its name, unit, meaning, scale, sign and plausible range, each once.

A parameter's standard deviation is compared with its scale: the largest value among the parameters
of that scale, and no less than the scale's `least`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal


@dataclass(frozen=True)
class Scale:
    """A class of parameters that compare in size: its name, and the least size that counts."""

    name: str
    least: float


INERTIA = Scale("inertia", 1e-6)
MOMENT = Scale("torque", 1e-4)
VISCOUS = Scale("viscous friction", 1e-6)
LOAD_SHARE = Scale("share of the load", 1e-2)
GAIN = Scale("gain", 1e-2)
ANGLE = Scale("angle", 1e-2)
SHARE = Scale("share of the inertia", 1.0)
COMPLIANCE = Scale("compliance", 1e-2)
TIME = Scale("time", 1e-3)
MASS = Scale("mass", 1e-3)
LENGTH = Scale("length", 1e-2)


@dataclass(frozen=True)
class Parameter:
    """A parameter of the arm, of its drives or of its payload.

    Parameters
    ----------
    name : str, as results, exports and flags have it
    symbol : str, as formulas have it
    unit : str
    meaning : str, in words
    scale : Scale
    sign : "+" where physics allows no negative value, else "±"
    plausible : (low, high), in the unit
        Beyond, a value is another convention, or made of noise by a log of little information.
    weighs : bool
        Whether it acts by gravity alone: an arm in a horizontal plane does not have it.
    payload : int or None
        Which of z1 … z5 (0 to 4) a payload adds to it: eq. (5) against eq. (3).
    """

    name: str
    symbol: str
    unit: str
    meaning: str
    scale: Scale
    sign: Literal["+", "±"] = "±"
    plausible: tuple[float, float] = (-inf, inf)
    weighs: bool = False
    payload: int | None = None


PAYLOAD = (
    Parameter("m_p", "m_p", "kg", "mass of the payload", MASS, "+"),
    Parameter("l1", "l₁", "m", "length of link 1", LENGTH, "+"),
    Parameter("l2", "l₂", "m", "distance of the payload from joint 2, along link 2", LENGTH, "+"),
)
"""What loaded logs determine beside the arm."""
BODY = (
    Parameter(
        "y_p", "y_p", "m", "distance of the payload's centre of mass off link 2's line", LENGTH
    ),
    Parameter(
        "J_p", "J_p", "kg m^2", "inertia of the payload about its centre of mass", INERTIA, "+"
    ),
)
"""Parameters of a payload that is a body; both are zero where the logs do not determine them."""
