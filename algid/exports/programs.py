"""What a C99 file and a Python module hold of an arm: nothing but a mathematical library is needed.

Both are written out of the model's columns, in expressions that the two languages read alike:
inertia, what is left of the torque at zero acceleration, and how terms act on the torque. In them
q1, q2, w1, w2 are angles and velocities, s1 … c12 sines and cosines of θ1, θ2 and θ1 + θ2, t1 and
t2 tanh(ω / ω_s); parameters have their names in capitals.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from algid.base.names import names_in, outside
from algid.exports.description import Description
from algid.model import TERMS, Model, Weighted, attributes


def program(arm: Description) -> dict[str, Any]:
    """What the templates of programs are made of.

    M and n are inertia, by joint of torque and of acceleration, and rest of the columns that are
    the joints' load; X and r those of the others; g is what of n stays at rest.
    """
    terms = [TERMS[name] for name in arm.model.terms]
    lacking = [term for term in terms if term.timing is not None or term.elastic]
    model = replace(arm.model, terms=outside(arm.model.terms, names_in(lacking)))
    (M, n), (X, r) = model.compiled.of_load, model.compiled.beside_load
    g = [
        {
            product: pairs
            for product, pairs in weighted.items()
            if not any("omega" in name for atom in product for name in atom.slopes())
        }
        for weighted in n
    ]
    constants = {name.upper(): arm.value[name] for name in model.names}
    for term in terms:
        constants |= {shape.upper(): getattr(model, shape) for shape in term.shapes}
    content: dict[str, Any] = {"lacking": lacking, "constants": constants, "atoms": {}}
    for name, held in {
        "gravity": g,
        "inertia": (*M, *X),
        "load": M,
        "rest": n,
        "friction": r,
    }.items():
        atoms = {atom for weighted in held for product in weighted for atom in product}
        content["atoms"][name] = [
            f"{one.name} = {one.source}" for one in sorted(atoms) if one.source
        ]
    for name, held in {"M": M, "n": n, "r": r, "g": g}.items():
        content[name] = [_source(model, weighted) or "0.0" for weighted in held]
    content["X"] = [_source(model, weighted) for weighted in X]
    for kind in ("gains", "by_load"):
        names = attributes(model, kind)
        content[kind] = [[one.upper() for one, of in names if of == joint] for joint in (0, 1)]
    return content


def _source(model: Model, weighted: Weighted) -> str:
    """An expression that is linear in the parameters, as text; none where it is nothing."""
    return " + ".join(
        " * ".join(
            [
                *([] if factor == 1 else [f"{factor:g}"]),
                model.names[place].upper(),
                *(atom.name for atom in product),
            ]
        )
        for product, pairs in weighted.items()
        for place, factor in pairs
    )
