"""Atoms say which widths of friction their values depend on."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from algid.physics.expressions import Atom
from algid.physics.motion import Motion, Widths
from algid.physics.terms import ALWAYS, OPTIONAL


def atoms() -> list[Atom]:
    vectors = (
        vector
        for term in (*ALWAYS, *OPTIONAL)
        for column in term.columns
        for vector in (column.s, column.p, column.f)
    )
    found = {atom for vector in vectors for entry in vector for atom in entry.atoms}
    return sorted(found)


@pytest.mark.parametrize("width", [one.name for one in fields(Widths)])
def test_an_atom_names_the_widths_that_change_it(width: str) -> None:
    """Moments are kept by these names: one left out would be taken at another width."""
    rng = np.random.default_rng(0)
    motion = Motion(*rng.standard_normal((3, 2, 50)))
    narrow = Widths()
    wide = replace(narrow, **{width: 2 * getattr(narrow, width)})
    assert any(width in atom.shapes for atom in atoms())
    for atom in atoms():
        changed = not np.array_equal(atom.value(motion, narrow), atom.value(motion, wide))
        assert changed == (width in atom.shapes), atom.name
