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
from algid.design.limits import Limits
from algid.design.posture import HANGING
from algid.errors import SettingError
from algid.files import read_toml

Positive = Annotated[float, Field(gt=0)]  # inf is no limit
Pair = Positive | tuple[Positive, Positive]
Span = tuple[float, float]


class LimitsFile(BaseModel):
    """What a TOML file may say: a number for both joints, or one for each."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    range: Positive | tuple[Positive, Positive] | tuple[Span, Span] | None = None
    speed: Pair | None = None
    acceleration: Pair | None = None
    torque: (
        Annotated[float, Field(ge=0)] | tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)]] | None
    ) = None
    tip_height: float | None = None
    duration: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    runs: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]] | None = None


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
        if value is not None:
            content[name] = _parsed(name, value)
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
                f"--{name}: it must be given, or `{name} = …` in the file of --limits; inf is no limit at all"
            )
    low, high = _range(asked.content["range"])
    height = float(asked.get("tip_height", -np.inf))
    if np.isfinite(height) and not np.all(np.isfinite(lengths)):
        raise SettingError("--tip-height: the link lengths are not known; give --l1 and --l2")
    reach = float(np.sum(lengths))
    if height >= reach:
        raise SettingError(f"--tip-height: expected less than the arm's reach, {reach:.4g} m, found {height:g} m")
    return Limits(
        low=low,
        high=high,
        speed=_both(asked.content["speed"]),
        acceleration=_both(asked.get("acceleration", np.inf)),
        torque=_both(asked.content["torque"]),
        height=height,
        lengths=lengths,
    )


def _both(value: Any) -> FloatArray:
    return np.array(value if isinstance(value, tuple | list) else (value, value), dtype=np.float64)


def _range(value: Any) -> tuple[FloatArray, FloatArray]:
    pair = value if isinstance(value, tuple | list) else (value, value)
    if isinstance(pair[0], tuple | list):
        low, high = np.array(pair, dtype=np.float64).T
    else:
        half, home = (
            np.array(pair, dtype=np.float64),
            np.array(HANGING),
        )  # what a range of one number a joint is to both sides of
        low, high = home - half, home + half
    for joint in range(2):
        if not low[joint] < high[joint]:
            raise SettingError(
                f"--range: expected LOW:HIGH with LOW below HIGH for joint {joint + 1}, found "
                f"{low[joint]:g}:{high[joint]:g}"
            )
    return low, high


_LIKE = {
    "range": "rad like 1.2 (to both sides of hanging), 1.2,1.0, or -2.7:-0.4,-1.2:1.2",
    "speed": "rad/s like 3 or 3,4",
    "acceleration": "rad/s² like 30 or 30,60",
    "torque": "N m like 5 or 5,2; 0 is a joint without a drive",
    "runs": "numbers of runs without and with the payload like 2,1",
}


def _parsed(name: str, value: str | float) -> Any:
    if not isinstance(value, str):
        return value
    flag = f"--{name.replace('_', '-')}"
    try:
        found = _numbers(value)
        if name == "runs":
            return _runs(found)
        least_fits = name == "torque"
        for number in found:
            if not isinstance(number, tuple) and not (number > 0 or (least_fits and number == 0)):
                raise ValueError
        if any(isinstance(number, tuple) for number in found) and (name != "range" or len(found) != 2):
            raise ValueError
    except ValueError:
        raise SettingError(f"{flag}: expected {_LIKE[name]}, found {value!r}") from None
    return found[0] if len(found) == 1 else found


def _numbers(text: str) -> tuple[Any, ...]:
    """One or two numbers, or spans LOW:HIGH, between commas."""
    parts = [part.split(":") for part in text.split(",")]
    if len(parts) > 2 or len({len(part) for part in parts}) != 1 or len(parts[0]) > 2:
        raise ValueError
    numbers = [tuple(float(number) for number in part) for part in parts]
    if any(math.isnan(number) for part in numbers for number in part):
        raise ValueError
    return tuple(part if len(part) == 2 else part[0] for part in numbers)


def _runs(found: tuple[Any, ...]) -> tuple[int, int]:
    if len(found) != 2 or any(isinstance(n, tuple) or n < 0 or n != int(n) for n in found) or not any(found):
        raise ValueError
    return int(found[0]), int(found[1])
