"""What the numbers that a verb takes may be: once for the command line and for Python."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from algid.errors import SettingError
from algid.limits import PHYSICAL, Range
from algid.settings import flag

LENGTH: Range = (1e-3, 1e3)
MASS: Range = (1e-6, 1e6)
NOISE: Range = (1e-12, PHYSICAL.noise[1])
SEED: Range = (0, 2**63)
LARGEST: Range = (0, 1e9)

RANGES: Mapping[str, Mapping[str, Range]] = {
    "batch": {"workers": (1, 4096), "timeout": (1e-3, 1e7)},
    "check": {"max_error": LARGEST},
    "design": {
        "tip_height": (-1e6, 1e3),
        "duration": (0.5, 120),
        "rate": (20, 1e5),
        "position_noise": NOISE,
        "torque_noise": NOISE,
        "prior_error": (0, 100),
        "payload": MASS,
        "l1": LENGTH,
        "l2": LENGTH,
        "margin": (0, 0.5),
        "seed": SEED,
    },
    "export": {"l1": LENGTH, "l2": LENGTH, "m1": MASS, "m2": MASS, "rotor1": (0, 1e6)},
    "synth": {
        "rate": PHYSICAL.rate,
        "duration": PHYSICAL.duration,
        "position_noise": PHYSICAL.noise,
        "torque_noise": PHYSICAL.noise,
        "encoder_bits": (4, 32),
        "jitter": PHYSICAL.noise,
        "drop": (0, 0.9),
        "seed": SEED,
    },
    "track": {"l1": LENGTH, "l2": LENGTH},
    "validate": {"max_nrmse": LARGEST},
}
"""By command and by the name of its setting, the least and the largest value."""


def ends(command: str, name: str) -> dict[str, Any]:
    """The range of a command's setting as its option takes it."""
    low, high = RANGES[command][name]
    return {"min": low, "max": high}


def check(command: str, **given: float | None) -> None:
    """Refuse numbers that a verb cannot take; None stands for what is not given.

    Raises
    ------
    SettingError
        If one is outside of its range.
    """
    for name, value in given.items():
        low, high = RANGES[command][name]
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value is None or (number and math.isfinite(value) and low <= value <= high):
            continue
        raise SettingError(
            f"{flag(name)}: expected a number from {low:g} to {high:g}, found {value!r:.60}"
        )
