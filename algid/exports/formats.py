"""Export formats by name, each a template with what it is made of, and the payload for planners."""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from algid.base.errors import ResultError, SettingError
from algid.exports.description import Description, describe
from algid.exports.links import Knowns
from algid.exports.programs import program
from algid.exports.robots import numbers, robot
from algid.identification.known import contradictions, covariance_of
from algid.notices import Notice
from algid.options import flag
from algid.results import Result


@dataclass(frozen=True)
class Format:
    """A format: its template, what that is made of, whether it needs links, and its flags."""

    template: str
    content: Callable[[Description], dict[str, Any]]
    links: bool
    takes: frozenset[str]

    @property
    def suffix(self) -> str:
        """What names of its files end in."""
        return Path(self.template).suffix


_LINKS = frozenset({"l1", "l2", "m1", "m2", "rotor1"})
FORMATS = {
    "urdf": Format("arm.urdf", partial(robot, rotors=False), True, _LINKS),
    "mjcf": Format("arm.xml", partial(robot, rotors=True), True, _LINKS),
    "sdf": Format("arm.sdf", partial(robot, rotors=False), True, _LINKS),
    "python": Format("arm.py", partial(program, before=""), False, frozenset({"l1"})),
    "c": Format("arm.c", partial(program, before=" * "), False, frozenset({"l1"})),
}
PAYLOAD = "payload"


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
        If what is known leaves no positive mass or inertia, is no positive number, or has no place
        in the format.
    """
    takes(to, frozenset({"l2"}) if to == PAYLOAD else FORMATS[to].takes, knowns)
    if to == PAYLOAD:
        content = _payload(result, file, knowns)
        return _template("payload.yaml").render(content), contradictions(result, knowns.given)
    arm = describe(result, file, knowns, links=FORMATS[to].links)
    return written(arm, to), arm.warnings


def takes(to: str, names: frozenset[str], knowns: Knowns) -> None:
    """Raise `SettingError` where what is known is no positive number, or none of `names`."""
    for name, value in knowns.given.items():
        if not 0 < value < float("inf") and not (name == "rotor1" and value == 0):
            raise SettingError(f"{flag(name)}: expected a positive number, found {value:g}")
        if name not in names:
            raise SettingError(f"{flag(name)}: {to} holds no such number; leave it out")


def written(arm: Description, to: str) -> str:
    """The text of an arm in the format `to`."""
    return _template(FORMATS[to].template).render(FORMATS[to].content(arm))


@cache
def _template(name: str) -> Any:
    """A template; no value in its text comes from outside but numbers and cleaned names."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["n"] = numbers
    return environment.get_template(f"{name}.j2")


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

    def body(name: str) -> tuple[float, float | None]:
        """Estimate and standard deviation of a part of the payload's body: zero without one."""
        estimate = result.payload.get(name)
        if estimate is None or estimate.estimate is None:
            return 0.0, 0.0
        return estimate.estimate, estimate.std

    def number(value: float | None) -> str:
        return "null" if value is None else repr(float(value))

    (y, y_std), (J, J_std) = body("y_p"), body("J_p")
    # nothing is shared with what is given or not determined
    shared = ("m_p", "y_p", "J_p") if given else ("m_p", "l2", "y_p", "J_p")
    covariance = np.nan_to_num(covariance_of(result, ("m_p", "l2", "y_p", "J_p"), shared))
    return {
        "file": json.dumps(file),
        "estimator": result.estimator,
        "where": "given" if given else "identified",
        "mass": mass.estimate,
        "mass_std": number(mass.std),
        "x": length,
        "x_std": number(0.0 if given or identified is None else identified.std),
        "y": y,
        "y_std": number(y_std),
        "J": J,
        "J_std": number(J_std),
        "covariance": covariance.tolist(),
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
    payload = _payload(result, file, knowns)
    x, y = "FLANGE_X", "FLANGE_Y"
    blanks = f"FLANGE_X, FLANGE_Y: give {flag('flange')}; FLANGE_Z: measure,"
    if flange is not None:
        apart = complex(payload["x"] - flange[0], payload["y"] - flange[1])
        centre = apart * cmath.exp(-1j * math.radians(flange[2]))
        x, y, blanks = (
            f"{round(centre.real, 5) + 0.0:.5f}",
            f"{round(centre.imag, 5) + 0.0:.5f}",
            "FLANGE_Z: measure,",
        )
    mass = f"{payload['mass']:.5f}"
    return (
        "# kg, and m in the flange's frame; the mass is what the loaded log has more than the\n"
        "# unloaded one: a gripper that both had is to be added.\n"
        f"# {blanks} a log of a planar arm does not tell what lies across its plane.\n"
        "# URScript, PolyScope 5.10 or later:\n"
        f"set_target_payload({mass}, [{x}, {y}, FLANGE_Z])\n"
        "# ROS 2, ur_robot_driver:\n"
        "ros2 service call /io_and_status_controller/set_payload ur_msgs/srv/SetPayload "
        f'"{{mass: {mass}, center_of_gravity: {{x: {x}, y: {y}, z: FLANGE_Z}}}}"\n'
    )
