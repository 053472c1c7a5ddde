"""What URDF (ROS, MoveIt, Pinocchio, Drake), SDF (Gazebo) and MJCF (MuJoCo) hold of an arm.

The arm moves in the world's x-z plane: a turn about -y is counterclockwise there, so that the
joints' angles are θ1 and θ2 themselves and gravity pulls along -z. Without gravity it moves in the
x-y plane about z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from algid.exports.description import Description, comment, lacking
from algid.exports.links import Link
from algid.model import EVERY_TERM

HYPHENS = "\N{HYPHEN}\N{HYPHEN}"
JUMP = (
    "holds Coulomb friction as a jump at standstill, where algid has f tanh(omega / {width:g} "
    "rad/s)"
)
TIMESTEP = 5e-4  # s: Runge-Kutta of fourth order errs far below 1e-5 rad a second with it


@dataclass(frozen=True)
class Joint:
    """A joint of the formats: damping N m s/rad, Coulomb friction N m, rotor inertia kg m^2."""

    name: str
    damping: float = 0.0
    friction: float = 0.0
    rotor: float = 0.0


def robot(arm: Description, *, rotors: bool) -> dict[str, Any]:
    """What the templates of robots are made of.

    Without `rotors` that of joint 1 is in link 1's inertia, which turns about the same axis.
    """
    assert arm.links is not None
    first, second = arm.links
    gravity = arm.coefficients.model.gravity
    joints, remarks = _joints(arm, rotors=rotors)
    if arm.rotor1 and not rotors:
        remarks.append("holds rotor1 within the inertia of link 1, as it has no rotors")
        first = replace(first, inertia=first.inertia + arm.rotor1)

    def centre(link: Link) -> str:
        """A link's centre of mass in its frame: to the left of its line is up, or on the plane."""
        x, y = link.centre, link.aside
        return numbers((x, 0, y) if gravity else (x, y, 0))

    # two hyphens may not stand together in a comment of XML
    text = comment(arm, remarks, "  ").replace("--", HYPHENS)
    half = 0.5 * arm.turn
    return {
        "arm": arm,
        "axis": "0 -1 0" if gravity else "0 0 1",
        "centre": centre,
        "comment": f"<!--\n{text}\n-->",
        "first": first,
        "gravity": gravity,
        "joints": joints,
        "second": second,
        "timestep": TIMESTEP,
        "turned": (math.cos(half), 0, -math.sin(half), 0),
    }


def _joints(arm: Description, *, rotors: bool) -> tuple[tuple[Joint, Joint], list[str]]:
    """The joints, none of their values negative, and remarks on what the format cannot hold."""
    value, model = arm.coefficients.value, arm.coefficients.model
    kinds = ("damping", "friction", "rotor") if rotors else ("damping", "friction")
    held, names = [], set()
    for term in EVERY_TERM.values():
        if any(getattr(term, kind) for kind in kinds):
            held.append(term)
            names.add(term.name)
        elif term.sines:  # where the links' centres are
            names.add(term.name)
    remarks = lacking(arm, frozenset(names))
    if any(term.friction and term.name in model.terms for term in held):
        remarks.insert(0, JUMP.format(width=model.coulomb_speed))
    of_joints: list[dict[str, float]] = [{}, {}]
    for term in held:
        for kind in kinds:
            for name, joint in getattr(term, kind):
                if value[name] < 0:
                    remarks.append(f"leaves out {name}, which is negative: {value[name]:.6g}")
                of_joints[joint][kind] = max(value[name], 0.0)
    of_joints[0]["rotor"] = arm.rotor1
    return (Joint("joint1", **of_joints[0]), Joint("joint2", **of_joints[1])), remarks


def numbers(values: float | tuple[float, ...]) -> str:
    """Numbers that read back as they are."""
    each = values if isinstance(values, tuple) else (values,)
    return " ".join(repr(float(value) + 0.0) for value in each)  # + 0.0: no -0.0
