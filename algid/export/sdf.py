"""SDF: Gazebo."""

from __future__ import annotations

from algid.export.description import Description
from algid.export.links import Link
from algid.export.xml import axis, comment, numbers, rotorless


def sdf(arm: Description) -> str:
    """The arm as an SDF model, joint 1 on the world; its rotor stays in link 1's inertia."""
    (first, second), lost, remarks = rotorless(arm, "SDF")
    return (
        f'<?xml version="1.0"?>\n{comment(arm, remarks)}\n<sdf version="1.9">\n  <model name="{arm.name}">\n'
        + _link("link1", "__model__", 0.0, first)
        + _link("link2", "link1", first.length, second)
        + f'    <frame name="tip" attached_to="link2"><pose>{numbers(second.length, 0, 0, 0, 0, 0)}</pose></frame>\n'
        + _joint("joint1", "world", "link1", axis(arm), lost.damping[0], lost.friction[0])
        + _joint("joint2", "link1", "link2", axis(arm), lost.damping[1], lost.friction[1])
        + "  </model>\n</sdf>\n"
    )


def _joint(name: str, parent: str, child: str, about: str, damping: float, friction: float) -> str:
    return (
        f'    <joint name="{name}" type="revolute">\n      <parent>{parent}</parent>\n      <child>{child}</child>\n'
        f"      <axis>\n        <xyz>{about}</xyz>\n        <dynamics><damping>{numbers(damping)}</damping>"
        f"<friction>{numbers(friction)}</friction></dynamics>\n      </axis>\n    </joint>\n"
    )


def _link(name: str, base: str, at: float, link: Link) -> str:
    xx, yy, zz = link.tensor
    inertia = "".join(f"<{key}>{numbers(value)}</{key}>" for key, value in (("ixx", xx), ("iyy", yy), ("izz", zz)))
    zeros = "<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>"
    size = numbers(link.length, 0.06 * link.length, 0.06 * link.length)
    return (
        f'    <link name="{name}">\n      <pose relative_to="{base}">{numbers(at, 0, 0, 0, 0, 0)}</pose>\n'
        f"      <inertial>\n        <pose>{numbers(link.centre, 0, 0, 0, 0, 0)}</pose>\n"
        f"        <mass>{numbers(link.mass)}</mass>\n        <inertia>{inertia}{zeros}</inertia>\n      </inertial>\n"
        f'      <visual name="{name}">\n        <pose>{numbers(link.length / 2, 0, 0, 0, 0, 0)}</pose>\n'
        f"        <geometry><box><size>{size}</size></box></geometry>\n      </visual>\n    </link>\n"
    )
