"""What a C99 file and a Python module hold of an arm: nothing but a mathematical library is needed.

Both are written out of the model's columns, in expressions that the two languages read alike:
inertia, what is left of the torque at zero acceleration, and how terms act on the torque. In them
q1, q2, w1, w2 are angles and velocities, s1 … c12 sines and cosines of θ1, θ2 and θ1 + θ2, t1 and
t2 tanh(ω / ω_s); parameters have their names in capitals.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from algid.base.names import names_in, outside
from algid.exports.description import Description
from algid.model import TERMS, Model, Weighted, attributes
from algid.physics.expressions import Atom
from algid.physics.motion import Widths

_FUNCTIONS = ("cos", "exp", "sin", "tanh")


def program(arm: Description) -> dict[str, Any]:
    """What the templates of programs are made of."""
    lacking = [
        TERMS[name]
        for name in arm.coefficients.model.terms
        if TERMS[name].timing is not None or TERMS[name].elastic
    ]
    held_terms = outside(arm.coefficients.model.terms, names_in(lacking))
    model = replace(arm.coefficients.model, terms=held_terms)
    compiled, loads = model.compiled, list(model.compiled.loads)
    others = sorted(set(range(len(compiled.names))) - set(loads))

    def inertia(places: list[int]) -> list[list[Weighted]]:
        """What multiplies the accelerations, of the columns at `places`."""
        entries = compiled.inertia
        return [[compiled.only(entries[i, j], places) for j in (0, 1)] for i in (0, 1)]

    def rest(places: list[int]) -> list[Weighted]:
        """The torque at zero acceleration, of the columns at `places`."""
        return [compiled.only(weighted, places) for weighted in compiled.rest]

    M, X, n, r = inertia(loads), inertia(others), rest(loads), rest(others)
    g = [{p: pairs for p, pairs in weighted.items() if not _moves(p)} for weighted in n]
    held: dict[str, Sequence[Weighted]] = {
        "gravity": g,
        "inertia": [*M[0], *M[1], *X[0], *X[1]],
        "load": [*M[0], *M[1]],
        "rest": n,
        "friction": r,
    }
    atoms = {name: _definitions(expressions) for name, expressions in held.items()}
    of_joint = {
        kind: [[name.upper() for name, one in attributes(model, kind) if one == j] for j in (0, 1)]
        for kind in ("gains", "by_load")
    }
    share = [
        " + ".join(f"{name} * tanh(omega[{j}] / COULOMB_SPEED)" for name in names) or "0.0"
        for j, names in enumerate(of_joint["by_load"])
    ]
    extra = [[_source(model, weighted, "") for weighted in row] for row in X]
    body = " ".join([*(line for lines in atoms.values() for line in lines), *share])
    return {
        "lacking": lacking,
        "jump": False,
        "negative": (),
        "rotor_within": False,
        "constants": _constants(model, arm.coefficients.value),
        "functions": [name for name in _FUNCTIONS if re.search(rf"\b{name}\(", body)],
        "atoms": atoms,
        "M": [[_source(model, weighted) for weighted in row] for row in M],
        "X": [[f" + {text}" if text else "" for text in row] for row in extra],
        "n": [_source(model, weighted) for weighted in n],
        "r": [_source(model, weighted) for weighted in r],
        "g": [_source(model, weighted) for weighted in g],
        "extra": [
            "".join(f" + ({text}) * alpha[{j}]" for j, text in enumerate(row) if text)
            for row in extra
        ],
        "gain": ["".join(f"(1 + {name}) * " for name in names) for names in of_joint["gains"]],
        "ungain": ["".join(f" / (1 + {name})" for name in names) for names in of_joint["gains"]],
        "share": share,
        "by_load": any(of_joint["by_load"]),
    }


def _constants(model: Model, value: Mapping[str, float]) -> dict[str, float]:
    """Constants of the module by their names."""
    constants = {name.upper(): value[name] for name in model.names}
    shapes = {shape for term in model.terms for shape in TERMS[term].shapes}
    for width in fields(Widths):
        if width.name in shapes:
            constants[width.name.upper()] = getattr(model, width.name)
    return constants


def _source(model: Model, weighted: Weighted, nothing: str = "0.0") -> str:
    """An expression that is linear in the parameters, as text."""
    text = ""
    for product, pairs in weighted.items():
        for place, factor in pairs:
            sign = "-" if factor < 0 else "+"
            text += f" {sign} " if text else sign.removeprefix("+")
            factors = [model.names[place].upper(), *(atom.name for atom in product)]
            if abs(factor) != 1:
                factors.insert(0, f"{abs(factor):g}")
            text += " * ".join(factors)
    return text or nothing


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
