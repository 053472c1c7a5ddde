"""Every dependency at the lowest version that pyproject.toml allows, as constraints for pip.

Tools of development, and what dependencies need themselves, are no newer than in constraints.txt:
as new as the dependencies let them be.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
USED = ("dask", "hdf5")
"""Extras that algid itself imports."""


def lower_bounds(project: str, constraints: str) -> list[str]:
    """Constraints out of the texts of pyproject.toml and constraints.txt.

    Raises
    ------
    ValueError
        If a dependency has no bound ``>=``.
    """
    table = tomllib.loads(project)["project"]
    texts = [
        *table["dependencies"],
        *(text for name in USED for text in table["optional-dependencies"][name]),
    ]
    bounds = {}
    for one in map(Requirement, texts):
        lowest = [bound.version for bound in one.specifier if bound.operator == ">="]
        if not lowest:
            raise ValueError(
                f"{one.name}: expected a lower bound like {one.name}>=1.0, found {one}"
            )
        bounds[canonicalize_name(one.name)] = lowest[0]
    others = (
        line
        for line in constraints.splitlines()
        if canonicalize_name(line.partition("==")[0]) not in bounds
    )
    return [
        *(f"{name}=={version}" for name, version in bounds.items()),
        *(line.replace("==", "<=") for line in others),
    ]


if __name__ == "__main__":
    texts = (
        (ROOT / name).read_text(encoding="utf-8") for name in ("pyproject.toml", "constraints.txt")
    )
    print("\n".join(lower_bounds(*texts)))
