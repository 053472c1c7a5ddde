"""URDF (ROS, MoveIt, Pinocchio, Drake), SDF (Gazebo) and MJCF (MuJoCo).

The arm moves in the world's x-z plane: a turn about -y is counterclockwise there, so that the
joints' angles are θ1 and θ2 themselves and gravity pulls along -z. Without gravity it moves in the
x-y plane about z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

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


def urdf(arm: Description) -> str:
    """The arm as a URDF robot.

    Joint 1's rotor stays in link 1's inertia, which turns about the same axis.
    """
    (first, second), joints, remarks = _rotorless(arm, "URDF")

    def joint(one: Joint, parent: str, child: str, at: float, turn: float = 0.0) -> str:
        turned = f' rpy="{_numbers(0, -turn, 0)}"' if turn else ""
        losses = f'damping="{_numbers(one.damping)}" friction="{_numbers(one.friction)}"'
        return (
            f'  <joint name="{one.name}" type="continuous">\n'
            f'    <parent link="{parent}"/>\n'
            f'    <child link="{child}"/>\n'
            f'    <origin xyz="{_numbers(at, 0, 0)}"{turned}/>\n'
            f'    <axis xyz="{_axis(arm)}"/>\n'
            f"    <dynamics {losses}/>\n"
            "  </joint>\n"
        )

    def link(name: str, one: Link) -> str:
        xx, yy, zz = map(_numbers, one.tensor)
        return (
            f'  <link name="{name}">\n'
            "    <inertial>\n"
            f'      <origin xyz="{_centre(arm, one)}"/>\n'
            f'      <mass value="{_numbers(one.mass)}"/>\n'
            f'      <inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/>\n'
            "    </inertial>\n"
            "    <visual>\n"
            f'      <origin xyz="{_numbers(one.length / 2, 0, 0)}"/>\n'
            f'      <geometry><box size="{_box(one)}"/></geometry>\n'
            "    </visual>\n"
            "  </link>\n"
        )

    return (
        '<?xml version="1.0"?>\n'
        f"{_comment(arm, remarks)}\n"
        f'<robot name="{arm.name}">\n'
        '  <link name="base"/>\n'
        + joint(joints[0], "base", "link1", 0.0, arm.turn)
        + link("link1", first)
        + joint(joints[1], "link1", "link2", first.length)
        + link("link2", second)
        + '  <joint name="tip_mount" type="fixed">\n'
        '    <parent link="link2"/>\n'
        '    <child link="tip"/>\n'
        f'    <origin xyz="{_numbers(second.length, 0, 0)}"/>\n'
        "  </joint>\n"
        '  <link name="tip"/>\n'
        "</robot>\n"
    )


def sdf(arm: Description) -> str:
    """The arm as an SDF model, joint 1 on the world; its rotor stays in link 1's inertia."""
    (first, second), joints, remarks = _rotorless(arm, "SDF")

    def joint(one: Joint, parent: str, child: str) -> str:
        losses = (
            f"<damping>{_numbers(one.damping)}</damping>"
            f"<friction>{_numbers(one.friction)}</friction>"
        )
        return (
            f'    <joint name="{one.name}" type="revolute">\n'
            f"      <parent>{parent}</parent>\n"
            f"      <child>{child}</child>\n"
            "      <axis>\n"
            f"        <xyz>{_axis(arm)}</xyz>\n"
            f"        <dynamics>{losses}</dynamics>\n"
            "      </axis>\n"
            "    </joint>\n"
        )

    def link(name: str, base: str, at: float, one: Link, turn: float = 0.0) -> str:
        xx, yy, zz = map(_numbers, one.tensor)
        inertia = (
            f"<ixx>{xx}</ixx><iyy>{yy}</iyy><izz>{zz}</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>"
        )
        return (
            f'    <link name="{name}">\n'
            f'      <pose relative_to="{base}">{_numbers(at, 0, 0, 0, -turn, 0)}</pose>\n'
            "      <inertial>\n"
            f"        <pose>{_centre(arm, one)} {_numbers(0, 0, 0)}</pose>\n"
            f"        <mass>{_numbers(one.mass)}</mass>\n"
            f"        <inertia>{inertia}</inertia>\n"
            "      </inertial>\n"
            f'      <visual name="{name}">\n'
            f"        <pose>{_numbers(one.length / 2, 0, 0, 0, 0, 0)}</pose>\n"
            f"        <geometry><box><size>{_box(one)}</size></box></geometry>\n"
            "      </visual>\n"
            "    </link>\n"
        )

    tip = f"<pose>{_numbers(second.length, 0, 0, 0, 0, 0)}</pose>"
    return (
        '<?xml version="1.0"?>\n'
        f"{_comment(arm, remarks)}\n"
        '<sdf version="1.9">\n'
        f'  <model name="{arm.name}">\n'
        + link("link1", "__model__", 0.0, first, arm.turn)
        + link("link2", "link1", first.length, second)
        + f'    <frame name="tip" attached_to="link2">{tip}</frame>\n'
        + joint(joints[0], "world", "link1")
        + joint(joints[1], "link1", "link2")
        + "  </model>\n</sdf>\n"
    )


def mjcf(arm: Description) -> str:
    """The arm as an MJCF model with a torque motor at each joint."""
    assert arm.links is not None
    joints, remarks = _joints(arm, rotors=True)
    first, second = arm.links

    def joint(one: Joint) -> str:
        return (
            f'<joint name="{one.name}" axis="{_axis(arm)}" damping="{_numbers(one.damping)}" '
            f'frictionloss="{_numbers(one.friction)}" armature="{_numbers(one.rotor)}"/>'
        )

    def link(one: Link, indent: str) -> str:
        return (
            f'{indent}<inertial pos="{_centre(arm, one)}" mass="{_numbers(one.mass)}" '
            f'diaginertia="{_numbers(*one.tensor)}"/>\n'
            f'{indent}<geom type="capsule" fromto="{_numbers(0, 0, 0, one.length, 0, 0)}" '
            f'size="{_numbers(0.03 * one.length)}" contype="0" conaffinity="0"/>\n'
        )

    gravity = _numbers(0, 0, -arm.coefficients.model.gravity)
    return (
        f"{_comment(arm, remarks)}\n"
        f'<mujoco model="{arm.name}">\n'
        '  <compiler angle="radian"/>\n'
        f'  <option gravity="{gravity}" integrator="RK4" timestep="{_numbers(TIMESTEP)}"/>\n'
        "  <worldbody>\n"
        f'    <body name="link1"{_turned(arm)}>\n'
        f"      {joint(joints[0])}\n"
        f"{link(first, 6 * ' ')}"
        f'      <body name="link2" pos="{_numbers(first.length, 0, 0)}">\n'
        f"        {joint(joints[1])}\n"
        f"{link(second, 8 * ' ')}"
        f'        <site name="tip" pos="{_numbers(second.length, 0, 0)}"/>\n'
        "      </body>\n"
        "    </body>\n"
        "  </worldbody>\n"
        "  <actuator>\n"
        '    <motor name="motor1" joint="joint1"/>\n'
        '    <motor name="motor2" joint="joint2"/>\n'
        "  </actuator>\n"
        "</mujoco>\n"
    )


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


def _rotorless(
    arm: Description, form: str
) -> tuple[tuple[Link, Link], tuple[Joint, Joint], list[str]]:
    """Links, joints and remarks for the format `form` without rotors: joint 1's is in link 1."""
    assert arm.links is not None
    joints, remarks = _joints(arm, rotors=False)
    if arm.rotor1:
        remarks.append(f"holds rotor1 within the inertia of link 1, as {form} has no rotors")
    first, second = arm.links
    return (replace(first, inertia=first.inertia + arm.rotor1), second), joints, remarks


def _axis(arm: Description) -> str:
    """The joints' axis in the world."""
    return "0 -1 0" if arm.coefficients.model.gravity else "0 0 1"


def _centre(arm: Description, link: Link) -> str:
    """A link's centre of mass in its frame: to the left of its line is up, or on the plane."""
    if arm.coefficients.model.gravity:
        return _numbers(link.centre, 0, link.aside)
    return _numbers(link.centre, link.aside, 0)


def _turned(arm: Description) -> str:
    """The attribute that turns an MJCF body as θ1's zero is turned; nothing where it is not."""
    half = 0.5 * arm.turn
    return f' quat="{_numbers(math.cos(half), 0, -math.sin(half), 0)}"' if arm.turn else ""


def _box(link: Link) -> str:
    """Sides of the box that a link is drawn as."""
    return _numbers(link.length, 0.06 * link.length, 0.06 * link.length)


def _comment(arm: Description, remarks: list[str]) -> str:
    """An XML comment, in which two hyphens may not stand together."""
    text = comment(arm, remarks, "  ")
    return f"<!--\n{text.replace('--', HYPHENS)}\n-->"


def _numbers(*values: float) -> str:
    """Numbers that read back as they are."""
    return " ".join(repr(float(value)) for value in values)
