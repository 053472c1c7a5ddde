"""Torques that a sensor cuts off at the end of its range, told by the motion.

A torque may be limited and logged as it is: nothing is wrong then. Where a sensor reaches the end
of its range, the arm gets more than the log holds. With h what the arm gets beyond the logged
torque τ, the equations of `algid.estimators.modulating_functions` are

    ∫φ τ = X c − ∫φ h

h is looked for where τ stands at its largest or at its smallest value: a mean and a parabola over
each time that it stands there, as a smooth peak that is cut off has. It is believed where it is
certain, makes up so much of what the equations leave that neither friction nor a gain explains the
same, and the arm that it leaves has inertia.

======  ============================================================  =====================
symbol  name                                                          shape
======  ============================================================  =====================
h       what the arm gets beyond the logged torque: two candidates    (2, N)
A       columns of the equations, then those of h, the torque last    (2, p, R)
gram    A Aᵀ by stretch of a window's length and joint                (B, 2, p, p)
======  ============================================================  =====================
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.quantiles import median
from algid.estimators.combine import long_run_variance, scaled_pinv
from algid.estimators.modulating_functions import OVERLAP, Windows
from algid.estimators.problem import Problem, WeakSettings
from algid.estimators.weak import normals_of, solve
from algid.model import FIRST_TERMS, Model
from algid.signals.segments import Segment, pieces

BoolArray = NDArray[np.bool_]

_FEWEST = 6  # samples at a limit: fewer are a peak of noise
_APART = 5  # samples: shorter breaks in a plateau are noise
_MOST = 0.5  # of the samples at a limit: a torque that switches has no other
_TRUE = 0.01  # of a torque at its limit: what the arm may get beyond a limit that is true
_SHARE = 0.25  # of what a joint's equation leaves (squares): least that a limit makes up
_CERTAIN = 4.0  # standard deviations
_INERTIAS = ("k3", "k5")
_EXPLAINED = 0.9  # of the joint's torque, with the limit
_MARGIN = 3.0  # standard deviations of the torque's noise: what is nearer to the limit is left out
_GUARD = 0.01  # s
_PIECE_SAMPLES = 1 << 16  # of a log that are looked at at once


@dataclass(frozen=True)
class Limit:
    """Where a torque is cut off: what does not lie between `low` and `high` is not the joint's.

    `joint` is 0 or 1, `low` and `high` are in N m, infinite where the other side is sound.
    """

    joint: int
    low: float
    high: float

    def beyond(self, tau: FloatArray) -> BoolArray:
        """Which samples (N,) of torques (2, N) are not the joint's."""
        own = tau[self.joint]
        return np.asarray((own >= self.high) | (own <= self.low))


@dataclass(frozen=True)
class Saturation:
    """What motion tells of the limits of a log's torques.

    `limits` cut them off; the torques of the joints in `sound` (0 or 1) stand at limits that the
    motion confirms.
    """

    limits: tuple[Limit, ...]
    sound: frozenset[int]


UNSEEN = Saturation((), frozenset())
"""Where motion shows no limits."""


def saturation_of(segments: Sequence[Segment], gravity: float = 9.81) -> Saturation:
    """Limits that cut off torques of a log, joint by joint.

    Parameters
    ----------
    segments : of the log, in memory
    gravity : float, m/s^2
    """
    if not segments:
        return UNSEEN
    tau = np.concatenate([segment.tau for segment in segments], axis=1)
    levels = [one for joint in (0, 1) if (one := _levels(joint, tau[joint])) is not None]
    model = Model(gravity=gravity, terms=FIRST_TERMS)

    def plateaus(piece: Segment, windows: Windows) -> FloatArray:
        H = []
        for one in levels:
            h = windows.torque_moments(_plateaus(piece.tau[one.joint], piece.dt, one))
            H.append(h * np.equal(np.arange(2), one.joint)[:, None, None])
        return np.concatenate(H, axis=1)

    normals = []
    if levels:
        settings = WeakSettings(model=model, estimate_delay=True)
        normals = normals_of(Problem([lambda: segments], settings=settings), beside=plateaus)
    if not normals:
        return UNSEEN
    (c, (log,)), (normal,) = solve(normals), normals
    inverse = scaled_pinv(log.total[0])
    sandwich = inverse @ long_run_variance(log.g)[0] @ inverse
    residual = np.append(-c, 1.0)
    inertias = [model.names.index(name) for name in _INERTIAS]
    limits, sound = [], set()
    for number, one in enumerate(levels, -len(levels)):
        # that of the other joint, if there are two, is beside it
        own = c.size + 2 * number + np.arange(2)
        h, total = -c[own], normal.total[one.joint]
        covariance, alone = sandwich[np.ix_(own, own)], inverse[np.ix_(own, own)]
        explained = residual @ total @ residual < (1 - _EXPLAINED) * total[-1, -1]
        every = np.abs(_plateaus(tau[one.joint], segments[0].dt, one))
        mean = every.sum(axis=1) / max(float(every[0].sum()), 1.0)
        excess, std = float(mean @ h), float(np.sqrt(max(mean @ covariance @ mean, 0.0)))
        # what h takes off the squares over their variance, beside what it leaves of them
        taken, left = float(h @ scaled_pinv(alone) @ h), 2.0 / OVERLAP * normal.rows[one.joint]
        level = max(abs(side) for side in (one.low, one.high) if np.isfinite(side))
        if (
            excess > 0
            and float(h @ scaled_pinv(covariance) @ h) > _CERTAIN**2
            and taken > _SHARE * (taken + left)
            and explained
            and np.all(c[inertias] > 0)
        ):
            margin = _MARGIN * _noise(tau[one.joint])
            limits.append(replace(one, low=one.low + margin, high=one.high - margin))
        elif explained and abs(excess) + _CERTAIN * std < _TRUE * level:
            sound.add(one.joint)
    return Saturation(tuple(limits), frozenset(sound))


def _levels(joint: int, tau: FloatArray) -> Limit | None:
    """The largest and smallest torque (N,), if it stands there for a while."""
    low, high = float(tau.min()), float(tau.max())
    at_low, at_high = np.count_nonzero(tau == low), np.count_nonzero(tau == high)
    if max(at_low, at_high) < _FEWEST or at_low + at_high > _MOST * tau.size:
        return None
    return Limit(
        joint, low if at_low >= _FEWEST else -np.inf, high if at_high >= _FEWEST else np.inf
    )


def sound(segments: Iterable[Segment], limits: Sequence[Limit]) -> Iterator[Segment]:
    """The stretches of a log's segments whose torques no limit cuts off, in time order.

    What is within `_GUARD` of a sample that lies beyond a limit is left out too: that a sample does
    not lie beyond it depends on its noise, which would not be nothing in the mean of what is left.
    What comes out does not depend on how the segments were cut.
    """
    if not limits:
        yield from segments
        return

    def beyond(piece: Segment) -> BoolArray:
        return np.any([one.beyond(piece.tau) for one in limits], axis=0)

    nothing = Segment(0.0, 1.0, *np.zeros((2, 2, 0)))
    before, kept = beyond(nothing), False  # of the samples before a piece, and of the last one
    for piece, after in pairwise(chain(pieces(segments, _PIECE_SAMPLES), [nothing])):
        near, own = max(2, round(_GUARD / piece.dt)), beyond(piece)
        first = before.size if piece.continues else 0
        next_ones = beyond(after.part(0, near if after.continues else 0))
        around = np.concatenate([before[:first], own, next_ones])
        if around.any():
            around = np.convolve(np.pad(around, near), np.ones(2 * near + 1), "valid") > 0.5
        inside = ~around[first : first + len(piece)]
        edges = np.flatnonzero(np.diff(inside, prepend=False, append=False))
        for start, end in edges.reshape(-1, 2).tolist():
            follows = piece.continues and kept and start == 0
            yield replace(piece.part(start, end), continues=follows)
        before, kept = own[-near:], bool(inside[-1])


def _plateaus(tau: FloatArray, dt: float, limit: Limit) -> FloatArray:
    """One, and a parabola that ends at zero, (2, N) while the torque stands at a limit.

    Each with the limit's sign.
    """
    columns = np.zeros((2, tau.size))
    for sign, at in ((1.0, tau >= limit.high), (-1.0, tau <= limit.low)):
        places = np.flatnonzero(at)
        if not places.size:
            continue
        for run in np.split(places, np.flatnonzero(np.diff(places) > _APART) + 1):
            inside = slice(run[0], run[-1] + 1)
            count = run[-1] - run[0] + 2
            step = np.arange(1, count)
            columns[0, inside] = sign
            columns[1, inside] = sign * step * (count - step) * dt**2
    return columns


def _noise(tau: FloatArray) -> float:
    """Standard deviation of a torque's noise, by its third differences.

    Those where it stands at a limit are nothing, and are left out.
    """
    off = np.abs(np.diff(tau, 3))
    off = off[off > 0]
    if not off.size:
        return 0.0
    return 1.4826 * median(off) / np.sqrt(20.0)
