"""URDF: ROS, MoveIt, Pinocchio, Drake."""

from __future__ import annotations

from algid.export.description import Description
from algid.export.links import Link
from algid.export.xml import axis, comment, numbers, rotorless


def urdf(arm: Description) -> str:
    """The arm as a URDF robot; joint 1's rotor stays in link 1's inertia, which turns about the same axis."""
    (first, second), lost, remarks = rotorless(arm, "URDF")
    joints = [
        _joint("joint1", "base", "link1", 0.0, axis(arm), lost.damping[0], lost.friction[0]),
        _link("link1", first),
        _joint("joint2", "link1", "link2", first.length, axis(arm), lost.damping[1], lost.friction[1]),
        _link("link2", second),
    ]
    return (
        f'<?xml version="1.0"?>\n{comment(arm, remarks)}\n<robot name="{arm.name}">\n  <link name="base"/>\n'
        + "".join(joints)
        + f'  <joint name="tip_mount" type="fixed">\n    <parent link="link2"/>\n    <child link="tip"/>\n'
        f'    <origin xyz="{numbers(second.length, 0, 0)}"/>\n  </joint>\n  <link name="tip"/>\n</robot>\n'
    )


def _joint(name: str, parent: str, child: str, at: float, about: str, damping: float, friction: float) -> str:
    return (
        f'  <joint name="{name}" type="continuous">\n    <parent link="{parent}"/>\n    <child link="{child}"/>\n'
        f'    <origin xyz="{numbers(at, 0, 0)}"/>\n    <axis xyz="{about}"/>\n'
        f'    <dynamics damping="{numbers(damping)}" friction="{numbers(friction)}"/>\n  </joint>\n'
    )


def _link(name: str, link: Link) -> str:
    xx, yy, zz = link.tensor
    return (
        f'  <link name="{name}">\n    <inertial>\n      <origin xyz="{numbers(link.centre, 0, 0)}"/>\n'
        f'      <mass value="{numbers(link.mass)}"/>\n'
        f'      <inertia ixx="{numbers(xx)}" iyy="{numbers(yy)}" izz="{numbers(zz)}" ixy="0" ixz="0" iyz="0"/>\n'
        f'    </inertial>\n    <visual>\n      <origin xyz="{numbers(link.length / 2, 0, 0)}"/>\n'
        f'      <geometry><box size="{numbers(link.length, 0.06 * link.length, 0.06 * link.length)}"/></geometry>\n'
        "    </visual>\n  </link>\n"
    )
