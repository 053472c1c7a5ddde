"""Atoms say which widths of friction their values depend on."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from algid.physics.signals import WIDTHS, Atom, Motion, Values, Widths
from algid.physics.terms import ALWAYS, OPTIONAL


def atoms() -> list[Atom]:
    vectors = (
        vector
        for term in (*ALWAYS, *OPTIONAL)
        for column in term.columns
        for vector in (column.s, column.p, column.f)
    )
    entries = (entry for vector in vectors for entry in vector)
    found = {atom for entry in entries for product in entry.products for atom in product}
    return sorted(found)


@pytest.mark.parametrize("width", [one.name for one in fields(Widths)])
def test_an_atom_names_the_widths_that_change_it(width: str) -> None:
    """Moments are kept by these names: one left out would be taken at another width."""
    rng = np.random.default_rng(0)
    motion = Motion(*rng.standard_normal((3, 2, 50)))
    narrow = Widths()
    wide = replace(narrow, **{width: 2 * getattr(narrow, width)})
    assert any(WIDTHS[width] in atom.leaves for atom in atoms())
    for atom in atoms():
        one, other = (Values(motion, widths).of((atom,)) for widths in (narrow, wide))
        assert np.array_equal(one, other) != (WIDTHS[width] in atom.leaves), atom.name
