"""What a motion must keep within, from a TOML file, text or keywords, and what it uses of it.

A usage is what is used of a limit, one where it is reached: the angle's distance from the middle
of its range over half the range, speed, acceleration and torque over their limits, and the depth
of the tip below the height of a stretched arm over what is allowed of it. A posture that the arm
can be held in within all of them is where a motion rests; without one there is no motion either.

======  ============================================  =========
symbol  name                                          shape
======  ============================================  =========
u       usages, a row a limit and side                (m, N)
τ̂       largest torque of any arm of the belief       (2, N)
======  ============================================  =========
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError, ValidationInfo
from pydantic_core import PydanticCustomError

from algid.arm import FloatArray
from algid.base.errors import SettingError
from algid.base.files import misfit, toml_content
from algid.base.limits import PLANNED, within
from algid.designs.belief import Load
from algid.designs.information import COMPONENTS, Sensitivities
from algid.model import Model, Motion
from algid.options import flag

HANGING = (-np.pi / 2, 0.0)
_STEPS = 41  # postures of each joint that are tried
_WIDE = np.pi  # rad to either side, where a range is not limited
_EASY = 0.7  # usage up to which the middle of the range will do
RATE, DURATION = 1000.0, 10.0  # Hz and s
MOST_RUNS = 1000
FURTHEST = 2 * np.pi  # rad to either side: few joints turn further
SMALLEST, LARGEST = 1e-6, 1e6
"""What a limit in rad, rad/s, rad/s² or N m may be, but for 0 and inf."""
EXAMPLES = {
    "range": "rad like 1.2 (to both sides of hanging), 1.2,1.0, or LOW:HIGH of each joint like "
    "-2.7:-0.4,-1.2:1.2",
    "speed": "rad/s like 3 or 3,4",
    "acceleration": "rad/s² like 30 or 30,60",
    "torque": "N m like 5 or 5,2",
    "runs": "numbers of runs without and with the payload like 2,1",
}


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a motion, each (2,) a joint; infinite where there is none.

    Parameters
    ----------
    middle : (2,), rad
        Of the range; hanging where there is none.
    allowed : by name, how far it may go to either side
        Range from its middle in rad, speed in rad/s, acceleration in rad/s², torque in N m.
    height : float, m
        Lowest height of the tip over joint 1; minus infinity where there is none.
    lengths : (2,), m
        Of the links; NaN where they are not known.
    """

    middle: FloatArray
    allowed: Mapping[str, FloatArray]
    height: float
    lengths: FloatArray

    @property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest angles (2,)."""
        return self.middle - self.allowed["range"], self.middle + self.allowed["range"]

    def within(self, margin: float) -> Limits:
        """These limits less a share `margin` of each."""
        height = self.height
        if np.isfinite(height):
            height += margin * (self.lengths.sum() - height)
        allowed = {name: (1 - margin) * limit for name, limit in self.allowed.items()}
        return replace(self, allowed=allowed, height=height)


def _pair(value: Any, info: ValidationInfo) -> FloatArray:
    """Numbers (2,) of both joints or both kinds of run; of a range its ends (2, 2) by joint.

    One number stands for both joints, and of a range for both sides of hanging.

    Raises
    ------
    PydanticCustomError
        If it can be no such limit.
    """
    name = str(info.field_name)
    if isinstance(value, str):
        value = [part.split(":") for part in value.split(",")]
    try:
        table = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):  # no numbers, or not as many in each part
        table = np.full(1, np.nan)
    if table.shape[-1:] == (1,):
        table = table[..., 0]
    spans = name == "range" and table.shape == (2, 2)
    ends = table if spans else np.stack([-table, table], axis=-1)
    like = EXAMPLES[name]
    if name == "runs":
        whole = (table == np.rint(table)) & (table >= 0) & (table <= MOST_RUNS)
        right = bool(table.shape == (2,) and table.any() and np.all(whole))
    else:
        sizes = np.abs(table[np.isfinite(table) & (table != 0)])
        most = FURTHEST if name == "range" else LARGEST
        right = bool(
            ends.shape in ((2,), (1, 2), (2, 2))
            and np.all(ends[..., 0] < ends[..., 1])
            and np.all((sizes >= SMALLEST) & (sizes <= most))
            and not np.any(np.diff(np.isfinite(ends)))
        )
        like = f"{like}; from {SMALLEST:g} to {most:.4g}, or inf"
    if not right:
        raise PydanticCustomError("limit", "expected {like}", {"like": like})
    if name != "range":
        return np.broadcast_to(table, 2)
    return ends if spans else np.array(HANGING)[:, None] + ends


Pair = Annotated[FloatArray, PlainValidator(_pair)]
UNLIMITED = np.full(2, np.inf)


class Request(BaseModel):
    """What a campaign is asked to keep to; inf is no limit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    range: Pair
    speed: Pair
    torque: Pair
    acceleration: Pair = UNLIMITED
    tip_height: float = -np.inf
    duration: float = within(PLANNED["duration"], DURATION)
    rate: float = within(PLANNED["rate"], RATE)
    runs: Pair | None = None


def request(file: Path | None, given: Mapping[str, Any]) -> Request:
    """What the file asks for, and over it what is given; None leaves it to the file.

    Raises
    ------
    SettingError
        If either is wrong; it names the option or the file's line.
    """
    content = {} if file is None else toml_content(file)
    own = {name: value for name, value in given.items() if value is not None}
    try:
        return Request.model_validate(content | own)
    except ValidationError as error:
        place, said = misfit(error)
        name = place.partition(".")[0]
        if error.errors()[0]["type"] == "missing":
            said = (
                f"it must be given, or `{name} = …` in the file of {flag('limits')}; inf is no "
                "limit at all"
            )
        elif name not in own:
            raise SettingError(f"{file}: {place}: {said}") from error
        raise SettingError(f"{flag(name)}: {said}") from error


def limits_of(asked: Request, lengths: FloatArray) -> Limits:
    """The limits of a request for an arm of these link lengths (2,).

    Raises
    ------
    SettingError
        If the height of the tip cannot be kept to, or nothing is limited.
    """
    height, reach = asked.tip_height, float(np.sum(lengths))
    if np.isfinite(height) and not np.isfinite(reach):
        raise SettingError(
            f"{flag('tip_height')}: the link lengths are not known; give {flag('l1')} and "
            f"{flag('l2')}"
        )
    if height >= reach:
        raise SettingError(
            f"{flag('tip_height')}: expected less than the arm's reach, {reach:.4g} m, found "
            f"{height:g} m"
        )
    low, high = asked.range.T
    allowed = {"range": 0.5 * (high - low), "speed": asked.speed}
    allowed |= {"acceleration": asked.acceleration, "torque": asked.torque}
    middle, bounded = np.array(HANGING), np.isfinite(high)
    middle[bounded] = 0.5 * (low[bounded] + high[bounded])
    if not np.any(np.isfinite([*allowed.values()])):
        raise SettingError(
            f"{flag('range')}: without any limit no motion is the best, found inf for all; give one"
        )
    return Limits(middle, allowed, height, lengths)


@dataclass(frozen=True)
class Row:
    """A limit and its side: flag, joint, and for torque whether loaded.

    `allowed` is the limit in its unit and with its sign, of which nothing is used at `still`.
    """

    limit: str
    joint: int | None
    allowed: float
    still: float = 0.0
    loaded: bool | None = None

    def reached(self, used: float) -> float:
        """What the motion reaches where it uses that share, in the limit's unit."""
        return self.still + used * (self.allowed - self.still)

    @property
    def kind(self) -> str:
        """What the limit is of, in words."""
        load = {None: "", True: ", loaded", False: ", unloaded"}[self.loaded]
        return f"{self.limit.replace('-', ' ')}{load}"

    @property
    def place(self) -> str:
        """Where it is: a joint, and which way."""
        if self.joint is None:
            return ""
        return f"joint {self.joint + 1}, {'up' if self.allowed > self.still else 'down'}"

    def __str__(self) -> str:
        return f"{self.kind} of {self.place}" if self.place else self.kind


@dataclass(frozen=True, eq=False)
class Usage:
    """Constraint use u (m, N) along a motion, its rows, and derivatives (m, 6, N) by the motion.

    The derivatives of torques are zero where they were not asked for.
    """

    rows: tuple[Row, ...]
    u: FloatArray
    by_motion: FloatArray

    @property
    def most(self) -> FloatArray:
        """Largest usage (m,) of each row."""
        return self.u.max(axis=1)


def usage(
    limits: Limits, slopes: Sensitivities, loads: Sequence[Load], derivatives: bool = True
) -> Usage:
    """Use of each limit by the motion of `slopes`, for every arm of the belief behind `loads`.

    Parameters
    ----------
    limits : Limits
        Those that are infinite have no row.
    slopes : Sensitivities
        Of the motion, at N instants.
    loads : sequence of Load
    derivatives : bool
        Whether the torques' derivatives by the motion are asked for too.
    """
    motion, uses = slopes.motion, []
    theta, nothing = motion.theta, np.zeros((COMPONENTS, motion.theta.shape[1]))
    of_component = np.eye(COMPONENTS)[:, :, None]
    for order, (name, values) in enumerate(
        (("range", theta), ("speed", motion.omega), ("acceleration", motion.alpha))
    ):
        for joint, sign, limit in _sides(limits.allowed[name]):
            still = float(limits.middle[joint]) if name == "range" else 0.0
            row = Row(name, joint, still + sign * limit, still)
            slope = nothing + sign / limit * of_component[2 * order + joint]
            uses.append((row, sign * (values[joint] - still) / limit, slope))
    if np.isfinite(limits.height):
        (l1, l2), both = limits.lengths, theta[0] + theta[1]
        room, height = l1 + l2 - limits.height, l1 * np.sin(theta[0]) + l2 * np.sin(both)
        second = l2 * np.cos(both)
        slope = np.stack([l1 * np.cos(theta[0]) + second, second, *nothing[2:]]) / -room
        row = Row("tip-height", None, limits.height, float(l1 + l2))
        uses.append((row, (l1 + l2 - height) / room, slope))
    for load in loads:
        torque, more, by_Y = load.largest(slopes.Y)
        for joint, sign, limit in _sides(limits.allowed["torque"]):
            slope = nothing
            if derivatives:
                to_Y = (sign * load.c[:, None] + by_Y[joint]) / limit
                slope = np.einsum("qn,cqn->cn", to_Y, slopes.dY[:, joint])
            row = Row("torque", joint, sign * limit, loaded=load.loaded)
            uses.append((row, (sign * torque[joint] + more[joint]) / limit, slope))
    rows, used, by_motion = zip(*uses, strict=True)
    return Usage(rows, np.array(used), np.array(by_motion))


def _sides(limit: FloatArray) -> Iterator[tuple[int, float, float]]:
    """Joint, sign and size of each side that is limited."""
    for joint in np.flatnonzero(np.isfinite(limit)).tolist():
        for sign in (1.0, -1.0):
            yield joint, sign, float(limit[joint])


def resting(limits: Limits, model: Model, loads: Sequence[Load]) -> FloatArray:
    """A posture (2,) that keeps the limits: the middle of the range, or the one of least use.

    Raises
    ------
    SettingError
        If there is none; it names the limit, and by how much it is missed.
    """
    half = limits.allowed["range"]
    reach = np.where(np.isfinite(half), half, _WIDE)
    angles = np.linspace(limits.middle - reach, limits.middle + reach, _STEPS, axis=1)
    theta = np.stack(np.meshgrid(*angles, indexing="ij")).reshape(2, -1)
    still = Motion(theta, np.zeros_like(theta), np.zeros_like(theta))
    used = usage(limits, Sensitivities(model, still, 1.0), loads, derivatives=False)
    most = used.u.max(axis=0)
    central, best = theta.shape[1] // 2, int(np.argmin(most))
    if most[central] <= _EASY:
        return theta[:, central]
    if most[best] < 1:
        return theta[:, best]
    others = [place for place, row in enumerate(used.rows) if row.limit != "range"]
    u = used.u[others]
    at_best = u[:, np.argmin(u.max(axis=0))]
    row = used.rows[others[np.argmax(at_best)]]
    raise SettingError(
        f"{flag(row.limit.replace('-', '_'))}: even at rest, wherever within {flag('range')}, "
        f"{row}, takes {100 * at_best.max():.4g} % of its limit (margin included); allow more, "
        f"or move or widen {flag('range')}"
    )
