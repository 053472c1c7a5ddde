"""MJCF: MuJoCo."""

from __future__ import annotations

from algid.export.description import Description
from algid.export.links import Link
from algid.export.xml import axis, comment, losses, numbers

TIMESTEP = 5e-4  # s: Runge-Kutta of fourth order errs far below 1e-5 rad a second with it


def mjcf(arm: Description) -> str:
    """The arm as an MJCF model with a torque motor at each joint."""
    assert arm.links is not None
    lost, remarks = losses(arm, rotors=True)
    first, second = arm.links
    about = axis(arm)

    def joint(number: int) -> str:
        place = number - 1
        return (
            f'<joint name="joint{number}" axis="{about}" damping="{numbers(lost.damping[place])}" '
            f'frictionloss="{numbers(lost.friction[place])}" armature="{numbers(lost.rotor[place])}"/>'
        )

    return (
        f'{comment(arm, remarks)}\n<mujoco model="{arm.name}">\n  <compiler angle="radian"/>\n'
        f'  <option gravity="{numbers(0, 0, -arm.coefficients.model.gravity)}" integrator="RK4" '
        f'timestep="{numbers(TIMESTEP)}"/>\n  <worldbody>\n    <body name="link1">\n      {joint(1)}\n'
        f'{_link(first, "      ")}      <body name="link2" pos="{numbers(first.length, 0, 0)}">\n        {joint(2)}\n'
        f'{_link(second, "        ")}        <site name="tip" pos="{numbers(second.length, 0, 0)}"/>\n'
        "      </body>\n    </body>\n  </worldbody>\n  <actuator>\n"
        '    <motor name="motor1" joint="joint1"/>\n    <motor name="motor2" joint="joint2"/>\n'
        "  </actuator>\n</mujoco>\n"
    )


def _link(link: Link, indent: str) -> str:
    return (
        f'{indent}<inertial pos="{numbers(link.centre, 0, 0)}" mass="{numbers(link.mass)}" '
        f'diaginertia="{numbers(*link.tensor)}"/>\n'
        f'{indent}<geom type="capsule" fromto="{numbers(0, 0, 0, link.length, 0, 0)}" '
        f'size="{numbers(0.03 * link.length)}" contype="0" conaffinity="0"/>\n'
    )
