"""The terms of the torque in one literal tuple, one a file; everything else derives from it."""

from __future__ import annotations

from algid.physics.terms.asymmetry import ASYMMETRY
from algid.physics.terms.base import Term, TorqueColumn
from algid.physics.terms.coulomb import COULOMB
from algid.physics.terms.delay import DELAY
from algid.physics.terms.elastic import ELASTIC
from algid.physics.terms.gain import GAIN
from algid.physics.terms.lag import LAG
from algid.physics.terms.load import LOAD
from algid.physics.terms.offset import OFFSET
from algid.physics.terms.phases import PHASES
from algid.physics.terms.rigid import RIGID
from algid.physics.terms.rotor import ROTOR
from algid.physics.terms.stribeck import STRIBECK
from algid.physics.terms.viscous import VISCOUS

__all__ = ["ALWAYS", "OPTIONAL", "Term", "TorqueColumn"]

ALWAYS: tuple[Term, ...] = (RIGID, VISCOUS)
"""Eq. (1): what every arm has."""
OPTIONAL: tuple[Term, ...] = (
    COULOMB,
    OFFSET,
    ROTOR,
    STRIBECK,
    ASYMMETRY,
    LOAD,
    GAIN,
    PHASES,
    ELASTIC,
    LAG,
    DELAY,
)
"""What real joints add; all their parameters are zero on an arm without them."""
