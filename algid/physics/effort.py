"""What a driver calls effort, and what of the arm's torque that does not hold.

Whatever a driver takes off before it logs a torque is a change of the same regression: columns that
are nothing. An arm's own columns are, not its payload's: a driver knows no payload unless a user
has entered one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from algid.base.names import outside, within
from algid.physics.terms import ALWAYS, OPTIONAL

Effort = Literal[
    "raw", "gravity-compensated", "friction-compensated", "external", "command", "current"
]
"""The torque at the joint as measured; without the arm's weight; without friction; without all of
the arm; as commanded; as a motor's current."""

_EVERY = ALWAYS + OPTIONAL
FRICTION = tuple(term.name for term in _EVERY if term.damping or term.shapes)
"""Terms that damp a joint, or depend on a width of friction."""
ELASTIC = tuple(term.name for term in _EVERY if term.elastic)
"""Terms that bend a joint by all the load on its link, its weight too."""
_OF_DRIVES = FRICTION + tuple(term.name for term in _EVERY if term.rotor or term.gains)


def without_terms(effort: Effort | None, terms: Iterable[str]) -> tuple[str, ...]:
    """Those of the optional `terms` that a torque so logged may have."""
    gone = {
        "gravity-compensated": ELASTIC,
        "friction-compensated": FRICTION,
        "external": _OF_DRIVES + ELASTIC,
    }
    return outside(terms, gone.get(effort or "", ()))


def absent(effort: Effort | None, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the parameters `names` that the arm's own torque does not hold, so logged."""
    gone: set[str] = set()
    for term in _EVERY:
        of_drive = term.name in _OF_DRIVES
        if effort == "gravity-compensated":
            for parameter in term.parameters:
                if parameter.weighs:
                    gone.add(parameter.name)
        if effort == "friction-compensated" and term.name in FRICTION:
            gone |= set(term.names)
        if effort == "external" and (term.inertial or of_drive):
            gone |= set(term.names)
    return within(names, gone)
