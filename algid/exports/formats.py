"""Export formats by name, each a template with what it is made of, and the payload for planners.

URDF (ROS, MoveIt, Pinocchio, Drake), SDF (Gazebo) and MJCF (MuJoCo) hold links. There the arm moves
in the world's x-z plane: a turn about -y is counterclockwise, so that the joints' angles are θ1 and
θ2 themselves and gravity pulls along -z. Without gravity it moves in the x-y plane about z.
"""

from __future__ import annotations

import cmath
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from algid.base.errors import ResultError, SettingError
from algid.exports.description import Description, describe
from algid.exports.links import Knowns, Link
from algid.exports.programs import program
from algid.exports.templating import numbers, template
from algid.identification.known import contradictions, covariance_of
from algid.model import EVERY_TERM, SINES, TERMS, UNITS
from algid.notices import Notice
from algid.options import flag
from algid.results import Result

TIMESTEP = 5e-4  # s: Runge-Kutta of fourth order errs far below 1e-5 rad a second with it
LOSSES = ("damping", "friction")


@dataclass(frozen=True)
class Format:
    """A format: its template, and of links whether their joints have rotors; a program has none."""

    template: str
    links: bool = False
    rotors: bool = False

    @property
    def suffix(self) -> str:
        """What names of its files end in."""
        return Path(self.template).suffix


FORMATS = {
    "urdf": Format("arm.urdf", links=True),
    "mjcf": Format("arm.xml", links=True, rotors=True),
    "sdf": Format("arm.sdf", links=True),
    "python": Format("arm.py"),
    "c": Format("arm.c"),
}
PAYLOAD = "payload"
TEMPLATES = Path(__file__).parent / "templates"


def exported(result: Result, file: str, to: str, knowns: Knowns) -> tuple[str, tuple[Notice, ...]]:
    """The text of an export, and warnings about what does not fit.

    Parameters
    ----------
    result : Result
    file : str
        What the result's file is called.
    to : str
        A name in `FORMATS`, or "payload".
    knowns : Knowns

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia, or has no place in the format.
    """
    takes(to, knowns)
    if to == PAYLOAD:
        content = _payload(result, file, knowns)
        return template(TEMPLATES / "payload.yaml.j2").render(content), contradictions(
            result, knowns.given
        )
    arm = describe(result, file, knowns, links=FORMATS[to].links)
    return written(arm, to), arm.warnings


def takes(to: str, knowns: Knowns) -> None:
    """Raise `SettingError` where what is known has no place in `to`."""
    taken = {"l2" if to == PAYLOAD else "l1"}
    if to in FORMATS and FORMATS[to].links:
        taken = set(vars(knowns))
    for name in knowns.given:
        if name not in taken:
            raise SettingError(f"{flag(name)}: {to} holds no such number; leave it out")


def written(arm: Description, to: str) -> str:
    """The text of an arm in the format `to`."""
    form = FORMATS[to]
    content = _robot(arm, rotors=form.rotors) if form.links else program(arm)
    content |= {"arm": arm, "units": UNITS, "bent": set(SINES) & set(arm.model.names)}
    header = template(TEMPLATES / "header.j2").render(content).rstrip()
    # nothing in it ends a comment of C or a string of Python
    header = header.replace("*/", "* /").replace("\\", "/").replace('"""', "'''")

    def comment(before: str) -> str:
        """What a file says of itself, with something before each line."""
        return "\n".join(f"{before}{line}".rstrip() for line in header.split("\n"))

    return template(TEMPLATES / f"{form.template}.j2").render(content | {"comment": comment})


def _robot(arm: Description, *, rotors: bool) -> dict[str, Any]:
    """What the templates of robots are made of.

    Without `rotors` that of joint 1 is in link 1's inertia, which turns about the same axis.
    """
    assert arm.links is not None
    (first, second), value = arm.links, arm.value
    model, rotor_within = arm.model, bool(arm.rotor1 and not rotors)
    if rotor_within:
        first = replace(first, inertia=first.inertia + arm.rotor1)
    kinds = (*LOSSES, "rotor") if rotors else LOSSES
    # of a joint damping N m s/rad, Coulomb friction N m, rotor inertia kg m^2; none is negative
    joints = [
        {"name": f"joint{joint}"} | dict.fromkeys((*LOSSES, "rotor"), 0.0) for joint in (1, 2)
    ]
    lacking, negative = [], []
    for term in EVERY_TERM.values():
        held = [(kind, *one) for kind in kinds for one in getattr(term, kind)]
        for kind, name, joint in held:
            if value[name] < 0:
                negative.append(name)
            joints[joint][kind] = max(value[name], 0.0)
        if term.name in model.terms and not (held or term.sines):  # sines: the links' centres
            lacking.append(term)
    joints[0]["rotor"] = arm.rotor1

    def centre(link: Link) -> str:
        """A link's centre of mass in its frame: to the left of its line is up, or on the plane."""
        x, y = link.centre, link.aside
        return numbers((x, 0, y) if model.gravity else (x, y, 0))

    return {
        "axis": "0 -1 0" if model.gravity else "0 0 1",
        "centre": centre,
        "first": first,
        "gravity": model.gravity,
        "joints": joints,
        "jump": any(TERMS[name].friction for name in model.terms),
        "lacking": lacking,
        "negative": negative,
        "rotor_within": rotor_within,
        "second": second,
        "timestep": TIMESTEP,
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
    given = knowns.l2 or result.settings.get("l2")
    identified = result.payload.get("l2")
    length = given or (None if identified is None else identified.estimate)
    if length is None:
        raise ResultError(
            f"{file}: the result does not tell where the payload hangs; give {flag('l2')}"
        )

    # nothing is shared with what is given or not determined
    shared = ("m_p", "y_p", "J_p") if given else ("m_p", "l2", "y_p", "J_p")
    covariance = np.nan_to_num(covariance_of(result, ("m_p", "l2", "y_p", "J_p"), shared))
    content: dict[str, Any] = {
        "file": json.dumps(file),
        "estimator": result.estimator,
        "given": bool(given),
        "mass": mass.estimate,
        "mass_std": mass.std,
        "x": length,
        "x_std": 0.0 if given or identified is None else identified.std,
        "covariance": covariance.tolist(),
    }
    for symbol, name in (("y", "y_p"), ("J", "J_p")):  # of its body: zero without one
        found = result.payload.get(name)
        known = found is not None and found.estimate is not None
        content[symbol] = found.estimate if found and known else 0.0
        content[f"{symbol}_std"] = found.std if found and known else 0.0
    return content


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
    payload = _payload(result, file, knowns)
    x, y = "FLANGE_X", "FLANGE_Y"
    if flange is not None:
        apart = complex(payload["x"] - flange[0], payload["y"] - flange[1])
        centre = apart * cmath.exp(-1j * math.radians(flange[2]))
        x, y = (f"{round(one, 5) + 0.0:.5f}" for one in (centre.real, centre.imag))
    filled = {"mass": f"{payload['mass']:.5f}", "x": x, "y": y, "flag": flag("flange")}
    return str(template(TEMPLATES / "controller.txt.j2").render(filled))
