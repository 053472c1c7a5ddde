"""What URDF, SDF and MJCF share: the plane in the world, joints' losses, comments and numbers.

The arm moves in the world's x-z plane: a turn about -y is counterclockwise there, so that the joints' angles are θ1
and θ2 themselves and gravity pulls along -z. Without gravity it moves in the x-y plane about z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from algid.export.description import Description, header, lacking
from algid.export.links import Link

HYPHENS = "\N{HYPHEN}\N{HYPHEN}"
JUMP = "holds Coulomb friction as a jump at standstill, where algid has f tanh(omega / {width:g} rad/s)"


@dataclass(frozen=True)
class Losses:
    """Damping in N m s/rad, Coulomb friction in N m and rotor inertia in kg m^2 of both joints; none is negative."""

    damping: tuple[float, float]
    friction: tuple[float, float]
    rotor: tuple[float, float]


def losses(arm: Description, *, rotors: bool) -> tuple[Losses, list[str]]:
    """The joints' losses, and remarks about what a format, with or without rotors, cannot hold."""
    value, model = arm.coefficients.value, arm.coefficients.model
    remarks = lacking(arm, frozenset({"coulomb", "rotor"} if rotors else {"coulomb"}))
    if "coulomb" in model.terms:
        remarks.insert(0, JUMP.format(width=model.coulomb_speed))

    def kept(name: str) -> float:
        if value[name] >= 0:
            return value[name]
        remarks.append(f"leaves out {name}, which is negative: {value[name]:.6g}")
        return 0.0

    damping = (kept("k6"), kept("k7"))
    friction = (kept("f1"), kept("f2"))
    second = kept("j2") if rotors else 0.0
    return Losses(damping, friction, (arm.rotor1, second)), remarks


def rotorless(arm: Description, form: str) -> tuple[tuple[Link, Link], Losses, list[str]]:
    """Links, losses and remarks for the format `form`, which has no rotors.

    Joint 1's rotor stays in link 1's inertia, which turns about the same axis.
    """
    assert arm.links is not None
    lost, remarks = losses(arm, rotors=False)
    if arm.rotor1:
        remarks.append(f"holds rotor1 within the inertia of link 1, as {form} has no rotors")
    first, second = arm.links
    return (replace(first, inertia=first.inertia + arm.rotor1), second), lost, remarks


def axis(arm: Description) -> str:
    """The joints' axis in the world."""
    return "0 -1 0" if arm.coefficients.model.gravity else "0 0 1"


def comment(arm: Description, remarks: list[str]) -> str:
    """An XML comment, in which two hyphens may not stand together."""
    text = "\n".join(f"  {line}".rstrip() for line in header(arm, remarks))
    return f"<!--\n{text.replace('--', HYPHENS)}\n-->"


def numbers(*values: float) -> str:
    """Numbers that read back as they are."""
    return " ".join(repr(float(value)) for value in values)
