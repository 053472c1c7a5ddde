"""A result as a model that simulators, controllers and planners load: one template a format."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any


@cache
def template(path: Path) -> Any:
    """A template of plain text; what it is filled with is our own, or was cleaned before."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(path.parent),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "cell": lambda text: text.replace("|", "\\|"),
        "n": numbers,
        "repr": repr,
    }
    return environment.get_template(path.name)


def numbers(values: float | tuple[float, ...] | None) -> str:
    """Numbers that read back as they are; null for what is not known."""
    if values is None:
        return "null"
    each = values if isinstance(values, tuple) else (values,)
    return " ".join(repr(float(value) + 0.0) for value in each)  # + 0.0: no -0.0
