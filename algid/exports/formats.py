"""Export formats by name with their writers, and the payload as YAML for planners."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from algid.errors import ResultError, SettingError
from algid.exports.description import Description, describe
from algid.exports.links import Knowns
from algid.exports.programs import c99, python_module
from algid.exports.robots import mjcf, sdf, urdf
from algid.identification.known import contradictions, covariance_of
from algid.notices import Notice
from algid.options import flag
from algid.results import Result


@dataclass(frozen=True)
class Format:
    """A format: its suffix, its text of an arm, whether it needs links, and its flags."""

    suffix: str
    text: Callable[[Description], str]
    links: bool
    takes: frozenset[str]


_LINKS = frozenset({"l1", "l2", "m1", "m2", "rotor1"})
FORMATS = {
    "urdf": Format(".urdf", urdf, True, _LINKS),
    "mjcf": Format(".xml", mjcf, True, _LINKS),
    "sdf": Format(".sdf", sdf, True, _LINKS),
    "python": Format(".py", python_module, False, frozenset({"l1"})),
    "c": Format(".c", c99, False, frozenset({"l1"})),
}
PAYLOAD = "yaml"


def exported(result: Result, file: str, to: str, knowns: Knowns) -> tuple[str, tuple[Notice, ...]]:
    """The text of an export, and warnings about what does not fit.

    Parameters
    ----------
    result : Result
    file : str
        What the result's file is called.
    to : str
        A name in `FORMATS`, or "yaml" for the payload.
    knowns : Knowns

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia, is no positive number, or has no place
        in the format.
    """
    takes = frozenset({"l2"}) if to == PAYLOAD else FORMATS[to].takes
    for name, value in knowns.given.items():
        if not 0 < value < float("inf") and not (name == "rotor1" and value == 0):
            raise SettingError(f"{flag(name)}: expected a positive number, found {value:g}")
        if name not in takes:
            raise SettingError(f"{flag(name)}: {to} holds no such number; leave it out")
    if to == PAYLOAD:
        return payload_yaml(result, file, knowns), contradictions(result, knowns.given)
    arm = describe(result, file, knowns, links=FORMATS[to].links)
    return FORMATS[to].text(arm), arm.warnings


def payload_yaml(result: Result, file: str, knowns: Knowns) -> str:
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
    spread = 0.0 if given or identified is None else identified.std
    y, y_std = _with_std(result, "y_p")
    J, J_std = _with_std(result, "J_p")
    shared = ("m_p", "y_p", "J_p") if given else ("m_p", "l2", "y_p", "J_p")
    rows = "".join(f"    - [{', '.join(map(repr, row))}]\n" for row in _covariance(result, shared))
    where = "given" if given else "identified"
    return (
        f"# Payload by algid export, from {json.dumps(file)}, estimator {result.estimator}; SI "
        "units.\n"
        "# Mass identified; what is 0 below was not determined by the logs, or lies out of the "
        "arm's plane.\n"
        f"# centre_of_gravity x {where}, in the frame of link 2: x along the link from joint 2.\n"
        "payload:\n"
        f"  mass: {mass.estimate!r}  # kg\n"
        f"  mass_std: {_or_null(mass.std)}\n"
        "  frame: link2\n"
        f"  centre_of_gravity: [{float(length)!r}, {y!r}, 0.0]  # m\n"
        f"  centre_of_gravity_std: [{_or_null(spread)}, {_or_null(y_std)}, 0.0]\n"
        f"  inertia: {{ixx: 0.0, iyy: 0.0, izz: {J!r}, ixy: 0.0, ixz: 0.0, iyz: 0.0}}  # kg m^2\n"
        f"  izz_std: {_or_null(J_std)}\n"
        "  covariance:  # of mass, x, y and izz\n" + rows
    )


def _covariance(result: Result, shared: Sequence[str]) -> list[list[float]]:
    """Covariance (4, 4) of mass, x, y and inertia: nothing of what is given or not determined."""
    covariance = covariance_of(result, ("m_p", "l2", "y_p", "J_p"), shared)
    rows: list[list[float]] = np.nan_to_num(covariance).tolist()
    return rows


def _with_std(result: Result, name: str) -> tuple[float, float | None]:
    """Estimate and standard deviation of a part of the payload's body: zero if it has no body."""
    estimate = result.payload.get(name)
    return (
        (0.0, 0.0)
        if estimate is None or estimate.estimate is None
        else (estimate.estimate, estimate.std)
    )


def _or_null(value: float | None) -> str:
    return "null" if value is None else repr(float(value))
