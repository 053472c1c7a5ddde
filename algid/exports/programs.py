"""What a C99 file and a Python module hold of an arm: nothing but a mathematical library is needed.

Both are written out of the model's columns, in expressions that the two languages read alike:
inertia, what is left of the torque at zero acceleration, and how terms act on the torque. In them
q1, q2, w1, w2 are angles and velocities, s1 … c12 sines and cosines of θ1, θ2 and θ1 + θ2, t1 and
t2 tanh(ω / ω_s); parameters have their names in capitals.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

from algid.base.names import names_in, outside
from algid.exports.description import Description
from algid.model import TERMS, Model, Weighted, attributes
from algid.physics.expressions import Atom
from algid.physics.motion import Widths


def program(arm: Description) -> dict[str, Any]:
    """What the templates of programs are made of.

    M and n are inertia, by joint of torque and of acceleration, and rest of the columns that are
    the joints' load; X and r those of the others; g is what of n stays at rest.
    """
    lacking = [
        TERMS[name]
        for name in arm.model.terms
        if TERMS[name].timing is not None or TERMS[name].elastic
    ]
    model = replace(arm.model, terms=outside(arm.model.terms, names_in(lacking)))
    (M, n), (X, r) = model.compiled.of_load, model.compiled.beside_load
    g = [{p: pairs for p, pairs in weighted.items() if not _moves(p)} for weighted in n]
    held = {"gravity": g, "inertia": (*M, *X), "load": M, "rest": n, "friction": r}
    content: dict[str, Any] = {
        "lacking": lacking,
        "constants": _constants(model, arm.value),
        "atoms": {name: _definitions(expressions) for name, expressions in held.items()},
    }
    for name, expressions in {"M": M, "n": n, "r": r, "g": g}.items():
        content[name] = [_source(model, weighted) or "0.0" for weighted in expressions]
    content["X"] = [_source(model, weighted) for weighted in X]
    for kind in ("gains", "by_load"):
        names = attributes(model, kind)
        content[kind] = [[one.upper() for one, of in names if of == joint] for joint in (0, 1)]
    return content


def _constants(model: Model, value: Mapping[str, float]) -> dict[str, float]:
    """Constants of the module by their names."""
    constants = {name.upper(): value[name] for name in model.names}
    shapes = {shape for term in model.terms for shape in TERMS[term].shapes}
    for width in fields(Widths):
        if width.name in shapes:
            constants[width.name.upper()] = getattr(model, width.name)
    return constants


def _source(model: Model, weighted: Weighted) -> str:
    """An expression that is linear in the parameters, as text; none where it is nothing."""
    text = ""
    for product, pairs in weighted.items():
        for place, factor in pairs:
            sign = "-" if factor < 0 else "+"
            text += f" {sign} " if text else sign.removeprefix("+")
            factors = [model.names[place].upper(), *(atom.name for atom in product)]
            if abs(factor) != 1:
                factors.insert(0, f"{abs(factor):g}")
            text += " * ".join(factors)
    return text


def _definitions(expressions: Iterable[Weighted]) -> list[str]:
    """What the expressions hold, each as `name = source`, the arguments' elements first."""
    atoms = {atom for weighted in expressions for product in weighted for atom in product}
    ordered: list[Atom] = sorted(atoms)
    defined = [f"{atom.name} = {atom.source}" for atom in ordered if atom.source]
    named = " ".join([*(atom.name for atom in ordered), *defined])
    states = [
        f"{letter}{number} = {name}[{number - 1}]"
        for letter, name in (("q", "theta"), ("w", "omega"))
        for number in (1, 2)
        if re.search(rf"\b{letter}{number}\b", named)
    ]
    return states + defined


def _moves(product: Iterable[Atom]) -> bool:
    """Whether a product has a velocity in it."""
    return any("omega" in name for atom in product for name in atom.slopes())
