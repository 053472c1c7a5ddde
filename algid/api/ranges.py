"""What the numbers that a verb takes may be: once for the command line and for Python."""

from __future__ import annotations

import math
from typing import Any

from algid.errors import SettingError
from algid.options import flag, range_of


def ends(command: str, name: str) -> dict[str, Any]:
    """The range of a command's setting as its option takes it."""
    low, high = range_of(command, name)
    return {"min": low, "max": high}


def check(command: str, **given: float | None) -> None:
    """Refuse numbers that a verb cannot take; None stands for what is not given.

    Raises
    ------
    SettingError
        If one is outside of its range.
    """
    for name, value in given.items():
        low, high = range_of(command, name)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value is None or (number and math.isfinite(value) and low <= value <= high):
            continue
        raise SettingError(
            f"{flag(name)}: expected a number from {low:g} to {high:g}, found {value!r:.60}"
        )
