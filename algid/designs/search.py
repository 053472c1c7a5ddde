"""Search for the best motion under position control: finite Fourier series a joint.

θ_i(t) = c_i + w(t) Σ_l (a_il sin ω_l t + b_il cos ω_l t) / ω_l with ω_l = 2π l / T (Swevers et al.
1997). The window w rises from 0 to 1 and falls back with three derivatives that vanish at its
ends, so that angle, velocity, acceleration and jerk start and end at rest. Coefficients are
velocities: all of them weigh alike on the limits.

======  =====================================================  ===========
symbol  name                                                   shape
======  =====================================================  ===========
x       centre (2,), then a_1l, b_1l, a_2l, b_2l for each l     (2 + 4 L,)
Φ       a joint's angle, velocity, acceleration by a and b      (3, 2 L, N)
======  =====================================================  ===========

The search is sequential quadratic programming from several random motions. Each limit is one
constraint: the soft maximum over time of its usage, log Σ exp(ρ u) / ρ, is never below the largest.
The figure and the limits are smoothed less and less from stage to stage. A motion that the search
ends with is drawn back to the resting start until it keeps every limit exactly.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from algid.arm import FloatArray
from algid.base.progress import Progress
from algid.model import Motion

if TYPE_CHECKING:
    from algid.designs.campaign import Campaign

BLEND = 0.1  # of the duration, at each end
LONGEST_BLEND = 1.0  # s
HIGHEST = 2.0  # Hz: beyond, arms shake and their drives lag
MOST = 20  # harmonics a joint; a long motion leaves some out
FEWEST = 5  # of a short one, whatever their frequency
_RISE = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
"""From 0 to 1, with three derivatives that vanish at both ends."""


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
        per_second = np.where(late, -1.0, 1.0) / rise
        return np.stack([_RISE.deriv(order)(s) * per_second**order for order in range(3)])

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


def middles(duration: float, rate: float) -> FloatArray:
    """Middles (N,) in s of the samples of a motion at about `rate` Hz."""
    count = max(1, round(duration * rate))
    return (np.arange(count) + 0.5) * (duration / count)


_DONE = 1e-5  # change of the figure at which a stage ends
_HALVINGS = 24
_HOPELESS = 1e6
_EASY = 0.8  # usage of the limits that a random start leaves halfway to one
STARTS = 4  # random motions that the search starts from; the best goes on to the later stages


@dataclass(frozen=True)
class Stage:
    """Sharpness of the figure's p-norm and the limits' soft maximum, rate (Hz), most iterations."""

    sharpness: float
    hardness: float
    rate: float
    iterations: int


FIRST = Stage(3.0, 50.0, 50.0, 50)
LATER = (Stage(8.0, 200.0, 50.0, 60), Stage(16.0, 600.0, 100.0, 50))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Figure and its gradient (n,); room left to each limit (m,) and its derivatives (m, n)."""

    figure: float
    gradient: FloatArray
    room: FloatArray
    room_gradient: FloatArray


def optimise(
    campaign: Campaign, rate: float, seed: int, progress: Progress | None = None
) -> FloatArray:
    """The best motion that the search finds.

    Parameters
    ----------
    campaign : Campaign
    rate : float, Hz
        Samples a second at which the limits are kept in the end.
    seed : int
    progress : callable
        Called with how many iterations of how many are done.
    """
    from scipy.optimize import minimize

    total = STARTS * FIRST.iterations + sum(stage.iterations for stage in LATER)
    done = 0
    judged: dict[float, FloatArray] = {}

    def score(x: FloatArray) -> float:
        """The score of a motion drawn within the limits, which is remembered."""
        x = kept(campaign, x, rate)
        found = campaign.score(x)
        judged.setdefault(found, x)
        return found

    def step(_: FloatArray) -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress("searching", done, total)

    def run(x: FloatArray, stage: Stage) -> FloatArray:
        """The motion that a stage ends with."""
        nonlocal done

        # SLSQP asks for the figure, the limits and their gradients at one x after another
        @lru_cache(maxsize=1)
        def at(*x: float) -> Evaluation:
            with suppress(np.linalg.LinAlgError):
                found = campaign.evaluate(np.array(x), stage)
                if np.isfinite(found.figure) and np.all(np.isfinite(found.room)):
                    return found
            # a step so long that nothing can be said of the motion is one to be shortened
            room = np.full(rows, -_HOPELESS)
            return Evaluation(_HOPELESS, np.zeros(len(x)), room, np.zeros((rows, len(x))))

        rows = 1
        rows = at(*x).room.size
        start = done
        ended = minimize(
            lambda x: at(*x).figure,
            x,
            jac=lambda x: at(*x).gradient,
            constraints={
                "type": "ineq",
                "fun": lambda x: at(*x).room,
                "jac": lambda x: at(*x).room_gradient,
            },
            method="SLSQP",
            callback=step,
            options={"maxiter": stage.iterations, "ftol": _DONE},
        )
        done = start + stage.iterations
        return ended.x if np.all(np.isfinite(ended.x)) else x

    rng = np.random.default_rng(seed)
    room = 0.5 * (1 + max(_EASY, campaign.excess(campaign.rest, FIRST.rate)))
    ends = []
    for _ in range(STARTS):
        ends.append(run(kept(campaign, campaign.random(rng), FIRST.rate, room), FIRST))
    better = min(ends, key=score)
    for stage in LATER:
        better = run(better, stage)
        score(better)
    return judged[min(judged)]


def kept(campaign: Campaign, x: FloatArray, rate: float, most: float = 1.0) -> FloatArray:
    """The motion `x`, drawn back to rest until it uses `most` of the limits.

    A small one is enlarged to that.
    """
    rest = campaign.rest

    def drawn(share: float) -> FloatArray:
        return rest + share * (x - rest)

    low, high = 0.0, 1.0
    while most < 1.0 and campaign.excess(drawn(high), rate) < most and high < 1e3:
        low, high = high, 2 * high
    if campaign.excess(drawn(high), rate) <= most:
        return drawn(high)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if campaign.excess(drawn(middle), rate) <= most:
            low = middle
        else:
            high = middle
    return drawn(low)


def soft_maximum(u: FloatArray, hardness: float) -> tuple[FloatArray, FloatArray]:
    """Soft maximum (m,) over time of rows (m, N), and its derivatives (m, N)."""
    top = u.max(axis=1, keepdims=True)
    parts = np.exp(hardness * (u - top))
    total = parts.sum(axis=1, keepdims=True)
    return (top + np.log(total) / hardness)[:, 0], parts / total
