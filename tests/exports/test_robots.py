"""Robot descriptions, payload and programs in the hands of others, and what their comments say."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

import algid
from algid.arm import Arm
from algid.base.errors import AlgidError
from algid.exports.formats import SUFFIXES, exported
from algid.model import Model
from algid.results import Result, Status
from tests.exports.arms import ODD, result_of, states, values_of
from tests.exports.test_peers import BENT, bent, text_of

XML = ("urdf", "sdf", "mjcf")


def test_the_tip_is_where_the_angles_say() -> None:
    pin, mujoco = pytest.importorskip("pinocchio"), pytest.importorskip("mujoco")
    robot = pin.buildModelFromXML(text_of("urdf", values_of(ODD), l2=0.35))
    model = mujoco.MjModel.from_xml_string(text_of("mjcf", values_of(ODD), l2=0.35))
    data, moved = mujoco.MjData(model), robot.createData()
    for theta in states(5)[0].T:
        angles = np.array([theta[0], theta.sum()])
        reach = np.array([0.4, 0.35])
        tip = [reach @ np.cos(angles), 0.0, reach @ np.sin(angles)]
        data.qpos[:] = theta
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.site("tip").xpos, tip, atol=1e-12)
        q = np.stack([np.cos(theta), np.sin(theta)], axis=1).ravel()
        pin.framesForwardKinematics(robot, moved, q)
        np.testing.assert_allclose(moved.oMf[robot.getFrameId("tip")].translation, tip, atol=1e-12)


@pytest.mark.parametrize("to", XML)
def test_losses_that_are_negative_are_left_out_and_said(to: str) -> None:
    value = values_of(ODD, f1=-0.1, f2=0.3, j2=-0.002) | {"k7": -0.05}
    text = text_of(to, value, Model(("coulomb", "rotor")))
    said = re.findall(r"This file leaves out (\w+), which is negative: (\S+)\.\n", text)
    expected = [("k7", "-0.05"), ("f1", "-0.1"), *([("j2", "-0.002")] if to == "mjcf" else [])]
    assert said == expected
    root = ET.fromstring(text)
    tag, names = "dynamics", ("damping", "friction")
    if to == "mjcf":
        tag, names = "joint", ("damping", "frictionloss")
        assert [float(one.attrib["armature"]) for one in root.iter(tag)] == [0.0, 0.0]
    found = [
        [float(str(one.attrib.get(n) or one.findtext(n))) for n in names] for one in root.iter(tag)
    ]
    assert found == [[ODD.b1, 0.0], [0.0, 0.3]]


def test_what_a_comment_may_not_hold_is_written_otherwise() -> None:
    name = 'a--b */ """ \\n.algid'
    for to in SUFFIXES:
        text, _ = exported(result_of(values_of(ODD)), name, to, {})
        if to in XML:
            ET.fromstring(text)
            assert "a‐‐b" in text
        elif to == "c":
            assert text.index("*/") > text.index("I2 " if "I2 " in text else "k7")
            assert "a--b * / " in text
        else:
            compile(text, "arm.py", "exec")
            assert "a--b * / ''' /n.algid" in text


def test_the_header_says_where_each_number_comes_from() -> None:
    payload = {"m_p": 0.5, "l1": 0.4, "l2": 0.3}
    result = result_of(values_of(ODD, f1=0.4, f2=0.3), Model(("coulomb",)), payload, std=0.01)
    prior = result.parameters["k3"].model_copy(update={"status": Status.FROM_PRIOR})
    late = result.parameters["k6"].model_copy(update={"estimate": 0.0125, "unit": "s"})
    found = {**result.parameters, "k3": prior, "delay": late}
    moved = result.model_copy(update={"parameters": found})
    text, _ = exported(moved, "result.json", "urdf", {"rotor1": 0.01})
    assert 'robot name="arm"' in text
    assert origins(text) == {
        "k1": "identified, ± 0.00043 (95 %), conditioned on l1",
        "k3": "from the prior, not measured, ± 0.00028 (95 %), conditioned on l1",
        "f1": "identified, ± 0.0078 (95 %), conditioned on l1",
        "g": "given",
        "l1": "identified with the payload, ± 0.0078 (95 %)",
        "m1": "chosen, nearest to a uniform link",
        "lc1": "chosen with the masses: k4 = g (m1 lc1 + m2 l1)",
        "rotor1": "given",
        "l2": "identified with the payload",
    }
    assert re.findall(r"This file (\w+ \w+ \w+)\b.*\.\n", text) == [
        "holds Coulomb friction",
        "lacks the delay",
        "holds rotor1 within",
    ]
    offset = text_of("sdf", values_of(ODD, o1=0.01, o2=-0.02), Model(("offset",)))
    assert re.search(r"This file lacks .*: o1 0\.01 N m and o2 -0\.02 N m\.\n", offset)
    bare = origins(text_of("mjcf", bent(0.2), BENT, m1=1.9, m2=0.7))
    assert bare["l1"] == "identified, g k1 / k2, ± 0.00099 (95 %)"
    assert bare["lc1"] == "identified, given m1 and m2: k4 = g (m1 lc1 + m2 l1)"


def origins(text: str) -> dict[str, str]:
    """Where the header has some numbers from."""
    names = "k1|k3|f1|g|l1|m1|lc1|rotor1|l2"
    return dict(
        re.findall(rf"^  ({names}) +[-\d.e]+ +(?:kg m\^2|N m|m/s\^2|kg|m) +(.*)$", text, re.M)
    )


def yaml(result: Result, **known: float) -> Any:
    """The payload as its file says it."""
    return YAML(typ="safe").load(exported(result, 'a"b', "payload", known)[0])["payload"]


def test_the_payload_is_yaml_that_a_planner_reads() -> None:
    result = result_of(values_of(ODD), payload={"m_p": 0.5, "l1": 0.4, "l2": 0.3}, std=0.01)
    content = yaml(result)
    covariance = np.diag([0.005**2, 0.003**2, 0, 0])
    np.testing.assert_allclose(content.pop("covariance"), covariance, rtol=1e-9)
    assert content == {
        "mass": 0.5,
        "mass_std": pytest.approx(0.005),
        "frame": "link2",
        "centre_of_gravity": [0.3, 0.0, 0.0],
        "centre_of_gravity_std": [pytest.approx(0.003), 0.0, 0.0],
        "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 0.0),
        "izz_std": 0.0,
    }
    assert yaml(result, l2=0.3)["covariance"][1] == [0.0] * 4
    bare = {**result.payload, "m_p": result.payload["m_p"].model_copy(update={"std": None})}
    assert yaml(result.model_copy(update={"payload": bare}))["mass_std"] is None
    told = yaml(result_of(values_of(ODD), payload={"m_p": 0.5, "l1": 0.4}, l2=0.25))
    assert (told["centre_of_gravity"][0], told["centre_of_gravity_std"][0]) == (0.25, 0.0)


def test_a_payload_without_a_length_or_a_sound_mass_is_refused() -> None:
    lost = result_of(values_of(ODD), payload={"m_p": 0.5, "l1": 0.4})
    with pytest.raises(AlgidError) as refused:
        exported(lost, "arm", "payload", {})
    assert str(refused.value) == "arm: the result does not tell where the payload hangs; give --l2"
    assert "[0.3, 0.0, 0.0]  # m" in exported(lost, "arm", "payload", {"l2": 0.3})[0]
    vague = lost.payload["m_p"].model_copy(update={"status": Status.NOT_IDENTIFIABLE})
    with pytest.raises(
        AlgidError, match="arm: the result has no payload; identify with --loaded LOG"
    ):
        exported(lost.model_copy(update={"payload": {"m_p": vague}}), "arm", "payload", {"l2": 0.3})


@pytest.mark.parametrize("to", ["urdf", "sdf", "mjcf"])
def test_a_horizontal_arm_turns_about_the_vertical(to: str) -> None:
    value = values_of(Arm(**{**vars(ODD), "g": 0.0}))
    text = text_of(to, value, Model(gravity=0.0), l1=0.4)
    assert text.count("0 0 1") == 2
    assert "0 -1 0" not in text
    assert "k2 " not in text
    said = [line for line in text.splitlines() if "chosen with" in line or "nearest" in line]
    assert any(line.strip().startswith("m1") for line in said)


def test_the_payloads_call_is_in_the_flanges_frame() -> None:
    """A flange 0.1 m along link 2, its x axis to the right of it: x is what lies right of the
    line, y what lies beyond along it.
    """
    payload = {"m_p": 0.5, "l1": 0.4, "l2": 0.3, "y_p": 0.02}
    result = result_of(values_of(ODD), payload=payload)
    made = algid.export(result, "payload", flange="0.1,0,-90")
    assert "\nset_target_payload(0.50000, [-0.02000, 0.20000, FLANGE_Z])\n" in made.call
    request = YAML(typ="safe").load(made.call.splitlines()[-1].split('"')[1])
    assert request == {
        "mass": 0.5, "center_of_gravity": {"x": -0.02, "y": 0.2, "z": "FLANGE_Z"},
    }  # fmt: skip
    blank = algid.export(result, "payload").call
    assert "set_target_payload(0.50000, [FLANGE_X, FLANGE_Y, FLANGE_Z])" in blank
    assert "FLANGE_X, FLANGE_Y: give --flange" in blank
    with pytest.raises(AlgidError, match="--flange: urdf holds no flange; leave it out"):
        algid.export(result, "urdf", flange=(0, 0, 0))
    for wrong, why in (
        ("1,2", "field required"),
        ((0, 0, 720), "expected less than or equal to 360, found 720"),
        ("0,nan,0", "expected less than or equal to 1000, found 'nan'"),
    ):
        with pytest.raises(AlgidError, match=rf"^--flange: {why}.*X,Y,ANGLE in m, m, °"):
            algid.export(result, "payload", flange=wrong)
