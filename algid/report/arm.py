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
READING = "Play it: does this arm move as yours did?"


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
    def frames(self) -> tuple[FloatArray, FloatArray]:
        """Times and angles at `FRAMES` a second, fewer of a long motion."""
        seconds = float(self.t[-1] - self.t[0])
        count = int(min(max(round(seconds * FRAMES), 1), MOST_FRAMES, max(self.t.size - 1, 1))) + 1
        t = np.linspace(self.t[0], self.t[-1], count)
        return t, np.stack([np.interp(t, self.t, row) for row in self.theta])


def arm_of(result: Result, raw: Drawn | None) -> ArmDrawing | None:
    """The arm of a result, to scale as far as its lengths are known, moved through the first log.

    None where l1 follows from nothing, or no motion is at hand.
    """
    value = {name: one.estimate or 0.0 for name, one in result.parameters.items()}
    l1, l2, gravity = _length(result, "l1"), _length(result, "l2"), result.settings.get("gravity")
    if l1 is None and isinstance(gravity, int | float):
        l1 = length_by_coupling(value, gravity)  # l1 = g |K1| / |K2| (Table 1)
    if l1 is None or l1 <= 0 or raw is None:
        return None
    own = {name: values[raw.samples["log"] == 0] for name, values in raw.samples.items()}
    known = np.isfinite(own["theta1"]) & np.isfinite(own["theta2"])
    if np.count_nonzero(known) < 2:
        return None
    first, second, _ = moments_of(value)
    # θ1's zero against gravity, of an arm whose moments have phases
    turn = cmath.phase(second / first) if first and second and set(value) & set(SINES) else 0.0
    reading = f"{READING} l1 is {significant(l1, 3)} m."
    if l2 is None:
        reading += (
            f" Link 2's length is not known: it is drawn as long as link 1 (give {flag('l2')})."
        )
    mass, beside = (result.payload.get(name) for name in ("m_p", "y_p"))
    payload = ""
    if mass is not None and mass.estimate is not None:
        payload = f"payload of {significant(mass.estimate, 3)} kg"
    aside = beside.estimate or 0.0 if beside else 0.0
    theta = np.stack([own["theta1"][known] + turn, own["theta2"][known]])
    return ArmDrawing(l1, l2 or l1, own["t"][known], theta, reading, payload, aside=aside)


def _length(result: Result, name: str) -> float | None:
    """A link's length in m: estimated with the payload, or given."""
    value = result.settings.get(name)
    if name in result.payload:
        value = result.payload[name].estimate
    if not isinstance(value, int | float) or value <= 0:
        return None
    return float(value)
