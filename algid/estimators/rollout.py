"""Simulate the arm from a log's states under its torques, and compare it with the log's angles.

A start every so often, all of them at once: Runge-Kutta of fourth order, torques between samples
on straight lines. Angles and velocities of the starts, and the angles to compare with, pass the
motion's zero-phase filter.

======  =================================================  ===============  ======
symbol  name                                               shape            unit
======  =================================================  ===============  ======
x       state θ, ω at the starts                           (4, S)           mixed
u       torques at each half step from each start          (2 n + 1, 2, S)  N m
y       angles at the horizons; NaN past a stretch's end   (H, 2, S)        rad
======  =================================================  ===============  ======
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from algid.arm import FloatArray
from algid.estimators.prediction import DROPPED, MOTION, ORDER, motion_of
from algid.model import Model, advanced, damping, inertia
from algid.signals.filters import butterworth
from algid.signals.segments import Segment, pieces_of
from algid.signals.shift import AT_ONCE, TorqueShift

HORIZONS = (0.1, 0.5, 2.0)
"""s after which the angles are compared."""
_STARTS = 400  # of a log, at most
_CLOSEST = 0.05  # s between starts
_PIECE_SECONDS = 60.0
_POSES = 8  # of joint 2, at which the arm's stiffness is looked at
_LONGEST, _SHORTEST = 2e-3, 1.25e-4  # s of a step


@dataclass(frozen=True, eq=False)
class RolloutScore:
    """By horizon (H,): starts.

    By horizon and joint (H, 2): squared errors, and squared distances moved, in rad².
    """

    count: FloatArray = field(default_factory=lambda: np.zeros(len(HORIZONS)))
    error: FloatArray = field(default_factory=lambda: np.zeros((len(HORIZONS), 2)))
    moved: FloatArray = field(default_factory=lambda: np.zeros((len(HORIZONS), 2)))

    def __add__(self, other: RolloutScore) -> RolloutScore:
        return RolloutScore(
            self.count + other.count, self.error + other.error, self.moved + other.moved
        )

    @property
    def rmse(self) -> FloatArray:
        """RMSE (H, 2) of the angles in rad.

        NaN without a start, infinite where the simulation runs away.
        """
        return self._root_mean(self.error)

    @property
    def distance(self) -> FloatArray:
        """RMS (H, 2) in rad of the joints' travel: the RMSE of an arm that stays where it is."""
        return self._root_mean(self.moved)

    def _root_mean(self, squares: FloatArray) -> FloatArray:
        mean = squares / np.maximum(self.count, 1)[:, None]
        return np.sqrt(np.where(self.count[:, None] > 0, mean, np.nan))


def rollouts(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    duration: float,
    shift: TorqueShift = AT_ONCE,
) -> RolloutScore:
    """Simulate forward from states of a log of `duration` s by the coefficients `c` (q,).

    `shift` is the time in s after which a logged torque acts, as for `scored_torque`.
    """
    step = time_step(model, c)
    spacing = max(_CLOSEST, duration / _STARTS)
    made = []
    for piece in pieces_of(segments, _PIECE_SECONDS):
        starts = _starts(model, c, piece, spacing, step, shift)
        if starts is not None:
            made.append(starts)
    if not made:
        return RolloutScore()
    x, u, y = (np.concatenate(parts, axis=-1) for parts in zip(*made, strict=True))
    angles = np.stack(_angles_at_horizons(model, c, x, u, step))
    judged = np.isfinite(y[:, 0])
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.where(judged[:, None], angles - y, 0.0)
        moved = np.where(judged[:, None], y - x[:2], 0.0)
        squares = np.where(np.isnan(error), np.inf, error) ** 2
    return RolloutScore(
        judged.sum(axis=1).astype(np.float64), squares.sum(axis=2), (moved**2).sum(axis=2)
    )


def time_step(model: Model, c: FloatArray) -> float:
    """Time step in s that the stiffest friction of either joint, at rest, leaves stable.

    It divides the horizons.
    """
    rate = stiffness(model, c)
    step = _LONGEST
    while step * rate > 1 and step > _SHORTEST:
        step /= 2
    return step


def stiffness(model: Model, c: FloatArray) -> float:
    """The rate in 1/s at which friction stops either joint near rest, in its worst pose."""
    around = np.linspace(0, 2 * np.pi, _POSES, endpoint=False)
    (outer, coupling), (_, inner) = inertia(model, c, np.stack([np.zeros_like(around), around]))
    slope = np.abs(damping(model, c))
    least = np.maximum(outer * inner - coupling**2, 1e-3 * outer * inner)
    return float(np.max(np.maximum(slope[0] * inner, slope[1] * outer) / least))


def _starts(
    model: Model, c: FloatArray, piece: Segment, spacing: float, step: float, shift: TorqueShift
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """x, u and y of the starts in a piece of a log that have the first horizon ahead of them.

    None where there is no such start.
    """
    dt, n = piece.dt, len(piece)
    halves = 2 * round(HORIZONS[-1] / step) + 1
    edge, first = round(DROPPED / dt), round(HORIZONS[0] / dt)
    at = np.arange(edge, n - edge - first, max(1, round(spacing / dt)))
    if n <= 6 * (ORDER + 1) or not at.size:
        return None
    motion = motion_of(butterworth(piece.theta, dt, min(MOTION, 0.45 / dt)), dt)
    late = shift.at(dt) - model.lag(c)
    when = at * dt + 0.5 * step * np.arange(halves)[:, None] - late
    t = np.arange(n) * dt
    u = np.empty((halves, 2, at.size))
    ahead = at + np.array(HORIZONS)[:, None] / dt
    y = np.empty((len(HORIZONS), 2, at.size))
    for joint in range(2):
        u[:, joint] = np.interp(when, t, piece.tau[joint])
        y[:, joint] = np.interp(ahead, np.arange(n), motion.theta[joint])
    y[np.broadcast_to((ahead > n - 1 - edge)[:, None], y.shape)] = np.nan
    return np.concatenate([motion.theta[:, at], motion.omega[:, at]]), u, y


def _angles_at_horizons(
    model: Model, c: FloatArray, x: FloatArray, u: FloatArray, step: float
) -> list[FloatArray]:
    """Angles (2, S) at each horizon, by the classical Runge-Kutta method of fourth order."""
    angles: list[FloatArray] = []
    ends = [round(horizon / step) for horizon in HORIZONS]
    # an arm far from the log's may run away: its error is infinite then
    with np.errstate(all="ignore"):
        for number in range(ends[-1]):
            x = advanced(model, c, x, u[2 * number : 2 * number + 3], step)
            if number + 1 in ends:
                angles.append(x[:2])
    return angles
