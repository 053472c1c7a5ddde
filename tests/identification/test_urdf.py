"""URDF files read back: algid's own, and ones as CAD writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from algid.arm import FloatArray, inverse_dynamics
from algid.base.errors import ResultError
from algid.exports.formats import exported
from algid.identification.prior import read_urdf
from algid.model import Model, Motion, torque
from tests.exports.arms import ODD, result_of, states, values_of

CAD = """<robot name="cad">
  <link name="world"/>
  <link name="stand"><inertial><mass value="30"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="floor" type="fixed"><parent link="world"/><child link="stand"/>
    <origin xyz="0.3 -0.2 1" rpy="1.5707963267948966 0 0.4"/></joint>
  <joint name="elbow" type="revolute"><parent link="arm"/><child link="forearm"/>
    <origin xyz="0 0.4 0.02" rpy="0 0 0.7"/><axis xyz="0 0 1"/>
    <dynamics damping="0.2" friction="0.1"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <joint name="shoulder" type="revolute"><parent link="stand"/><child link="arm"/>
    <origin xyz="0 0.1 0" rpy="0 0 -1.1"/><axis xyz="0 0 2"/><dynamics damping="0.3"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <link name="arm"><inertial><origin xyz="0 0.15 0.01" rpy="0.3 0.2 0.1"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="0.002" iyz="-0.001"/>
    </inertial></link>
  <link name="forearm"><inertial><origin xyz="0.1 0 0"/><mass value="0.6"/>
    <inertia ixx="0.001" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0.02 0 0"/><mass value="0.2"/>
    <inertia ixx="0.0001" iyy="0.0002" izz="0.0002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="wrist" type="fixed"><parent link="forearm"/><child link="hand"/>
    <origin xyz="0.25 0 0"/></joint>
</robot>
"""


def test_what_algid_exports_it_reads(tmp_path: Path) -> None:
    value = values_of(ODD, f1=0.4, f2=0.3)
    file = tmp_path / "arm.urdf"
    file.write_text(
        exported(result_of(value, Model(("coulomb",))), "arm", "urdf", {"rotor1": 0.02})[0]
    )
    judged = read_urdf(file)
    assert judged.model == Model(("coulomb",))
    np.testing.assert_allclose(judged.coefficients("unloaded"), list(value.values()), rtol=1e-12)
    with pytest.raises(ResultError, match="a URDF file tells no payload"):
        judged.coefficients("loaded")


def by_pinocchio(text: str, q: FloatArray, omega: FloatArray, alpha: FloatArray) -> FloatArray:
    """The torque (2, N) of the links of a file, at the joints' configurations (·, N)."""
    pin = pytest.importorskip("pinocchio")
    robot = pin.buildModelFromXML(text)
    robot.damping, data = np.zeros(2), robot.createData()
    moving = zip(q.T, omega.T, alpha.T, strict=True)
    return np.array([pin.rnea(robot, data, *state) for state in moving]).T


def test_an_arm_from_cad_moves_as_pinocchio_says(tmp_path: Path) -> None:
    file = tmp_path / "cad.urdf"
    file.write_text(CAD)
    judged = read_urdf(file)
    assert judged.model.names[-2:] == ("f1", "f2")
    c = judged.coefficients("unloaded")
    np.testing.assert_array_equal(c[5:], [0.3, 0.2, 0.0, 0.1])
    theta, omega, alpha = states(50)
    # of algid's angles, where the file's are zero
    zero = np.array([np.pi / 2 - 1.1, 0.7 - np.pi / 2])
    q = (theta - zero[:, None] + np.pi) % (2 * np.pi) - np.pi
    found = by_pinocchio(CAD, q, omega, alpha)
    expected = inverse_dynamics(np.append(c[:5], [0.0, 0.0]), theta, omega, alpha)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<robot", "<<robot", "not XML"),
        ('name="elbow" type="revolute"', 'name="elbow" type="prismatic"', "not all of them turn"),
        ('name="elbow" type="revolute"', 'name="elbow" type="fixed"', "found 1 moving joint,"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="1 0 0"/>', "axes are not parallel"),
        ('<mass value="2"/>', '<mass value="0"/>', "link arm has no mass"),
        ('<mass value="2"/>', "", "expected a URDF of an arm.*mass has no value"),
        ('<mass value="2"/>', '<mass value="nan"/>', "expected 1 finite number, found 'nan'"),
        ('ixx="0.02"', 'ixx="inf"', "expected 1 finite number, found 'inf'"),
        ('ixx="0.02"', "", "inertia has no ixx"),
        ('damping="0.2"', 'damping="-inf"', "expected 1 finite number, found '-inf'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "axis has no direction"),
        ('<link name="hand">', '<link name="other">', "there is no link hand"),
        (
            '<child link="hand"/>',
            '<child link="forearm"/>',
            "no link forearm, or none .*, or two",
        ),
        (
            '<parent link="world"/>',
            '<parent link="stand"/>',
            "there is no link arm, or none",
        ),
        ("0 0.4 0.02", "0 0.4", "expected 3 finite numbers, found '0 0.4'"),
        ("0 0.4 0.02", "0 0 0.02", "link arm has no length"),
    ],
)
def test_what_is_no_such_arm_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in CAD
    file = tmp_path / "cad.urdf"
    file.write_text(CAD.replace(old, new))
    with pytest.raises(ResultError, match=message):
        read_urdf(file)
    with pytest.raises(ResultError, match="cannot read it"):
        read_urdf(tmp_path / "none.urdf")


def test_a_centre_beside_its_line_is_taken_over(tmp_path: Path) -> None:
    """Pinocchio computes the same torques from the file."""
    file = tmp_path / "cad.urdf"
    value = values_of(ODD) | {"k1s": 0.02, "k2s": 0.02 * 9.81 / 0.4, "k4s": -1.5}
    text = exported(result_of(value, Model(("phases",))), "arm", "urdf", {"l2": 0.3})[0]
    file.write_text(text)
    judged = read_urdf(file)
    theta, omega, alpha = states(50)
    found = torque(judged.model, judged.coefficients("unloaded"), Motion(theta, omega, alpha))
    turned = np.stack([np.cos(theta), np.sin(theta)], axis=1).reshape(4, -1)
    viscous = np.array([[value["k6"]], [value["k7"]]]) * omega
    wanted = by_pinocchio(text, turned, omega, alpha) + viscous
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(found).max())
