"""Limits and runs, out of a TOML file and flags over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from algid.arm import FloatArray
from algid.base.errors import SettingError
from algid.base.files import read_toml
from algid.base.limits import PLANNED
from algid.designs.limits import HANGING, Limits
from algid.options import flag

Positive = Annotated[float, Field(gt=0)]  # inf is no limit
Pair = Positive | tuple[Positive, Positive]
Span = tuple[float, float]
MOST_RUNS = 1000
Runs = Annotated[int, Field(ge=0, le=MOST_RUNS)]
FURTHEST = 2 * np.pi  # rad to either side: few joints turn further
SMALLEST, LARGEST = 1e-6, 1e6
"""What a limit in rad, rad/s, rad/s² or N m may be, but for 0 and inf."""


def _within(name: str) -> Any:
    """What a number of the file may be: as the option of that name."""
    low, high = PLANNED[name]
    return Field(ge=low, le=high, allow_inf_nan=False)


class LimitsFile(BaseModel):
    """What a TOML file may say: a number for both joints, or one for each."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    range: Positive | tuple[Positive, Positive] | tuple[Span, Span] | None = None
    speed: Pair | None = None
    acceleration: Pair | None = None
    torque: Pair | None = None
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
        if value is None:
            return default
        return value


def request(file: Path | None, flags: Mapping[str, str | float | None]) -> Request:
    """The file's limits with the flags over them.

    Raises
    ------
    SettingError
        If either is wrong; the flag is named, and the file's line beside it.
    """
    content: dict[str, Any] = {}
    source = "the flags"
    if file is not None:
        content = read_toml(file, LimitsFile).model_dump(exclude_none=True)
        source = str(file)
    for name, value in flags.items():
        if value is None:
            continue
        content[name] = value
        if isinstance(value, str):
            content[name] = _parsed(name, value)
        if content[name] is None:
            raise SettingError(f"{flag(name)}: expected {_LIKE[name]}, found {value!r}")
    return Request(content, source)


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
    limits = Limits(
        low=low,
        high=high,
        speed=_both(asked.get("speed", np.inf)),
        acceleration=_both(asked.get("acceleration", np.inf)),
        torque=_both(asked.get("torque", np.inf)),
        height=height,
        lengths=lengths,
    )
    every = np.stack([limits.half, limits.speed, limits.acceleration, limits.torque])
    if not np.any(np.isfinite(every)):
        raise SettingError(
            f"{flag('range')}: without any limit no motion is the best, found inf for all; give one"
        )
    return limits


def _check(name: str, value: Any) -> None:
    """Raises `SettingError` where a limit is neither inf nor such as an arm may have, in rad."""
    if value is None:
        return
    numbers = np.abs(np.array(value, dtype=np.float64)).ravel()
    wrong = ~(np.isinf(numbers) | (numbers == 0) | ((numbers >= SMALLEST) & (numbers <= LARGEST)))
    if np.any(wrong):
        raise SettingError(
            f"{flag(name)}: expected from {SMALLEST:g} to {LARGEST:g}, or inf, found "
            f"{numbers[wrong][0]:g}"
        )
    far = numbers[np.isfinite(numbers)].max(initial=0.0)
    if name == "range" and far > FURTHEST:
        raise SettingError(
            f"{flag(name)}: expected rad, found {far:g}, more than a turn: for {far:g}° give "
            f"{np.radians(far):.4g}; inf is no limit"
        )


def _both(value: Any) -> FloatArray:
    """A number for both joints, or one of each."""
    if not isinstance(value, tuple | list):
        value = (value, value)
    return np.array(value, dtype=np.float64)


def _range(value: Any) -> tuple[FloatArray, FloatArray]:
    ends = _both(value)
    if ends.ndim == 2:
        low, high = ends.T
    else:  # one number a joint is to both sides of hanging
        low, high = np.array(HANGING) - ends, np.array(HANGING) + ends
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
    "torque": "N m like 5 or 5,2",
    "runs": "numbers of runs without and with the payload like 2,1",
}


def _parsed(name: str, text: str) -> Any:
    """A number, a pair of them, or a pair of spans; None where the flag cannot mean that."""
    try:
        parts = [tuple(map(float, part.split(":"))) for part in text.split(",")]
        table = np.array(parts)
    except ValueError:  # no numbers, or not as many in each part
        return None
    if np.any(np.isnan(table)):
        return None
    if table.shape == (2, 2) and name == "range":
        return tuple(parts)
    if table.shape not in ((1, 1), (2, 1)):
        return None
    numbers = tuple(table[:, 0].tolist())
    if name == "runs":
        return _runs(numbers)
    if min(numbers) <= 0:
        return None
    if len(numbers) == 1:
        return numbers[0]
    return numbers


def _runs(numbers: Sequence[float]) -> tuple[int, int] | None:
    """Numbers of runs without and with the payload; None where these are none."""
    if len(numbers) != 2 or not any(numbers):
        return None
    for number in numbers:
        if not number.is_integer() or not 0 <= number <= MOST_RUNS:
            return None
    return int(numbers[0]), int(numbers[1])
