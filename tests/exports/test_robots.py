"""Robot descriptions, payload and programs in the hands of others, and what their comments say."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from itertools import pairwise

import numpy as np
import pytest
from ruamel.yaml import YAML

import algid
from algid.arm import Arm, regressor
from algid.base.errors import AlgidError
from algid.base.significance import NORMAL
from algid.exports.formats import FORMATS, exported
from algid.exports.links import Knowns
from algid.model import Model
from algid.results import Status
from tests.exports.arms import ODD, UNIFORM, result_of, states, values_of

XML = ("urdf", "sdf", "mjcf")


def text_of(
    to: str, value: dict[str, float] | None = None, model: Model | None = None, **known: float
) -> str:
    return exported(
        result_of(values_of(ODD) if value is None else value, model),
        "arm.algid",
        to,
        Knowns(**known),
    )[0]


def test_pinocchios_regressor_and_links_give_the_torque_of_table_1() -> None:
    """τ = Y π by Pinocchio's regressor of the links' ten parameters each is algid's Y k by its
    seven.
    """
    pin = pytest.importorskip("pinocchio")
    robot = pin.buildModelFromXML(text_of("urdf", l2=0.3))
    data, (theta, omega, alpha) = robot.createData(), states(60)
    parameters = np.concatenate([body.toDynamicParameters() for body in list(robot.inertias)[1:]])
    k = ODD.constants()
    ours = np.einsum("aqn,q->an", regressor(theta, omega, alpha)[:, :5], k[:5])
    for place in range(theta.shape[1]):
        q = np.stack([np.cos(theta[:, place]), np.sin(theta[:, place])], axis=1).ravel()
        Y = pin.computeJointTorqueRegressor(robot, data, q, omega[:, place], alpha[:, place])
        np.testing.assert_allclose(
            Y @ parameters, ours[:, place], rtol=0, atol=1e-9 * np.abs(ours).max()
        )


def test_the_tip_is_where_the_angles_say() -> None:
    pin, mujoco = pytest.importorskip("pinocchio"), pytest.importorskip("mujoco")
    robot = pin.buildModelFromXML(text_of("urdf", l2=0.35))
    model = mujoco.MjModel.from_xml_string(text_of("mjcf", l2=0.35))
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
def test_every_form_holds_the_same_masses_and_names(to: str) -> None:
    root = ET.fromstring(text_of(to, values_of(UNIFORM, f1=0.4, f2=0.3), Model(("coulomb",))))
    text = ET.tostring(root, encoding="unicode")
    assert [name in text for name in ("link1", "link2", "joint1", "joint2", "tip")] == [True] * 5
    if to == "mjcf":
        masses = [float(body.attrib["mass"]) for body in root.iter("inertial")]
    else:
        masses = [
            float(mass.attrib.get("value") or mass.text or "nan") for mass in root.iter("mass")
        ]
    np.testing.assert_allclose(masses, [UNIFORM.m1, UNIFORM.m2], rtol=1e-5)
    assert (root.attrib.get("name") or root.attrib.get("model") or root[0].attrib["name"]) == "arm"


@pytest.mark.parametrize("to", XML)
def test_a_drawn_link_is_as_long_as_it_is(to: str) -> None:
    root = ET.fromstring(text_of(to, values_of(UNIFORM), l2=0.3))
    if to == "mjcf":
        boxes = [
            [float(part) for part in geom.attrib["fromto"].split()] for geom in root.iter("geom")
        ]
        np.testing.assert_allclose(boxes, [[0, 0, 0, 0.4, 0, 0], [0, 0, 0, 0.3, 0, 0]])
        np.testing.assert_allclose(
            [float(geom.attrib["size"]) for geom in root.iter("geom")], [0.012, 0.009]
        )
        return
    sizes = [str(box.attrib.get("size") or box.findtext("size")) for box in root.iter("box")]
    expected = [[0.4, 0.024, 0.024], [0.3, 0.018, 0.018]]
    visuals = [(visual.find("origin"), visual.findtext("pose")) for visual in root.iter("visual")]
    middles = [pose if origin is None else origin.attrib["xyz"] for origin, pose in visuals]
    np.testing.assert_allclose([float(str(middle).split()[0]) for middle in middles], [0.2, 0.15])
    np.testing.assert_allclose([[float(part) for part in size.split()] for size in sizes], expected)


@pytest.mark.parametrize("to", XML)
def test_losses_that_are_negative_are_left_out_and_said(to: str) -> None:
    value = values_of(ODD, f1=-0.1, f2=0.3, j2=-0.002) | {"k7": -0.05}
    text = text_of(to, value, Model(("coulomb", "rotor")))
    said = re.findall(r"This file leaves out (\w+), which is negative: (\S+)\.\n", text)
    expected = [("k7", "-0.05"), ("f1", "-0.1"), *([("j2", "-0.002")] if to == "mjcf" else [])]
    assert said == expected
    root = ET.fromstring(text)
    if to != "mjcf":
        names = ("damping", "friction")
        found = [
            tuple(float(str(one.attrib.get(n) or one.findtext(n))) for n in names)
            for one in root.iter("dynamics")
        ]
    else:
        joints = list(root.iter("joint"))
        found = [
            (float(one.attrib["damping"]), float(one.attrib["frictionloss"])) for one in joints
        ]
        assert [float(one.attrib["armature"]) for one in joints] == [0.0, 0.0]
    assert found == [(ODD.b1, 0.0), (0.0, 0.3)]


def test_the_rotor_of_joint_1_stands_where_a_format_has_a_place_for_it() -> None:
    for to in XML:
        without, with_rotor = text_of(to, m1=2.0, m2=0.7), text_of(to, m1=2.0, m2=0.7, rotor1=0.01)
        held = "holds rotor1 within the inertia of link 1, as"
        assert (held in with_rotor) == (to != "mjcf")
        assert held not in without
        across = re.compile(r'<iyy>([^<]+)|iyy="([^"]+)|diaginertia="\S+ (\S+)')
        inertias = [float("".join(across.findall(text)[0])) for text in (without, with_rotor)]
        assert inertias[0] == pytest.approx(ODD.I1, rel=1e-9)
        assert inertias[1] == pytest.approx(ODD.I1 - (0.01 if to == "mjcf" else 0.0), rel=1e-9)
    armature = [
        joint.attrib["armature"]
        for joint in ET.fromstring(text_of("mjcf", rotor1=0.01)).iter("joint")
    ]
    assert armature == ["0.01", "0.0"]


def test_what_a_comment_may_not_hold_is_written_otherwise() -> None:
    name = 'a--b */ """ \\n.algid'
    for to in FORMATS:
        text, _ = exported(result_of(values_of(ODD)), name, to, Knowns())
        if to in XML:
            ET.fromstring(text)
            assert "a‐‐b" in text
        elif to == "c":
            assert text.index("*/") > text.index("I2 " if "I2 " in text else "k7")
            assert "a--b * / " in text
        else:
            compile(text, "arm.py", "exec")
            assert "a--b * / ''' /n.algid" in text


@pytest.mark.parametrize("file", ["lab/arm-7.algid", "lab/arm-7.algid/result.json"])
def test_a_robot_is_named_after_its_result(file: str) -> None:
    assert '<robot name="arm_7">' in exported(result_of(values_of(ODD)), file, "urdf", Knowns())[0]
    assert (
        '<robot name="_7arm">'
        in exported(result_of(values_of(ODD)), "7arm.algid", "urdf", Knowns())[0]
    )


def test_every_number_is_listed_with_its_unit_and_reads_back() -> None:
    for to in FORMATS:
        text = text_of(to, values_of(ODD, f1=0.4, f2=0.3), Model(("coulomb",)))
        value = values_of(ODD, f1=0.4, f2=0.3)
        for name, number in value.items():
            found = re.search(rf"\b{name} +(\S+) +(.*?)  +identified, ± (\S+) \(95 %\)", text)
            assert found is not None, (to, name)
            assert float(found.group(1)) == number
            assert float(found.group(3)) == float(f"{NORMAL * 1e-3 * abs(number):.2g}")
        assert re.search(r"\bg +9\.81 +m/s\^2 +given", text)


def test_a_delay_is_said_to_be_lacking() -> None:
    result = result_of(values_of(ODD))
    k1 = result.parameters["k1"]
    delayed = result.model_copy(
        update={
            "parameters": {
                **result.parameters,
                "delay": k1.model_copy(update={"estimate": 0.0025, "unit": "s"}),
            }
        }
    )
    for to in FORMATS:
        assert (
            "This file lacks the delay from torque to angle: 0.0025 s."
            in exported(delayed, "a", to, Knowns())[0]
        )


def test_the_payload_is_yaml_that_a_planner_reads() -> None:
    result = result_of(values_of(ODD), payload={"m_p": 0.5, "l1": 0.4, "l2": 0.3}, std=0.01)
    content = YAML(typ="safe").load(exported(result, 'a"b', "payload", Knowns())[0])["payload"]
    assert content == {
        "mass": 0.5,
        "mass_std": pytest.approx(0.005),
        "frame": "link2",
        "centre_of_gravity": [0.3, 0.0, 0.0],
        "centre_of_gravity_std": [pytest.approx(0.003), 0.0, 0.0],
        "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 0.0),
        "izz_std": 0.0,
        "covariance": [
            [pytest.approx(0.005**2), 0.0, 0.0, 0.0],
            [0.0, pytest.approx(0.003**2), 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0],
        ],
    }
    given = YAML(typ="safe").load(exported(result, "a", "payload", Knowns(l2=0.3))[0])["payload"]
    assert given["covariance"][1] == [0.0] * 4
    bare = result.payload["m_p"].model_copy(update={"std": None})
    text = exported(
        result.model_copy(update={"payload": {**result.payload, "m_p": bare}}),
        "a",
        "payload",
        Knowns(),
    )[0]
    assert YAML(typ="safe").load(text)["payload"]["mass_std"] is None
    told = result_of(values_of(ODD), payload={"m_p": 0.5, "l1": 0.4}, l2=0.25)
    content = YAML(typ="safe").load(exported(told, "a", "payload", Knowns())[0])["payload"]
    assert (content["centre_of_gravity"][0], content["centre_of_gravity_std"][0]) == (0.25, 0.0)


def test_a_payload_without_a_length_or_a_sound_mass_is_refused() -> None:
    lost = result_of(values_of(ODD), payload={"m_p": 0.5, "l1": 0.4})
    with pytest.raises(AlgidError) as refused:
        exported(lost, "arm", "payload", Knowns())
    assert str(refused.value) == "arm: the result does not tell where the payload hangs; give --l2"
    assert "[0.3, 0.0, 0.0]  # m" in exported(lost, "arm", "payload", Knowns(l2=0.3))[0]
    vague = lost.payload["m_p"].model_copy(update={"status": Status.NOT_IDENTIFIABLE})
    with pytest.raises(
        AlgidError, match="arm: the result has no payload; identify with --loaded LOG"
    ):
        exported(
            lost.model_copy(update={"payload": {"m_p": vague}}), "arm", "payload", Knowns(l2=0.3)
        )


def test_lengths_that_the_result_was_told_are_taken_and_flags_beat_them() -> None:
    told = result_of(values_of(ODD), l1=0.41, l2=0.33)
    sdf = exported(told, "a", "sdf", Knowns())[0]
    assert re.search(r"l1 +0\.41 +m +given", sdf)
    assert re.search(r"l2 +0\.33 +m +given", sdf)
    # k1 and k2, each to a thousandth, tell the same length then: k1 to a thousandth over √2
    half = NORMAL * 1e-3 * 0.7 * 0.4 * 0.11 / np.sqrt(2)
    assert f"identified, ± {half:.2g} (95 %), conditioned on l1" in sdf
    assert re.search(r"l1 +0\.39 +m +given", exported(told, "a", "sdf", Knowns(l1=0.39))[0])


@pytest.mark.parametrize(
    ("knowns", "message"),
    [
        (Knowns(m2=5.0, l1=0.4), "check --set m2 or --l1, or leave it out"),
        (Knowns(m2=5.0), "check --set m2, or leave it out"),
        (Knowns(m1=0.01, m2=0.7), "check --set m1 or --set m2, or leave it out"),
        (
            Knowns(rotor1=0.2, m1=1.0, l2=0.2),
            "check --set rotor1 or --l2 or --set m1, or leave it out",
        ),
    ],
)
def test_a_refusal_names_every_flag_that_may_be_wrong(knowns: Knowns, message: str) -> None:
    with pytest.raises(AlgidError) as refused:
        exported(result_of(values_of(ODD)), "arm", "urdf", knowns)
    assert str(refused.value).endswith(message)


@pytest.mark.parametrize("to", ["urdf", "sdf", "mjcf"])
def test_a_horizontal_arm_turns_about_the_vertical(to: str) -> None:
    value = values_of(Arm(**{**vars(ODD), "g": 0.0}))
    text = text_of(to, value, Model(gravity=0.0), l1=0.4)
    assert text.count("0 0 1") == 2
    assert "0 -1 0" not in text
    assert "k2 " not in text
    said = [line for line in text.splitlines() if "chosen with" in line or "nearest" in line]
    assert any(line.strip().startswith("m1") for line in said)


def test_links_follow_one_another_without_a_gap() -> None:
    """The mass that a search finds varies steadily with what is known."""
    masses = []
    for length in np.linspace(0.25, 0.35, 6):
        root = ET.fromstring(text_of("urdf", l2=float(length)))
        masses.append([float(mass.attrib["value"]) for mass in root.iter("mass")][1])
    assert all(a > b for a, b in pairwise(masses))  # a longer link 2 of the same inertia is lighter


def test_no_rotor_may_be_said_and_no_arm_has_two_negative_inertias() -> None:
    assert re.search(r"rotor1 +0\.0 +kg m\^2 +given", text_of("urdf", rotor1=0.0))
    with pytest.raises(
        AlgidError, match=r"not positive definite \(k1 0\.0308, k3 -1, k5 -1 kg m²\)"
    ):
        text_of("c", values_of(ODD) | {"k3": -1.0, "k5": -1.0})


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
    assert made.text == exported(result, "result", "payload", Knowns())[0].replace(
        '"result"', '"run--1.csv"'
    )
    blank = algid.export(result, "payload").call
    assert "set_target_payload(0.50000, [FLANGE_X, FLANGE_Y, FLANGE_Z])" in blank
    assert "FLANGE_X, FLANGE_Y: give --flange" in blank
    with pytest.raises(AlgidError, match="--flange: urdf holds no flange; leave it out"):
        algid.export(result, "urdf", flange=(0, 0, 0))
    for wrong in ("1,2", (0, 0, 720), "0,nan,0"):
        with pytest.raises(AlgidError, match="--flange: expected metres and degrees like 0"):
            algid.export(result, "payload", flange=wrong)
