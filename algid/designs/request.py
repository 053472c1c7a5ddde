"""Limits and runs, out of a TOML file and flags over it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from algid.arm import FloatArray
from algid.designs.limits import HANGING, Limits
from algid.errors import SettingError
from algid.files import read_toml
from algid.options import flag, range_of

Positive = Annotated[float, Field(gt=0)]  # inf is no limit
NonNegative = Annotated[float, Field(ge=0)]  # nothing is a joint without a drive
Pair = Positive | tuple[Positive, Positive]
Span = tuple[float, float]
MOST_RUNS = 1000
Runs = Annotated[int, Field(ge=0, le=MOST_RUNS)]
SMALLEST, LARGEST = 1e-6, 1e6
"""What a limit in rad, rad/s, rad/s² or N m may be, but for 0 and inf."""


def _within(name: str) -> Any:
    """What a number of the file may be: as the option of that name."""
    low, high = range_of("design", name)
    return Field(ge=low, le=high, allow_inf_nan=False)


class LimitsFile(BaseModel):
    """What a TOML file may say: a number for both joints, or one for each."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    range: Positive | tuple[Positive, Positive] | tuple[Span, Span] | None = None
    speed: Pair | None = None
    acceleration: Pair | None = None
    torque: NonNegative | tuple[NonNegative, NonNegative] | None = None
    tip_height: float | None = None
    duration: Annotated[float, _within("duration")] | None = None
    rate: Annotated[float, _within("rate")] | None = None
    runs: tuple[Runs, Runs] | None = None


@dataclass(frozen=True)
class Request:
    """What a campaign is asked to keep to, flags and file put together."""

    content: Mapping[str, Any]
    source: str

    def get(self, name: str, default: Any) -> Any:
        """What is asked of `name`."""
        value = self.content.get(name)
        return default if value is None else value


def request(file: Path | None, flags: Mapping[str, str | float | None]) -> Request:
    """The file's limits with the flags over them.

    Raises
    ------
    SettingError
        If either is wrong; the flag is named, and the file's line beside it.
    """
    content = {} if file is None else read_toml(file, LimitsFile).model_dump(exclude_none=True)
    for name, value in flags.items():
        if value is None:
            continue
        content[name] = _parsed(name, value) if isinstance(value, str) else value
        if content[name] is None:
            raise SettingError(f"{flag(name)}: expected {_LIKE[name]}, found {value!r}")
    return Request(content, "the flags" if file is None else str(file))


def limits_of(asked: Request, lengths: FloatArray) -> Limits:
    """The limits of a request for an arm of these link lengths (2,).

    Raises
    ------
    SettingError
        If a limit that must be given is not, or makes no sense.
    """
    for name in ("range", "speed", "torque"):
        if name not in asked.content:
            raise SettingError(
                f"{flag(name)}: it must be given, or `{name} = …` in the file of {flag('limits')}; "
                "inf is no limit at all"
            )
    for name in ("range", "speed", "acceleration", "torque"):
        _check(name, asked.content.get(name))
    low, high = _range(asked.content["range"])
    height = float(asked.get("tip_height", -np.inf))
    if np.isfinite(height) and not np.all(np.isfinite(lengths)):
        raise SettingError(
            f"{flag('tip_height')}: the link lengths are not known; give {flag('l1')} and "
            f"{flag('l2')}"
        )
    reach = float(np.sum(lengths))
    if height >= reach:
        raise SettingError(
            f"{flag('tip_height')}: expected less than the arm's reach, {reach:.4g} m, found "
            f"{height:g} m"
        )
    others = {name: _both(asked.get(name, np.inf)) for name in ("speed", "acceleration", "torque")}
    if not others["torque"].any():
        raise SettingError(
            f"{flag('torque')}: expected a drive at one joint at least, found 0 for both"
        )
    if not np.any(np.isfinite([high - low, *others.values()])):
        raise SettingError(
            f"{flag('range')}: without any limit no motion is the best, found inf for all; give one"
        )
    return Limits(low=low, high=high, height=height, lengths=lengths, **others)


def _check(name: str, value: Any) -> None:
    """Raises `SettingError` where a limit is neither inf nor such as an arm may have."""
    numbers = np.abs(np.array(0.0 if value is None else value, dtype=np.float64)).ravel()
    wrong = ~(np.isinf(numbers) | (numbers == 0) | ((numbers >= SMALLEST) & (numbers <= LARGEST)))
    if np.any(wrong):
        raise SettingError(
            f"{flag(name)}: expected from {SMALLEST:g} to {LARGEST:g}, or inf, found "
            f"{numbers[wrong][0]:g}"
        )


def _both(value: Any) -> FloatArray:
    return np.array(value if isinstance(value, tuple | list) else (value, value), dtype=np.float64)


def _range(value: Any) -> tuple[FloatArray, FloatArray]:
    ends = _both(value)
    # one number a joint is to both sides of hanging
    low, high = ends.T if ends.ndim == 2 else (np.array(HANGING) - ends, np.array(HANGING) + ends)
    for joint in range(2):
        if not low[joint] < high[joint]:
            raise SettingError(
                f"{flag('range')}: expected LOW:HIGH with LOW below HIGH for joint {joint + 1}, "
                f"found {low[joint]:g}:{high[joint]:g}"
            )
        if np.isfinite(low[joint]) != np.isfinite(high[joint]):
            raise SettingError(
                f"{flag('range')}: expected both ends of joint {joint + 1} or neither, found "
                f"{low[joint]:g}:{high[joint]:g}; give a wide one in place of inf"
            )
    return low, high


_LIKE = {
    "range": "rad like 1.2 (to both sides of hanging), 1.2,1.0, or -2.7:-0.4,-1.2:1.2",
    "speed": "rad/s like 3 or 3,4",
    "acceleration": "rad/s² like 30 or 30,60",
    "torque": "N m like 5 or 5,2; 0 is a joint without a drive",
    "runs": "numbers of runs without and with the payload like 2,1",
}


def _parsed(name: str, text: str) -> Any:
    """A number, a pair of them, or a pair of spans; None where the flag cannot mean that."""
    try:
        parts = [tuple(float(number) for number in part.split(":")) for part in text.split(",")]
    except ValueError:
        return None
    numbers = [part[0] for part in parts]
    if [len(part) for part in parts] == [2, 2]:
        spans = name == "range" and not any(math.isnan(number) for part in parts for number in part)
        return tuple(parts) if spans else None
    if (
        len(parts) > 2
        or any(len(part) != 1 for part in parts)
        or any(math.isnan(number) for number in numbers)
    ):
        return None
    if name == "runs":
        whole = len(numbers) == 2 and all(
            0 <= number <= MOST_RUNS and number.is_integer() for number in numbers
        )
        return (int(numbers[0]), int(numbers[1])) if whole and any(numbers) else None
    if not all(number > 0 or (number == 0 and name == "torque") for number in numbers):
        return None
    return numbers[0] if len(numbers) == 1 else tuple(numbers)
