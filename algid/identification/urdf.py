"""A URDF file read back as an arm: one from CAD is a prior, or is judged on logs as a result is.

Two joints about one direction move; what is fixed to a link counts to it. θ1 is the angle of the
line from joint 1 to joint 2 over the horizontal, θ2 that of link 2's line: to the tip, which is
the last frame fixed to it, or, without one, to its centre of mass.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np

from algid.arm import Arm, FloatArray
from algid.base.errors import ResultError
from algid.base.files import read_text
from algid.base.text import counted
from algid.identification.recordings import Role
from algid.identification.series import Predictor
from algid.model import SINES, TERMS, Model
from algid.physics.effort import absent
from algid.profile import Profile

GRAVITY = 9.81
_PARALLEL = 1e-3  # sine of the angle between axes that count as one direction
_ROUNDING = 1e-12  # m: a link this long has no length
_BESIDE = 1e-9  # rad: a centre of mass less off its link's line is on it


def arm_of(path: Path) -> tuple[Arm, tuple[float, ...]]:
    """The arm of a URDF file, and its joints' Coulomb friction in N m.

    Raises
    ------
    ResultError
        If it is no URDF of an arm with two joints about one direction.
    """
    try:
        return _arm(ET.fromstring(read_text(path)))
    except OSError as error:
        raise ResultError(
            f"{path}: cannot read it ({error.strerror}); expected a URDF file"
        ) from error
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise ResultError(f"{path}: not XML ({error}); expected a URDF file") from error
    except ValueError as error:
        raise ResultError(
            f"{path}: expected a URDF of an arm with two parallel joints: {error}; mend the file"
        ) from error


def read_urdf(path: Path, profile: Profile | None = None) -> Predictor:
    """The model of a URDF file for logs of the arm without payload; raises as `arm_of`.

    A profile says under what gravity they were, and what of the torque they hold.
    """
    profile = profile or Profile()
    arm, friction = arm_of(path)
    arm = replace(arm, g=arm.g * profile.gravity / GRAVITY)  # g is of the share in its plane
    jump = next(term for term in TERMS.values() if term.friction)
    terms = [jump.name] if any(friction) else []
    if max(abs(arm.delta1), abs(arm.delta2)) > _BESIDE:
        terms += [name for name, term in TERMS.items() if term.sines]
    model = Model(tuple(terms), gravity=arm.g)
    value = {f"k{number}": float(k) for number, k in enumerate(arm.constants(), start=1)}
    value |= dict(zip((*SINES, *jump.names), (*map(float, arm.sines()), *friction), strict=True))
    value |= dict.fromkeys(absent(profile.effort, model.names), 0.0)
    c = np.array([value[name] for name in model.names])

    def coefficients(role: Role) -> FloatArray:
        if role == "loaded":
            raise ResultError(
                f"{path}: a URDF file tells no payload; judge it on logs of the arm without one"
            )
        return c

    return Predictor(model, coefficients)


def _arm(robot: ET.Element) -> tuple[Arm, tuple[float, ...]]:
    """The arm, and its joints' Coulomb friction in N m.

    Raises
    ------
    ValueError
        If the robot is no such arm.
    """
    links = {_text(link, "", "name"): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    ends = [(_text(one, "parent", "link"), _text(one, "child", "link")) for one in joints]
    children = [child for _, child in ends]
    moving = [place for place, one in enumerate(joints) if _text(one, "", "type") != "fixed"]
    kinds = {_text(joints[place], "", "type") for place in moving}
    if len(moving) != 2 or not kinds <= {"revolute", "continuous"}:
        raise ValueError(f"found {counted(len(moving), 'moving joint')}, or not all of them turn")
    # from the base on: a link's frame in the base's where both angles are 0, and after how many of
    # the moving joints it comes
    frames = {name: (np.eye(4), 0) for name in links if name not in children}
    for _ in joints:  # each pass places one more link at least
        for place, (parent, child) in enumerate(ends):
            if parent in frames and child not in frames:
                frame, after = frames[parent]
                own = _origin(joints[place], "origin")
                frames[child] = frame @ own, after + (place in moving)
    astray = [name for name in children if children.count(name) > 1]
    astray += sorted(frames.keys() ^ links.keys())
    if astray:
        raise ValueError(f"there is no link {astray[0]}, or none that it hangs on, or two")
    moving.sort(key=lambda place: frames[children[place]][1])
    names = [children[place] for place in moving]
    if [frames[name][1] for name in names] != [1, 2]:
        raise ValueError("the joints do not follow one another")
    axes = []
    for place, name in zip(moving, names, strict=True):
        direction = np.array(_numbers(joints[place], "axis", "xyz", "1 0 0", 3))
        length = np.linalg.norm(direction)
        if length == 0:
            raise ValueError("a joint's axis has no direction")
        axes.append(frames[name][0][:3, :3] @ direction / length)
    about = axes[0]
    if np.linalg.norm(np.cross(*axes)) > _PARALLEL:
        raise ValueError("the joints' axes are not parallel")
    last, tip = dict(ends), names[1]
    while tip in last:
        tip = last[tip]
    places = [frames[name][0][:3, 3] for name in (*names, tip)]
    numbers: dict[str, float] = {}
    for number, (name, joint) in enumerate(zip(names, places[:2], strict=True), start=1):
        mass, moment, inertia = 0.0, np.zeros(3), 0.0  # about the joint's axis
        for link, (frame, after) in frames.items():
            if after == number and links[link].find("inertial") is not None:
                own, second, m = _inertial(links[link])
                body = frame @ own
                across, r = body[:3, :3].T @ about, body[:3, 3] - joint
                inertia += float(across @ second @ across + m * (r @ r - (about @ r) ** 2))
                mass, moment = mass + m, moment + m * r
        if mass <= 0:
            raise ValueError(f"link {name} has no mass")
        line = places[number] - joint
        if number == 2 and not line.any():  # no frame is the tip: the centre of mass
            line = moment / mass
        line = line - about * (about @ line)
        length = np.linalg.norm(line)
        if length <= _ROUNDING:
            raise ValueError(f"link {name} has no length across its axis")
        along, beside = (
            line @ moment / mass / length,
            np.cross(about, line) @ moment / mass / length,
        )
        # a centre behind the joint has a negative distance
        far = math.copysign(math.hypot(along, beside), along)
        numbers |= {
            f"m{number}": mass,
            f"l{number}": float(length),
            f"lc{number}": far,
            f"I{number}": inertia - mass * far**2,
            f"delta{number}": math.atan2(beside * math.copysign(1.0, along), abs(along)),
            f"b{number}": _numbers(joints[moving[number - 1]], "dynamics", "damping", "0")[0],
        }
    tilt = math.sqrt(max(0.0, 1 - float(about[2]) ** 2))
    friction = [_numbers(joints[place], "dynamics", "friction", "0")[0] for place in moving]
    return Arm(**numbers, g=GRAVITY * tilt if tilt > _PARALLEL else 0.0), tuple(friction)


def _text(element: ET.Element, path: str, name: str, default: str | None = None) -> str:
    """An attribute of the part at `path`; raises `ValueError` where there is none."""
    part = element.find(path) if path else element
    text = default if part is None else part.get(name, default)
    if text is None:
        raise ValueError(f"<{element.tag}> {path} has no {name}")
    return text


def _numbers(
    element: ET.Element, path: str, name: str, default: str | None = None, count: int = 1
) -> list[float]:
    """An attribute's finite numbers; raises `ValueError` where there are no or other ones."""
    text = _text(element, path, name, default)
    numbers = list(map(float, text.split()))
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"expected {counted(count, 'finite number')}, found {text!r:.60}")
    return numbers


def _inertial(link: ET.Element) -> tuple[FloatArray, FloatArray, float]:
    """The frame (4, 4) of a link's centre of mass, the inertia (3, 3) about it, and its mass."""

    def moment(a: str, b: str) -> float:
        return _numbers(link, "inertial/inertia", "i" + "".join(sorted(a + b)))[0]

    inertia = np.array([[moment(a, b) for b in "xyz"] for a in "xyz"])
    return (_origin(link, "inertial/origin"), inertia, _numbers(link, "inertial/mass", "value")[0])


def _origin(element: ET.Element, path: str) -> FloatArray:
    """The origin (4, 4) at `path`: roll, pitch, yaw about fixed axes, and its place."""
    frame = np.eye(4)
    for axis, angle in enumerate(_numbers(element, path, "rpy", "0 0 0", 3)):
        turn, rows = np.eye(3), [(axis + 1) % 3, (axis + 2) % 3]
        c, s = math.cos(angle), math.sin(angle)
        turn[np.ix_(rows, rows)] = [[c, -s], [s, c]]
        frame[:3, :3] = turn @ frame[:3, :3]
    frame[:3, 3] = _numbers(element, path, "xyz", "0 0 0", 3)
    return frame
