"""Differences on a moving stencil, off its centre by any fraction of a sample.

======  ==============================================  ===========  ============
symbol  name                                            shape        unit
======  ==============================================  ===========  ============
w       weights of value, first and second derivative   (3, POINTS)  s^0 s^-1 s^-2
x       angles                                          (2, N)       rad
n       torque samples whose stencil lies in the angles  scalar       1
======  ==============================================  ===========  ============

The weights are exact for polynomials through the stencil's points (Fornberg 1988, Math. Comp. 51).
Nine points follow an arm that turns 25 times a second in logs of 1 kHz; seven biased its constants
by half a σ.

Cumulative integrals of uniformly sampled signals, fourth order in the sample time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial, floor

import numpy as np

from algid.arm import FloatArray
from algid.signals.filters import correlate, reflected

POINTS = 9
_HALF = POINTS // 2
_NEXT = 0.25  # of a sample, before the next whole one


@dataclass(frozen=True)
class TorqueShift:
    """Half a sample where the torque is `held` from each sample to the next, and a `delay` in s."""

    held: bool = False
    delay: float = 0.0

    def at(self, dt: float) -> float:
        """The time in s where samples are `dt` s apart."""
        return (0.5 * dt if self.held else 0.0) + self.delay

    def later(self, delay: float) -> TorqueShift:
        """The same with `delay` s on top."""
        return replace(self, delay=self.delay + delay)


AT_ONCE = TorqueShift()
"""A torque that acts when it is stamped, and moves evenly from sample to sample."""


@dataclass(frozen=True, eq=False)
class Stencil:
    """Differences at `shift` seconds after each torque sample.

    Parameters
    ----------
    dt : float, s
        Time between samples.
    shift : float, s
        How long after its stamp a torque acts: hold and delay together.
    held : bool
        Whether each torque was held until the next: see `HELD`.
    lag : float, s
        Time constant of a first-order low-pass that the logged torque went through.
    """

    dt: float
    shift: float = 0.0
    held: bool = False
    lag: float = 0.0

    @cached_property
    def whole(self) -> int:
        """Whole samples in the shift.

        The next one is taken from three quarters on: a delay that is estimated near none, or near
        half a sample, stays on one stencil.
        """
        return floor(self.shift / self.dt + _NEXT)

    @cached_property
    def weights(self) -> FloatArray:
        """W (3, POINTS): value, first and second derivative."""
        nodes = np.arange(POINTS) - _HALF - (self.shift / self.dt - self.whole)
        moments = np.vander(nodes, increasing=True).T
        wanted = np.zeros((POINTS, 3))
        for order in range(3):
            wanted[order, order] = factorial(order) / self.dt**order
        return np.linalg.solve(moments, wanted).T

    @cached_property
    def taps(self) -> FloatArray:
        """What a logged torque and its neighbours, as many on either side, count for.

        A held one counts by `HELD`; a low-pass is undone by 1 + lag d/dt.
        """
        taps = HELD if self.held else np.ones(1)
        if self.lag:
            taps = np.convolve(
                taps, np.eye(_SLOPE.size)[_SLOPE.size // 2] + self.lag / self.dt * _SLOPE
            )
        return taps

    def moving(self, tau: FloatArray) -> FloatArray:
        """Torque (..., N) that moves the arm, of the logged one.

        The ends of two samples or more go on by reflection.
        """
        reach = self.taps.size // 2
        return correlate(reflected(tau, reach), self.taps) if reach else tau

    def torques(self, length: int) -> slice:
        """Torque samples among `length` whose stencil lies within the `length` angles."""
        return slice(max(0, _HALF - self.whole), max(0, min(length, length - _HALF - self.whole)))

    def first(self, length: int) -> int:
        """Angle sample at which the stencil of the first of `torques` starts."""
        return self.torques(length).start + self.whole - _HALF

    def differences(self, x: FloatArray) -> FloatArray:
        """Value and two derivatives (3, 2, n) of x (2, N) where `torques` act."""
        torques, first = self.torques(x.shape[1]), self.first(x.shape[1])
        around = x[:, first : torques.stop + self.whole + _HALF]
        result = np.empty((3, 2, max(0, torques.stop - torques.start)))
        for order, weights in enumerate(self.weights):
            result[order] = correlate(around, weights)
        return result


_SLOPE = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60
"""First derivative by the samples around one, times dt: sixth order."""


HELD = np.array([1.0, 22.0, 1.0]) / 24
"""What a held torque and its neighbours count for, half a sample after its stamp.

Under a held torque u the angles obey θ[n+1] − 2 θ[n] + θ[n−1] = dt²/2 (u[n] + u[n−1]) per unit of
inertia; under a smooth one a, dt² (a + dt²/12 a″). Hence a = u + dt²/24 u″ half a sample later,
with an error O(dt⁴).
"""

FEWEST_SAMPLES = 4

# Integral over one sample of the cubic through four neighbours: at the edges and in between, times
# dt / 24.
_EDGE = np.array([9.0, 19.0, -5.0, 1.0]) / 24
_INNER = np.array([-1.0, 13.0, 13.0, -1.0]) / 24


def integral(signal: FloatArray, dt: float) -> FloatArray:
    """Integrate a uniformly sampled signal from its first sample.

    Parameters
    ----------
    signal : (..., N) float64, unit u
        Samples at 0, dt, …, (N-1) dt.
    dt : float, s

    Returns
    -------
    (..., N) float64, unit u s
        Zero at the first sample. Error O(dt^4) for smooth signals: each step integrates the cubic
        through the four samples around it.

    Raises
    ------
    ValueError
        If the signal has fewer than four samples.
    """
    if signal.shape[-1] < FEWEST_SAMPLES:
        raise ValueError(
            f"the signal needs at least {FEWEST_SAMPLES} samples, got {signal.shape[-1]}"
        )
    steps = np.empty_like(signal)
    steps[..., 0] = 0
    steps[..., 1] = signal[..., :4] @ _EDGE
    steps[..., -1] = signal[..., -4:] @ _EDGE[::-1]
    steps[..., 2:-1] = correlate(signal, _INNER)
    steps *= dt
    return np.cumsum(steps, axis=-1, out=steps)
