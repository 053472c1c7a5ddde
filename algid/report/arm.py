"""The arm itself: a drawing to scale, and a player that moves it through a log or a plan.

The drawing stands without JavaScript at the motion's start; a script draws the tip's path.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.base.text import significant
from algid.model import SINES, length_by_coupling, moments_of
from algid.options import flag
from algid.report.series import Drawn
from algid.results import Result

FRAMES = 30.0  # a second
MOST_FRAMES = 6_000


@dataclass(frozen=True, eq=False)
class ArmDrawing:
    """An arm and its motion.

    Parameters
    ----------
    l1, l2 : float, m
    t : (N,), s, increasing
    theta : (2, N), rad, θ1 from the horizontal, θ2 from link 1
    reading : str
        One line that says what to look at.
    payload : str
        What hangs at the tip, in words; empty where nothing does.
    height : float, m, or None
        Below which the tip may not come.
    aside : float, m
        How far beside link 2's line the payload's centre of mass lies.
    """

    l1: float
    l2: float
    t: FloatArray
    theta: FloatArray
    reading: str
    payload: str = ""
    height: float | None = None
    aside: float = 0.0

    @property
    def frames(self) -> dict[str, list[float]]:
        """Times and angles at `FRAMES` a second, fewer of a long motion."""
        first, last = self.t[0], self.t[-1]
        t = np.linspace(first, last, 2 + int(min((last - first) * FRAMES, MOST_FRAMES)))
        theta1, theta2 = (np.interp(t, self.t, row) for row in self.theta)
        rows = {"t": t, "theta1": theta1, "theta2": theta2}
        return {name: values.round(3).tolist() for name, values in rows.items()}


def arm_of(result: Result, raw: Drawn | None) -> ArmDrawing | None:
    """The arm of a result, to scale as far as its lengths are known, moved through the first log.

    None where l1 follows from nothing, or no motion is at hand.
    """
    value = {name: one.estimate or 0.0 for name, one in result.parameters.items()}
    held = {name: one.estimate for name, one in result.payload.items()}
    lengths = {name: held.get(name, result.settings.get(name)) for name in ("l1", "l2")}
    l1, l2, gravity = lengths["l1"], lengths["l2"], result.settings.get("gravity")
    if l1 is None and gravity is not None:
        l1 = length_by_coupling(value, gravity)  # l1 = g |K1| / |K2| (Table 1)
    if l1 is None or l1 <= 0 or raw is None:
        return None
    t, theta = raw.samples["t"], np.stack([raw.samples["theta1"], raw.samples["theta2"]])
    known = (raw.samples["log"] == 0) & np.isfinite(theta).all(axis=0)
    if np.count_nonzero(known) < 2:
        return None
    first, second, _ = moments_of(value)
    if first and second and set(value) & set(SINES):
        theta[0] += cmath.phase(second / first)  # θ1's zero against gravity
    reading = f"Play it: does this arm move as yours did? l1 is {significant(l1, 3)} m."
    if l2 is None or l2 <= 0:
        l2, way = l1, flag("l2")
        reading += f" Link 2's length is not known: it is drawn as long as link 1 (give {way})."
    mass = held.get("m_p")
    payload = "" if mass is None else f"payload of {significant(mass, 3)} kg"
    aside = held.get("y_p") or 0.0
    return ArmDrawing(l1, l2, t[known], theta[:, known], reading, payload, aside=aside)
