"""The payload as YAML, for a planner or a controller that compensates it."""

from __future__ import annotations

import json

from algid.errors import ResultError
from algid.export.links import Knowns
from algid.results import Result, Status


def payload_yaml(result: Result, file: str, knowns: Knowns) -> str:
    """Mass and centre of gravity of a result's payload, with their standard deviations.

    Raises
    ------
    ResultError
        If the result has no payload, or one that no load explains.
    """
    mass = result.payload.get("m_p")
    if mass is None or mass.estimate is None or mass.status is not Status.OK:
        raise ResultError(f"{file}: the result has no payload; identify with --loaded LOG")
    if mass.estimate <= 0:
        raise ResultError(
            f"{file}: no load explains a payload of {mass.estimate:.4g} kg; check which log is the loaded one"
        )
    given = knowns.l2 or result.settings.get("l2")
    found = result.payload.get("l2")
    length = given or (None if found is None else found.estimate)
    if length is None:
        raise ResultError(f"{file}: the result does not tell where the payload hangs; give --l2")
    spread = 0.0 if given or found is None else found.std
    where = "given" if given else "identified"
    return (
        f"# Payload by algid export, from {json.dumps(file)}, estimator {result.estimator}; SI units.\n"
        "# Mass identified; taken as a point at the tip, so that two coordinates and the inertia are chosen as 0.\n"
        f"# centre_of_gravity x {where}, in the frame of link 2: x along the link from joint 2.\n"
        "payload:\n"
        f"  mass: {mass.estimate!r}  # kg\n"
        f"  mass_std: {_or_null(mass.std)}\n"
        "  frame: link2\n"
        f"  centre_of_gravity: [{float(length)!r}, 0.0, 0.0]  # m\n"
        f"  centre_of_gravity_std: [{_or_null(spread)}, 0.0, 0.0]\n"
        "  inertia: {ixx: 0.0, iyy: 0.0, izz: 0.0, ixy: 0.0, ixz: 0.0, iyz: 0.0}  # kg m^2\n"
    )


def _or_null(value: float | None) -> str:
    return "null" if value is None else repr(float(value))
