"""What a motion must keep within, and how much of each limit it uses.

A usage is what is used of a limit, one where it is reached: the angle's distance from the middle of its range over
half the range, speed, acceleration and torque over their limits, and the depth of the tip below the height of a
stretched arm over what is allowed of it.

======  ============================================  =========
symbol  name                                          shape
======  ============================================  =========
u       usages, a row a limit and side                (m, N)
τ̂       largest torque of any arm of the belief       (2, N)
======  ============================================  =========
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from algid.arm import FloatArray
from algid.design.belief import Load
from algid.design.information import COMPONENTS, Slopes
from algid.model import Motion

JOINTS = ("joint 1", "joint 2")


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a motion, each (2,) a joint; infinite where there is none.

    Parameters
    ----------
    low, high : rad
    speed : rad/s
    acceleration : rad/s^2
    torque : N m
    height : float, m
        Lowest height of the tip over joint 1; minus infinity where there is none.
    lengths : (2,), m
        Of the links; NaN where they are not known.
    """

    low: FloatArray
    high: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    height: float
    lengths: FloatArray

    @property
    def middle(self) -> FloatArray:
        """Middle (2,) of the range; hanging where there is none."""
        return np.where(np.isfinite(self.low + self.high), 0.5 * (self.low + self.high), [-np.pi / 2, 0.0])

    def within(self, margin: float) -> Limits:
        """These limits less a share `margin` of each."""
        half = 0.5 * (self.high - self.low)
        kept = {name: (1 - margin) * getattr(self, name) for name in ("speed", "acceleration", "torque")}
        height = self.height + margin * (self.lengths.sum() - self.height) if np.isfinite(self.height) else self.height
        return replace(self, low=self.low + margin * half, high=self.high - margin * half, height=height, **kept)

    def height_of(self, theta: FloatArray) -> FloatArray:
        """Height of the tip (...) in m at angles (2, ...)."""
        return self.lengths[0] * np.sin(theta[0]) + self.lengths[1] * np.sin(theta[0] + theta[1])


@dataclass(frozen=True)
class Row:
    """A limit and its side: its flag, its joint, whether at its upper end, and for a torque whether loaded."""

    limit: str
    joint: int | None
    upper: bool = True
    loaded: bool | None = None


@dataclass(frozen=True, eq=False)
class Usage:
    """Usages u (m, N) along a motion, the rows they belong to, and their derivatives (m, 6, N) by the motion."""

    rows: tuple[Row, ...]
    u: FloatArray
    by_motion: FloatArray | None = None

    @property
    def most(self) -> FloatArray:
        """Largest usage (m,) of each row."""
        return self.u.max(axis=1)


def usage(limits: Limits, slopes: Slopes, loads: Sequence[Load], derivatives: bool = True) -> Usage:
    """How much of each limit the motion of `slopes` uses, for every arm of the belief behind `loads`."""
    found = list(_rows(limits, slopes, loads, derivatives))
    rows = tuple(row for row, _, _ in found)
    u = np.array([values for _, values, _ in found])
    if not derivatives:
        return Usage(rows, u)
    return Usage(rows, u, np.array([slope for _, _, slope in found]))


Found = tuple[Row, FloatArray, FloatArray]


def _rows(limits: Limits, slopes: Slopes, loads: Sequence[Load], derivatives: bool) -> Iterator[Found]:
    motion = slopes.motion
    yield from _kinematic(limits, motion)
    if np.isfinite(limits.height):
        yield _tip(limits, motion)
    for load in loads:
        yield from _torque(limits.torque, slopes, load, derivatives)


def _kinematic(limits: Limits, motion: Motion) -> Iterator[Found]:
    half = 0.5 * (limits.high - limits.low)
    kinds = (
        ("range", motion.theta - limits.middle[:, None], half),
        ("speed", motion.omega, limits.speed),
        ("acceleration", motion.alpha, limits.acceleration),
    )
    for order, (name, values, limit) in enumerate(kinds):
        for joint in range(2):
            if not np.isfinite(limit[joint]):
                continue
            for sign in (1.0, -1.0):
                slope = np.zeros((COMPONENTS, values.shape[1]))
                slope[2 * order + joint] = sign / limit[joint]
                yield Row(name, joint, sign > 0), sign * values[joint] / limit[joint], slope


def _tip(limits: Limits, motion: Motion) -> Found:
    l1, l2 = limits.lengths
    room = l1 + l2 - limits.height
    both = motion.theta[0] + motion.theta[1]
    slope = np.zeros((COMPONENTS, both.size))
    slope[0] = -(l1 * np.cos(motion.theta[0]) + l2 * np.cos(both)) / room
    slope[1] = -l2 * np.cos(both) / room
    return Row("tip-height", None, upper=False), (l1 + l2 - limits.height_of(motion.theta)) / room, slope


def _torque(limit: FloatArray, slopes: Slopes, load: Load, derivatives: bool) -> Iterator[Found]:
    torque, more, by_Y = load.largest(slopes.Y)
    for joint in range(2):
        if not np.isfinite(limit[joint]):
            continue
        for sign in (1.0, -1.0):
            row = Row("torque", joint, sign > 0, load.loaded)
            values = (sign * torque[joint] + more[joint]) / limit[joint]
            slope = np.zeros((COMPONENTS, values.size))
            if derivatives:
                to_Y = (sign * load.c[:, None] + by_Y[joint]) / limit[joint]
                slope = np.einsum("qn,cqn->cn", to_Y, slopes.dY[:, joint])
            yield row, values, slope
