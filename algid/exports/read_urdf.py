"""A URDF file read back as an arm, so that one from CAD is judged on the same logs as a result.

Two joints about one direction move; what is fixed to a link counts to it. θ1 is the angle of the
line from joint 1 to joint 2 over the horizontal, θ2 that of link 2's line: to the tip, which is
the last frame fixed to it, or, without one, to its centre of mass.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from algid.arm import Arm, FloatArray
from algid.base.errors import ResultError
from algid.base.files import read_text
from algid.base.words import counted
from algid.identification.recordings import Role
from algid.identification.validate import Predictor
from algid.model import SINES, TERMS, Model

GRAVITY = 9.81
_PARALLEL = 1e-3  # sine of the angle between axes that count as one direction
_ROUNDING = 1e-12  # m: a link this long has no length
_BESIDE = 1e-9  # rad: a centre of mass less off its link's line is on it


def read_urdf(path: Path) -> Predictor:
    """The model of a URDF file for logs of the arm without payload.

    Raises
    ------
    ResultError
        If it is no URDF of an arm with two joints about one direction.
    """
    try:
        robot = ET.fromstring(read_text(path))
    except OSError as error:
        raise ResultError(
            f"{path}: cannot read it ({error.strerror}); expected a URDF file"
        ) from error
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise ResultError(f"{path}: not XML ({error}); expected a URDF file") from error
    try:
        arm, friction = _arm(robot)
    except ValueError as error:
        raise ResultError(
            f"{path}: expected a URDF of an arm with two parallel joints: {error}; mend the file"
        ) from error
    jump = next(term for term in TERMS.values() if term.friction)
    straight = max(abs(arm.delta1), abs(arm.delta2)) < _BESIDE
    bent = () if straight else tuple(name for name, term in TERMS.items() if term.sines)
    model = Model((*((jump.name,) if any(friction) else ()), *bent), gravity=arm.g)
    value = {f"k{number}": float(k) for number, k in enumerate(arm.constants(), start=1)}
    value |= dict(zip(SINES, map(float, arm.sines()), strict=True))
    value |= dict(zip(jump.names, friction, strict=True))
    c = np.array([value[name] for name in model.names])

    def coefficients(role: Role) -> FloatArray:
        if role == "loaded":
            raise ResultError(
                f"{path}: a URDF file tells no payload; judge it on logs of the arm without one"
            )
        return c

    return Predictor(model, coefficients)


def _arm(robot: ET.Element) -> tuple[Arm, tuple[float, float]]:
    """The arm, and its joints' Coulomb friction in N m.

    Raises
    ------
    ValueError
        If the robot is no such arm.
    """
    links = {_attribute(link, "name"): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    hung: dict[str, list[ET.Element]] = {}
    for joint in joints:
        hung.setdefault(_linked(joint, "parent"), []).append(joint)
    # from the base on: each link's frame in the base's where both angles are 0, and after how many
    # of the moving joints it comes
    children = [_linked(joint, "child") for joint in joints]
    open_ends = [(name, 0, np.eye(4)) for name in hung if name not in children]
    frames: dict[str, FloatArray] = {}
    inertia = np.zeros((3, 4, 4))  # ∫ (r, 1) (r, 1)ᵀ dm of the base and of both links
    moving: list[tuple[ET.Element, int, FloatArray]] = []
    while open_ends:
        name, after, frame = open_ends.pop(0)
        if name not in links:
            raise ValueError(f"there is no link {name}")
        if name in frames:
            raise ValueError("a link hangs from two joints")
        frames[name] = frame
        body = frame @ _origin(links[name].find("inertial"))
        share = body @ _pseudo_inertia(links[name]) @ body.T
        for joint in hung.get(name, ()):
            at, own = frame @ _origin(joint), after
            if _attribute(joint, "type") != "fixed":
                moving.append((joint, after, at))
                own = len(moving)
            open_ends.append((_linked(joint, "child"), own, at))
        if after < 3:
            inertia[after] += share
    for name in children:
        if name not in frames:
            raise ValueError(f"link {name!r} is fixed to itself")
    kinds = {_attribute(joint, "type") for joint, _, _ in moving}
    if len(moving) != 2 or not kinds <= {"revolute", "continuous"}:
        raise ValueError(f"found {counted(len(moving), 'moving joint')}, or not all of them turn")
    (first, _, at1), (second, after, at2) = moving
    if after != 1:
        raise ValueError("the joints do not follow one another")
    about = at1[:3, :3] @ _axis(first)
    if np.linalg.norm(np.cross(about, at2[:3, :3] @ _axis(second))) > _PARALLEL:
        raise ValueError("the joints' axes are not parallel")
    tip = _linked(second, "child")
    while tip in hung:
        tip = _linked(hung[tip][-1], "child")
    end = frames[tip][:3, 3]
    if np.array_equal(end, at2[:3, 3]):  # no frame tells: the centre of mass
        end = inertia[2, :3, 3] / max(inertia[2, 3, 3], 1e-300)
    names = (_linked(first, "child"), _linked(second, "child"))
    l1, one = _planar(names[0], inertia[1], about, at1[:3, 3], at2[:3, 3])
    l2, two = _planar(names[1], inertia[2], about, at2[:3, 3], end)
    tilt = math.sqrt(max(0.0, 1 - float(about[2]) ** 2))
    g = GRAVITY * tilt if tilt > _PARALLEL else 0.0
    arm = Arm(
        m1=one[0], lc1=one[1], I1=one[2], delta1=one[3], l1=l1, b1=_loss(first, "damping"),
        m2=two[0], lc2=two[1], I2=two[2], delta2=two[3], l2=l2, b2=_loss(second, "damping"),
        g=g,
    )  # fmt: skip
    return arm, (_loss(first, "friction"), _loss(second, "friction"))


def _pseudo_inertia(link: ET.Element) -> FloatArray:
    """Second moment, first moment and mass (4, 4) in the frame of a link's inertial element."""
    P = np.zeros((4, 4))
    inertial = link.find("inertial")
    if inertial is not None:
        moments = _part(inertial, "inertia")
        xx, yy, zz, xy, xz, yz = (
            _number(_attribute(moments, name))
            for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        P[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
        P[3, 3] = _number(_attribute(_part(inertial, "mass"), "value"))
    return P


def _planar(
    name: str, P: FloatArray, about: FloatArray, joint: FloatArray, end: FloatArray
) -> tuple[float, tuple[float, float, float, float]]:
    """Length of a link in the plane, its mass, and its centre, inertia about it and angle.

    The centre is so far from the joint, and so turned off the link's line, in rad.

    Raises
    ------
    ValueError
        If the link has no mass, or no length across its axis.
    """
    mass = P[3, 3]
    if mass <= 0:
        raise ValueError(f"link {name} has no mass")
    line = end - joint - about * (about @ (end - joint))
    length = float(np.linalg.norm(line))
    if length <= _ROUNDING:
        raise ValueError(f"link {name} has no length across its axis")
    line = line / length
    shift = np.eye(4)
    shift[:3, 3] = -joint
    moved = shift @ P @ shift.T
    centre, second = moved[:3, 3] / mass, moved[:3, :3]
    along, beside = float(line @ centre), float(np.cross(about, line) @ centre)
    h = float(np.trace(second) - about @ second @ about)  # about the joint
    far = math.copysign(math.hypot(along, beside), along)  # behind the joint it is negative
    turned = math.atan2(beside * math.copysign(1.0, along), abs(along))
    return length, (float(mass), far, h - float(mass) * far**2, turned)


def _linked(joint: ET.Element, side: str) -> str:
    """The name of a joint's `parent` or `child` link."""
    return _attribute(_part(joint, side), "link")


def _part(element: ET.Element, tag: str) -> ET.Element:
    """The first element `tag` within another; raises `ValueError` where there is none."""
    part = element.find(tag)
    if part is None:
        raise ValueError(f"<{element.tag}> has no <{tag}>")
    return part


def _attribute(element: ET.Element, name: str) -> str:
    """An attribute's text; raises `ValueError` where there is none."""
    text = element.get(name)
    if text is None:
        raise ValueError(f"<{element.tag}> has no attribute {name}")
    return text


def _origin(element: ET.Element | None) -> FloatArray:
    """An element's origin (4, 4): roll, pitch, yaw about fixed axes, and its place."""
    origin = None if element is None else element.find("origin")
    given = {} if origin is None else origin.attrib
    roll, pitch, yaw = _three(given.get("rpy", "0 0 0"))
    (a, b, c), (p, q, r) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, a, -p], [0, p, a]])
    about_y = np.array([[b, 0, q], [0, 1, 0], [-q, 0, b]])
    about_z = np.array([[c, -r, 0], [r, c, 0], [0, 0, 1]])
    frame = np.eye(4)
    frame[:3, :3] = about_z @ about_y @ about_x
    frame[:3, 3] = _three(given.get("xyz", "0 0 0"))
    return frame


def _axis(joint: ET.Element) -> FloatArray:
    axis = joint.find("axis")
    direction = _three("1 0 0" if axis is None else _attribute(axis, "xyz"))
    length = np.linalg.norm(direction)
    if length == 0:
        raise ValueError("a joint's axis has no direction")
    return direction / length


def _three(text: str) -> FloatArray:
    numbers = np.array(list(map(_number, text.split())))
    if numbers.shape != (3,):
        raise ValueError(f"expected three numbers, found {text!r:.60}")
    return numbers


def _number(text: str) -> float:
    """A finite number; raises `ValueError` where the text is none."""
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"expected a finite number, found {text!r:.60}")
    return number


def _loss(joint: ET.Element, name: str) -> float:
    dynamics = joint.find("dynamics")
    return 0.0 if dynamics is None else _number(dynamics.get(name, "0"))
