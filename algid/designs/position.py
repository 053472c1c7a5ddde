"""Motions under position control: a finite Fourier series a joint, at rest at both ends.

θ_i(t) = c_i + w(t) Σ_l (a_il sin ω_l t + b_il cos ω_l t) / ω_l with ω_l = 2π l / T (Swevers et al.
1997). The window w rises from 0 to 1 and falls back with three derivatives that vanish at its
ends, so that angle, velocity, acceleration and jerk start and end at rest. Coefficients are
velocities: all of them weigh alike on the limits.

The motion is planned, the torque follows from the arm. Only the torque depends on which arm it is,
so that its largest value over all arms of the belief has a closed form, and one motion stands for
all of them.

======  =====================================================  ===========
symbol  name                                                   shape
======  =====================================================  ===========
x       centre (2,), then a_1l, b_1l, a_2l, b_2l for each l     (2 + 4 L,)
Φ       a joint's angle, velocity, acceleration by a and b      (3, 2 L, N)
======  =====================================================  ===========
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from algid.arm import FloatArray
from algid.designs.belief import Belief, Load, Objective
from algid.designs.information import Experiment, Information, Sensitivities
from algid.designs.limits import Limits, usage
from algid.designs.optimise import Evaluation, Stage, soft_maximum
from algid.model import Motion

BLEND = 0.1  # of the duration, at each end
LONGEST_BLEND = 1.0  # s
HIGHEST = 2.0  # Hz: beyond, arms shake and their drives lag
MOST = 20  # harmonics a joint; a long motion leaves some out
FEWEST = 5  # of a short one, whatever their frequency
JUDGED_RATE = 100.0  # Hz, at which finalists are compared
JUDGED_ARMS = 6  # of the belief


@dataclass(frozen=True)
class Fourier:
    """The family of motions of `duration` s with harmonics up to 2 Hz."""

    duration: float

    @cached_property
    def harmonics(self) -> FloatArray:
        """Angular frequencies (L,) in rad/s."""
        highest = max(FEWEST, int(HIGHEST * self.duration + 1e-9))
        numbers = np.unique(np.round(np.linspace(1, highest, min(highest, MOST))))
        return 2 * np.pi / self.duration * numbers

    @property
    def size(self) -> int:
        """Numbers that a motion takes."""
        return 2 + 4 * self.harmonics.size

    def basis(self, t: FloatArray) -> FloatArray:
        """Φ (3, 2 L, N) at the times `t` (N,) in s."""
        phase = np.multiply.outer(self.harmonics, t)
        omega = self.harmonics[:, None]
        sine, cosine = np.sin(phase) / omega, np.cos(phase) / omega
        value = np.concatenate([sine, cosine])
        slope = np.concatenate([omega * cosine, -omega * sine])
        bend = np.concatenate([-(omega**2) * sine, -(omega**2) * cosine])
        w, dw, ddw = self.window(t)
        return np.stack(
            [w * value, w * slope + dw * value, w * bend + 2 * dw * slope + ddw * value]
        )

    def window(self, t: FloatArray) -> FloatArray:
        """Window and its two derivatives (3, N)."""
        rise = min(BLEND * self.duration, LONGEST_BLEND)
        late = t > 0.5 * self.duration
        s = np.clip(np.where(late, self.duration - t, t) / rise, 0.0, 1.0)
        sign = np.where(late, -1.0, 1.0)
        value = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
        slope = 140 * s**3 * (1 - s) ** 3 / rise
        bend = 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / rise**2
        return np.stack([value, sign * slope, bend])

    def motion(self, x: FloatArray, basis: FloatArray) -> Motion:
        """The motion of the numbers `x` at the times of the `basis`."""
        coefficients = x[2:].reshape(2, -1)
        theta, omega, alpha = (coefficients @ part for part in basis)
        return Motion(theta + x[:2, None], omega, alpha)

    def gradient(self, by_motion: FloatArray, basis: FloatArray) -> FloatArray:
        """Derivatives (..., size) by x from those by the motion, (..., 6, N)."""
        per_order = by_motion.reshape(*by_motion.shape[:-2], 3, 2, by_motion.shape[-1])
        coefficients = np.einsum("...ojn,oln->...jl", per_order, basis, optimize=True)
        centre = per_order[..., 0, :, :].sum(axis=-1)
        return np.concatenate([centre, coefficients.reshape(*centre.shape[:-1], -1)], axis=-1)

    def random(self, rng: np.random.Generator, centre: FloatArray) -> FloatArray:
        """A random motion about a posture (2,), with equal mean velocity in each harmonic."""
        return np.concatenate([centre, rng.standard_normal(self.size - 2)])


@dataclass(frozen=True, eq=False)
class PositionProblem:
    """Fourier motions within limits, for all arms of a belief.

    Parameters
    ----------
    experiment : Experiment
    belief : Belief
    limits : Limits
    asked : Objective
    duration : float, s
    posture : (2,), rad
        One within the limits, for all arms of the belief.
    """

    experiment: Experiment
    belief: Belief
    limits: Limits
    asked: Objective
    duration: float
    posture: FloatArray

    @cached_property
    def family(self) -> Fourier:
        """The motions."""
        return Fourier(self.duration)

    @property
    def rest(self) -> FloatArray:
        """A motion (n,) that keeps all limits: none at all."""
        return np.append(self.posture, np.zeros(self.family.size - 2))

    @cached_property
    def _loads(self) -> list[Load]:
        return list(map(self.belief.load, self.experiment.kinds))

    @cached_property
    def _basis(self) -> Callable[[float], FloatArray]:
        return cache(lambda rate: self.family.basis(middles(self.duration, rate)))

    def slopes(self, x: FloatArray, rate: float) -> Sensitivities:
        """The motion of `x` at `rate` Hz."""
        return Sensitivities(
            self.experiment.shared.model, self.family.motion(x, self._basis(rate)), rate
        )

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random motion about the resting posture."""
        return self.family.random(rng, self.posture)

    def evaluate(self, x: FloatArray, stage: Stage) -> Evaluation:
        """Figure and limits of a motion."""
        slopes, basis = self.slopes(x, stage.rate), self._basis(stage.rate)
        information = Information(self.experiment, self.belief.mean, slopes)
        figure, A = self.asked.figure(information.S, stage.sharpness)
        used = usage(self.limits, slopes, self._loads)
        most, share = soft_maximum(used.u, stage.hardness)
        assert used.by_motion is not None
        return Evaluation(
            figure,
            self.family.gradient(information.gradient(A), basis),
            1 - most,
            -self.family.gradient(used.by_motion * share[:, None], basis),
        )

    def excess(self, x: FloatArray, rate: float) -> float:
        """The largest usage of any limit by any arm of the belief."""
        return float(
            usage(self.limits, self.slopes(x, rate), self._loads, derivatives=False).u.max()
        )

    def score(self, x: FloatArray) -> float:
        """The largest relative bound of the worst arm of the belief."""
        slopes = self.slopes(x, JUDGED_RATE)
        arms = [self.belief.mean, *self.belief.draws(JUDGED_ARMS, seed=0)]
        bounds = []
        for arm in arms:
            bounds.append(self.asked.largest(Information(self.experiment, arm, slopes).S))
        return max(bounds)


def middles(duration: float, rate: float) -> FloatArray:
    """Middles (N,) in s of the samples of a motion at about `rate` Hz."""
    count = max(1, round(duration * rate))
    return (np.arange(count) + 0.5) * (duration / count)
