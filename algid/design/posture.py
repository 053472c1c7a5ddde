"""A posture that the arm can be held in within all limits; without one there is no motion either."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.arm import FloatArray
from algid.design.belief import Load
from algid.design.information import Slopes
from algid.design.limits import Limits, Row, usage
from algid.errors import SettingError
from algid.model import Model, Motion

HANGING = (-np.pi / 2, 0.0)
_STEPS = 41  # postures of each joint that are tried
_WIDE = np.pi  # rad to either side, where a range is not limited
_EASY = 0.7  # usage up to which the middle of the range will do


def resting(limits: Limits, model: Model, loads: Sequence[Load]) -> FloatArray:
    """A posture (2,) that keeps the limits: the middle of the range, or the one that uses the least of them.

    Raises
    ------
    SettingError
        If there is none; it names the limit, and by how much it is missed.
    """
    middle = limits.middle
    low = np.where(np.isfinite(limits.low), limits.low, middle - _WIDE)
    high = np.where(np.isfinite(limits.high), limits.high, middle + _WIDE)
    grid = np.meshgrid(*(np.linspace(low[joint], high[joint], _STEPS) for joint in range(2)), indexing="ij")
    theta = np.stack([axis.ravel() for axis in grid])
    still = np.zeros_like(theta)
    used = usage(limits, Slopes(model, Motion(theta, still, still), 1.0), loads, derivatives=False)
    most = used.u.max(axis=0)
    central, best = theta.shape[1] // 2, int(np.argmin(most))
    if most[central] <= _EASY:
        return theta[:, central]
    if most[best] < 1:
        return theta[:, best]
    other = np.array([row.limit != "range" for row in used.rows])
    most = np.where(other[:, None], used.u, -np.inf).max(axis=0)
    best = int(np.argmin(most))
    row = used.rows[int(np.argmax(np.where(other, used.u[:, best], -np.inf)))]
    raise SettingError(_missed(row, limits, float(most[best])))


def _missed(row: Row, limits: Limits, most: float) -> str:
    if row.limit == "tip-height":
        reach = float(limits.lengths.sum())
        lowest = reach - most * (reach - limits.height)
        return (
            f"--tip-height: within the range the tip rises no higher than {lowest:.3g} m, the limit asks for "
            f"{limits.height:.3g} m (margin included); lower it, or widen --range"
        )
    assert row.joint is not None
    limit = limits.torque[row.joint]
    with_load = "loaded " if row.loaded else ""
    return (
        f"--torque: the {with_load}arm asks for {most * limit:.3g} N m at joint {row.joint + 1} even at rest, the "
        f"limit is {limit:.3g} N m (margin included); raise it, or move --range to where gravity pulls less"
    )
