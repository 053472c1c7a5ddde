"""Whether a logged torque is held from each sample to the next, by how late it acts.

A digital controller holds its torque h = dt / 2 late in the mean; a torque that moves evenly from
sample to sample is not late. Logs show how late with a deviation s, beside all that is fitted, and
the log of the odds for a held torque is

    (d² − (d − h)²) / 2 s²

with d what they show. Where neither is likelier by far, the delay stays a parameter, with the two
as its prior: mean h / 2 and deviation h / 2. The posterior's error is then what it says, whichever
is true.

A log of fewer samples than 500 a second is slower than most controllers. Where it shows that its
own samples are not held, a faster controller's may be: where half a millisecond would not show, d
stays a parameter too, between none and that half millisecond, which is its deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import Literal

import numpy as np

from algid.estimators.combine import Prior
from algid.model import DELAYS

Hold = Literal["foh", "zoh"]
SURE = log(100.0)
"""Log of the odds from which one of the two is taken."""
NEGLIGIBLE = 0.1
"""Standard deviations by which half a sample may move each estimate, and nobody need know."""
CONTROLLER = 5e-4
"""Half the period of a controller of 1 kHz, in s."""
_SLOW = 2 * CONTROLLER
"""Half a sample of logs, in s, that are as fast as the slowest usual controllers: 500 Hz."""
_NEAR, _SIGMAS = 0.3, 4.0
"""Of half a sample, and standard deviations: another delay is further from what is taken."""


@dataclass(frozen=True)
class Lateness:
    """How late a torque acts where the log is taken for one that is not held.

    Parameters
    ----------
    late, std : float, s
        The estimate beside all other parameters, and its standard deviation.
    half : float, s
        Half a sample.
    effect : float, 1/s
        Of its standard deviations, by how many an estimate moves with a second of delay that is
        left out: the most of all.
    """

    late: float
    std: float
    half: float
    effect: float = np.inf

    @property
    def odds(self) -> float:
        """Log of the odds for a torque that is held against one that is not."""
        return self.half * (self.late - 0.5 * self.half) / max(self.std, 1e-150) ** 2

    @property
    def share(self) -> float:
        """Largest error of any estimate under the wrong hold, in its standard deviations."""
        return self.half * self.effect

    @property
    def decided(self) -> bool:
        """Whether one of the two is likelier by far, or it makes no difference."""
        return self.share < NEGLIGIBLE or abs(self.odds) >= SURE

    @property
    def faster(self) -> bool:
        """Whether a controller that is faster than the log may hold the torque, and it matters.

        Where the log would show half of its period, the delay is a term like others.
        """
        matters = NEGLIGIBLE <= CONTROLLER * self.effect < np.inf
        hidden = _SIGMAS * self.std > CONTROLLER
        return matters and hidden and self.half > _SLOW and self.odds <= -SURE

    @property
    def determined(self) -> bool:
        """Whether the log shows how late the torque acts, or it makes no difference."""
        return self.decided and not self.faster

    @property
    def hold(self) -> Hold:
        """The hold that the log shows; not held where it shows neither, or another delay."""
        return "zoh" if self.odds >= SURE and not self.another else "foh"

    @property
    def another(self) -> bool:
        """Whether the log shows a delay that is longer, or shorter, than half a sample and none."""
        off = abs(self.late - self.half)
        return self.odds >= SURE and off > max(_NEAR * self.half, _SIGMAS * self.std)

    @property
    def prior(self) -> Prior:
        """The delay's prior where the log leaves it open."""
        # between none and half a sample, or half of a faster controller's period
        mean = spread = 0.5 * self.half
        if self.faster:
            mean, spread = 0.5 * CONTROLLER, CONTROLLER
        return Prior(DELAYS, np.array([mean]), np.array([[spread**-2]]))
