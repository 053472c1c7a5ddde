"""A URDF file read back as an arm, so that one from CAD is judged on the same logs as a result.

Two joints about one direction move; what is fixed to a link counts to it. θ1 is the angle of the
line from joint 1 to joint 2 over the horizontal, θ2 that of link 2's line: to the tip, which is
the last frame fixed to it, or, without one, to its centre of mass.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from algid.arm import Arm, FloatArray
from algid.errors import ResultError
from algid.files import read_text
from algid.identification.source import Role
from algid.identification.validate import Predictor
from algid.model import SINES, TERMS, Model
from algid.words import counted

GRAVITY = 9.81
_PARALLEL = 1e-3  # sine of the angle between axes that count as one direction
_BESIDE = 1e-9  # rad: a centre of mass less off its link's line is on it


@dataclass(frozen=True, eq=False)
class _Body:
    """Mass, first moment (3,), second moment ∫ r rᵀ dm (3, 3) in the frame of a link."""

    mass: float
    moment: FloatArray
    second: FloatArray

    def moved(self, rotation: FloatArray, shift: FloatArray) -> _Body:
        """The body in a frame in which its own stands at `shift`, turned by `rotation`."""
        moment = rotation @ self.moment
        second = rotation @ self.second @ rotation.T
        cross = np.outer(moment, shift)
        return _Body(
            self.mass,
            moment + self.mass * shift,
            second + cross + cross.T + self.mass * np.outer(shift, shift),
        )

    def __add__(self, other: _Body) -> _Body:
        return _Body(self.mass + other.mass, self.moment + other.moment, self.second + other.second)


_NOTHING = _Body(0.0, np.zeros(3), np.zeros((3, 3)))


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
        arm, friction = _Robot(robot).arm()
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


class _Robot:
    """The joints of a URDF file, by the link that they hang from."""

    def __init__(self, robot: ET.Element) -> None:
        self._links = {_attribute(link, "name"): link for link in robot.findall("link")}
        self._joints = robot.findall("joint")
        self._moving = []
        turning = True
        for joint in self._joints:
            kind = _attribute(joint, "type")
            if kind != "fixed":
                self._moving.append(joint)
                turning &= kind in ("revolute", "continuous")
        if len(self._moving) != 2 or not turning:
            raise ValueError(
                f"found {counted(len(self._moving), 'moving joint')}, or not all of them turn"
            )
        self._parent = {_linked(joint, "child"): joint for joint in self._joints}
        self._refuse_circles()

    def _refuse_circles(self) -> None:
        """Raises `ValueError` where a link hangs from two joints, or from itself."""
        if len(self._parent) < len(self._joints):
            raise ValueError("a link hangs from two joints")
        for link in self._parent:
            passed, above = {link}, link
            while above in self._parent:
                above = _linked(self._parent[above], "parent")
                if above in passed:
                    raise ValueError(f"link {link!r} is fixed to itself")
                passed.add(above)

    def arm(self) -> tuple[Arm, tuple[float, float]]:
        """The arm, and its joints' Coulomb friction in N m."""
        first, second = self._moving
        base, place = self._frame(first)
        follows = self._frame(second)[0] == self._child(first)
        if base in {self._child(first), self._child(second)} or not follows:
            first, second = second, first
            base, place = self._frame(first)
        if self._frame(second)[0] != self._child(first):
            raise ValueError("the joints do not follow one another")
        about = place[0] @ _axis(first)
        turn, at = self._frame(second)[1]
        if np.linalg.norm(np.cross(_axis(first), turn @ _axis(second))) > _PARALLEL:
            raise ValueError("the joints' axes are not parallel")
        length, one = self._planar(self._child(first), _axis(first), at)
        tip = self._tip(self._child(second))
        reach, two = self._planar(self._child(second), _axis(second), tip)
        tilt = math.sqrt(max(0.0, 1 - float(about[2]) ** 2))
        g = GRAVITY * tilt if tilt > _PARALLEL else 0.0
        arm = Arm(
            m1=one[0], lc1=one[1], I1=one[2], delta1=one[3], l1=length, b1=_loss(first, "damping"),
            m2=two[0], lc2=two[1], I2=two[2], delta2=two[3], l2=reach, b2=_loss(second, "damping"),
            g=g,
        )  # fmt: skip
        return arm, (_loss(first, "friction"), _loss(second, "friction"))

    def _child(self, joint: ET.Element) -> str:
        return _linked(joint, "child")

    def _frame(self, joint: ET.Element) -> tuple[str, tuple[FloatArray, FloatArray]]:
        """The moving link (or the base) that carries a joint, and the joint's frame in it."""
        rotation, at = _origin(joint)
        link = _linked(joint, "parent")
        while link in self._parent and self._parent[link] not in self._moving:
            turn, shift = _origin(self._parent[link])
            rotation, at = turn @ rotation, shift + turn @ at
            link = _linked(self._parent[link], "parent")
        return link, (rotation, at)

    def _fixed(self, link: str) -> list[ET.Element]:
        return [
            joint
            for joint in self._joints
            if joint not in self._moving and _linked(joint, "parent") == link
        ]

    def _body(self, link: str) -> _Body:
        """A link with all that is fixed to it, in its frame."""
        body = _NOTHING
        if link not in self._links:
            raise ValueError(f"there is no link {link}")
        inertial = self._links[link].find("inertial")
        if inertial is not None:
            mass = _number(_attribute(_part(inertial, "mass"), "value"))
            moments = _part(inertial, "inertia")
            xx, yy, zz, xy, xz, yz = (
                _number(_attribute(moments, name))
                for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            )
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
            body = _Body(mass, np.zeros(3), second).moved(*_origin(inertial))
        for joint in self._fixed(link):
            body = body + self._body(self._child(joint)).moved(*_origin(joint))
        return body

    def _tip(self, link: str) -> FloatArray:
        body = self._body(link)
        at, rotation = np.zeros(3), np.eye(3)
        while self._fixed(link):
            turn, shift = _origin(self._fixed(link)[-1])
            at, rotation = at + rotation @ shift, rotation @ turn
            link = self._child(self._fixed(link)[-1])
        return at if np.linalg.norm(at) > 0 else body.moment / max(body.mass, 1e-300)

    def _planar(
        self, link: str, about: FloatArray, end: FloatArray
    ) -> tuple[float, tuple[float, float, float, float]]:
        """Length of a link in the plane, its mass, and its centre, inertia about it and angle.

        The centre is so far from the joint, and so turned off the link's line, in rad.

        Raises
        ------
        ValueError
            If the link has no mass, or no length across its axis.
        """
        body = self._body(link)
        if body.mass <= 0:
            raise ValueError(f"link {link} has no mass")
        line = end - about * (about @ end)
        length = float(np.linalg.norm(line))
        if length == 0:
            raise ValueError(f"link {link} has no length across its axis")
        line = line / length
        centre = body.moment / body.mass
        along, beside = float(line @ centre), float(np.cross(about, line) @ centre)
        second = float(np.trace(body.second) - about @ body.second @ about)  # about the joint
        far = math.copysign(math.hypot(along, beside), along)  # behind the joint it is negative
        turned = math.atan2(beside * math.copysign(1.0, along), abs(along))
        return length, (body.mass, far, second - body.mass * far**2, turned)


def _linked(joint: ET.Element, side: Literal["parent", "child"]) -> str:
    """The name of a joint's parent or child link."""
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


def _origin(element: ET.Element) -> tuple[FloatArray, FloatArray]:
    """Rotation and place of an element's origin: roll, pitch, yaw about fixed axes."""
    origin = element.find("origin")
    given = {} if origin is None else origin.attrib
    roll, pitch, yaw = _three(given.get("rpy", "0 0 0"))
    (a, b, c), (p, q, r) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, a, -p], [0, p, a]])
    about_y = np.array([[b, 0, q], [0, 1, 0], [-q, 0, b]])
    about_z = np.array([[c, -r, 0], [r, c, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x, _three(given.get("xyz", "0 0 0"))


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
