"""Differences on a moving stencil, off its centre by any fraction of a sample.

======  ==============================================  ===========  ============
symbol  name                                            shape        unit
======  ==============================================  ===========  ============
w       weights of value, first and second derivative   (3, POINTS)  s^0 s^-1 s^-2
x       angles                                          (2, N)       rad
n       torque samples whose stencil lies in the angles  scalar       1
======  ==============================================  ===========  ============

The weights are exact for polynomials through the stencil's points (Fornberg 1988, Math. Comp. 51). Nine
points follow an arm that turns 25 times a second in logs of 1 kHz; seven biased its constants by half a σ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np

from algid.arm import FloatArray

POINTS = 9
_HALF = POINTS // 2


@dataclass(frozen=True, eq=False)
class Stencil:
    """Differences at `shift` seconds after each torque sample.

    Parameters
    ----------
    dt : float, s
        Time between samples.
    shift : float, s
        How long after its stamp a torque acts: hold and delay together.
    """

    dt: float
    shift: float = 0.0

    @cached_property
    def whole(self) -> int:
        """Whole samples in the shift."""
        return round(self.shift / self.dt)

    @cached_property
    def weights(self) -> FloatArray:
        """w (3, POINTS): value, first and second derivative."""
        nodes = np.arange(POINTS) - _HALF - (self.shift / self.dt - self.whole)
        moments = np.vander(nodes, increasing=True).T
        wanted = np.zeros((POINTS, 3))
        for order in range(3):
            wanted[order, order] = factorial(order) / self.dt**order
        return np.linalg.solve(moments, wanted).T

    def torques(self, length: int) -> slice:
        """Torque samples among `length` whose stencil lies within the `length` angles."""
        return slice(max(0, _HALF - self.whole), max(0, min(length, length - _HALF - self.whole)))

    def first(self, length: int) -> int:
        """Angle sample at which the stencil of the first of `torques` starts."""
        return self.torques(length).start + self.whole - _HALF

    def differences(self, x: FloatArray) -> FloatArray:
        """Value and two derivatives (3, 2, n) of x (2, N) where `torques` act."""
        length = x.shape[1]
        torques, first = self.torques(length), self.first(length)
        n = torques.stop - torques.start
        result = np.zeros((3, 2, n))
        for order, weights in enumerate(self.weights):
            for point, weight in enumerate(weights):
                if weight != 0.0:
                    result[order] += weight * x[:, first + point : first + point + n]
        return result
