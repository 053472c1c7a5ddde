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
from algid.base.names import names_in, outside
from algid.exports import template
from algid.exports.description import Description, describe
from algid.exports.links import Knowns
from algid.identification.known import contradictions, covariance_of
from algid.model import EVERY_TERM, SINES, TERMS, UNITS, Model, Weighted, acting
from algid.notices import Notice
from algid.options import flag
from algid.physics.signals import OMEGA, Expression, text_of_sum
from algid.results import Result

SUFFIXES = {"urdf": ".urdf", "mjcf": ".xml", "sdf": ".sdf", "python": ".py", "c": ".c"}
"""Of an arm's formats."""
ROBOTS = ("urdf", "mjcf", "sdf")
"""Formats made of links; MJCF alone has rotors."""


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
        return _filled("payload.yaml", content), contradictions(result, knowns)
    arm = describe(result, file, knowns, links=to in ROBOTS)
    return written(arm, to), arm.warnings


def takes(to: str, knowns: Knowns) -> None:
    """Raise `SettingError` where what is known has no place in `to`."""
    for name in knowns:
        if to not in ROBOTS and name != ("l2" if to == "payload" else "l1"):
            raise SettingError(f"{flag(name)}: {to} holds no such number; leave it out")


def written(arm: Description, to: str) -> str:
    """The text of an arm in the format `to`."""
    content = _robot(arm, rotors=to == "mjcf") if to in ROBOTS else _program(arm)
    content |= {"arm": arm, "units": UNITS, "bent": set(SINES) & set(arm.model.names)}
    header = _filled("header", content).rstrip()
    # nothing in it ends a comment of C or a string of Python
    header = header.replace("*/", "* /").replace("\\", "/").replace('"""', "'''")
    return _filled(f"arm{SUFFIXES[to]}", content | {"header": header})


def _filled(name: str, content: dict[str, Any]) -> str:
    """The text of a template."""
    return str(template(Path(__file__).parent / f"templates/{name}.j2").render(content))


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


def _program(arm: Description) -> dict[str, Any]:
    """What the templates of programs are made of: nothing but a mathematical library is needed.

    The model's columns become expressions that C99 and Python read alike. In them q1, q2, w1, w2
    are angles and velocities, s1 … c12 sines and cosines of θ1, θ2 and θ1 + θ2, t1 and t2
    tanh(ω / ω_s); parameters have their names in capitals. M and n are inertia, by joint of torque
    and of acceleration, and rest of the columns that are the joints' load; X and r those of the
    others; g is what of n stays at rest.
    """
    terms = [TERMS[name] for name in arm.model.terms]
    lacking = [term for term in terms if term.timing is not None or term.elastic]
    model = replace(arm.model, terms=outside(arm.model.terms, names_in(lacking)))
    loads, beside = model.compiled.of_load, model.compiled.beside_load
    M, n, X, r = loads.inertia, loads.rest, beside.inertia, beside.rest
    g = [
        {
            product: pairs
            for product, pairs in weighted.items()
            if not Expression({product: 1.0}).leaves.intersection(OMEGA)
        }
        for weighted in n
    ]
    constants = {name.upper(): arm.value[name] for name in model.names}
    for term in terms:
        constants |= {shape.upper(): getattr(model, shape) for shape in term.shapes}
    content: dict[str, Any] = {"lacking": lacking, "constants": constants, "atoms": {}}
    for name, held in {"M": M, "n": n, "r": r, "g": g, "X": X, "MX": (*M, *X)}.items():
        atoms = {atom for weighted in held for product in weighted for atom in product}
        content["atoms"][name] = [
            f"{one.name} = {one.source}" for one in sorted(atoms) if one.source
        ]
        content[name] = [_source(model, weighted) or "0.0" for weighted in held]
    for kind in ("gains", "by_load"):
        of_joint: list[list[str]] = [[], []]
        for place, joint in acting(model, kind):
            of_joint[joint].append(model.names[place].upper())
        content[kind] = of_joint
    return content


def _source(model: Model, weighted: Weighted) -> str:
    """An expression that is linear in the parameters, as text; none where it is nothing."""
    return text_of_sum(
        (factor, (model.names[place].upper(), *names_in(product)))
        for product, pairs in weighted.items()
        for place, factor in pairs
    )


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
    return _filled("controller.txt", filled)
