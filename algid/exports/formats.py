"""Export formats by name, each a template with what it is made of, and the payload for planners.

URDF (ROS, MoveIt, Pinocchio, Drake), SDF (Gazebo) and MJCF (MuJoCo) hold links. There the arm moves
in the world's x-z plane: a turn about -y is counterclockwise, so that the joints' angles are θ1 and
θ2 themselves and gravity pulls along -z. Without gravity it moves in the x-y plane about z.
"""

from __future__ import annotations

import cmath
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from algid.base.errors import ResultError, SettingError
from algid.exports.description import Description, describe
from algid.exports.links import Knowns
from algid.exports.programs import program
from algid.exports.templating import template
from algid.identification.known import contradictions, covariance_of
from algid.model import EVERY_TERM, SINES, UNITS
from algid.notices import Notice
from algid.options import flag
from algid.results import Result

SUFFIXES = {"urdf": ".urdf", "mjcf": ".xml", "sdf": ".sdf", "python": ".py", "c": ".c"}
"""Of an arm's formats."""
ROBOTS = ("urdf", "mjcf", "sdf")
"""Formats made of links; MJCF alone has rotors."""
TEMPLATES = Path(__file__).parent / "templates"


def exported(result: Result, file: str, to: str, knowns: Knowns) -> tuple[str, tuple[Notice, ...]]:
    """The text of an export, and warnings about what does not fit.

    Parameters
    ----------
    result : Result
    file : str
        What the result's file is called.
    to : str
        A name in `SUFFIXES`, or "payload".
    knowns : Knowns

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia, or has no place in the format.
    """
    takes(to, knowns)
    if to == "payload":
        content = _payload(result, file, knowns)
        text = template(TEMPLATES / "payload.yaml.j2").render(content)
        return text, contradictions(result, knowns)
    arm = describe(result, file, knowns, links=to in ROBOTS)
    return written(arm, to), arm.warnings


def takes(to: str, knowns: Knowns) -> None:
    """Raise `SettingError` where what is known has no place in `to`."""
    for name in knowns:
        if to not in ROBOTS and name != ("l2" if to == "payload" else "l1"):
            raise SettingError(f"{flag(name)}: {to} holds no such number; leave it out")


def written(arm: Description, to: str) -> str:
    """The text of an arm in the format `to`."""
    content = _robot(arm, rotors=to == "mjcf") if to in ROBOTS else program(arm)
    content |= {"arm": arm, "units": UNITS, "bent": set(SINES) & set(arm.model.names)}
    header = template(TEMPLATES / "header.j2").render(content).rstrip()
    # nothing in it ends a comment of C or a string of Python
    header = header.replace("*/", "* /").replace("\\", "/").replace('"""', "'''")
    filled = content | {"header": header}
    return str(template(TEMPLATES / f"arm{SUFFIXES[to]}.j2").render(filled))


def _robot(arm: Description, *, rotors: bool) -> dict[str, Any]:
    """What the templates of robots are made of.

    Without `rotors` that of joint 1 is in link 1's inertia, which turns about the same axis.
    """
    assert arm.links is not None
    (first, second), value, rotor = arm.links, arm.value, arm.known.get("rotor1", 0.0)
    if not rotors:
        first = replace(first, inertia=first.inertia + rotor)
    # of a joint damping N m s/rad, Coulomb friction N m, rotor inertia kg m^2; none is negative
    kinds = ("damping", "friction", "rotor")
    joints = [dict.fromkeys(kinds, 0.0) for _ in range(2)]
    lacking, negative = [], []
    for term in EVERY_TERM.values():
        held = [(kind, *one) for kind in kinds[: 2 + rotors] for one in getattr(term, kind)]
        for kind, name, joint in held:
            negative += [name] if value[name] < 0 else []
            joints[joint][kind] = max(value[name], 0.0)
        if term.name in arm.model.terms and not (held or term.sines):  # sines: the links' centres
            lacking.append(term)
    joints[0]["rotor"] = rotor
    return {
        "axis": "0 -1 0" if arm.model.gravity else "0 0 1",
        "first": first,
        "joints": joints,
        "lacking": lacking,
        "negative": negative,
        "rotor_within": bool(rotor and not rotors),
        "second": second,
        "turned": (math.cos(0.5 * arm.turn), 0, -math.sin(0.5 * arm.turn), 0),
    }


def _payload(result: Result, file: str, knowns: Knowns) -> dict[str, Any]:
    """Mass, centre of gravity and inertia of a result's payload, with their errors and covariance.

    Raises
    ------
    ResultError
        If the result has no payload, or one that no load explains.
    """
    mass = result.payload.get("m_p")
    if mass is None or mass.estimate is None or not mass.usable:
        raise ResultError(f"{file}: the result has no payload; identify with {flag('loaded')} LOG")
    if mass.estimate <= 0:
        raise ResultError(
            f"{file}: no load explains a payload of {mass.estimate:.4g} kg; check which log is "
            "the loaded one"
        )
    # y and inertia are of its body: zero without one
    names, given = ("m_p", "l2", "y_p", "J_p"), knowns.get("l2") or result.settings.get("l2")
    value: dict[str, float] = dict.fromkeys(names, 0.0)
    std: dict[str, float | None] = dict.fromkeys(names, 0.0)
    for name, one in result.payload.items():
        if name in names and one.estimate is not None:
            value[name], std[name] = one.estimate, one.std
    if given:
        value["l2"], std["l2"] = given, 0.0
    if not value["l2"]:
        raise ResultError(
            f"{file}: the result does not tell where the payload hangs; give {flag('l2')}"
        )
    # nothing is shared with what is given or not determined
    covariance = covariance_of(result, names, [name for name in names if std[name] != 0.0])
    return {
        "file": json.dumps(file),
        "estimator": result.estimator,
        "given": bool(given),
        "value": value,
        "std": std,
        "covariance": np.nan_to_num(covariance).tolist(),
    }


def controller_call(
    result: Result, file: str, knowns: Knowns, flange: tuple[float, float, float] | None
) -> str:
    """The calls that set a result's payload on a controller of Universal Robots, in kg and m.

    What a planar log does not tell is a named blank: z, and x and y without `flange`.

    Parameters
    ----------
    result, file, knowns : as of `exported`
    flange : (x, y, angle)
        The flange's frame in that of link 2: origin, m, and in degrees from the link's line where
        its x axis points. Its x and y axes lie in the arm's plane.

    Raises
    ------
    ResultError
        If the result has no payload, or one that no load explains.
    """
    value = _payload(result, file, knowns)["value"]
    x, y = "FLANGE_X", "FLANGE_Y"
    if flange is not None:
        apart = complex(value["l2"] - flange[0], value["y_p"] - flange[1])
        centre = apart * cmath.exp(-1j * math.radians(flange[2]))
        x, y = (f"{round(one, 5) + 0.0:.5f}" for one in (centre.real, centre.imag))
    filled = {"mass": f"{value['m_p']:.5f}", "x": x, "y": y, "flag": flag("flange")}
    return str(template(TEMPLATES / "controller.txt.j2").render(filled))
