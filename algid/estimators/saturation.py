"""Torques that a sensor or a drive cuts off at a limit, told by the motion.

A torque may be limited and logged as it is: nothing is wrong then. Where a sensor reaches the end
of its range, the arm gets more than the log holds; where a drive reaches its limit and the log
holds what was commanded, the arm gets less. With h what the arm gets beyond the logged torque τ,
the equations of `algid.estimators.modulating_functions` are

    ∫φ τ = X c − ∫φ h

- Of a sensor, h is looked for where τ stands at its largest or at its smallest value: a mean and a
  parabola over each time that it stands there, as a smooth peak that is cut off has.
- Of a drive with the limit ±L, h = β (clip(τ, ±L) − τ) with β = 1, and L is looked for.

Each is believed where it is certain, makes up so much of what the equations leave that neither
friction nor a gain explains the same, and the arm that it leaves has inertia.

======  ============================================================  =====================
symbol  name                                                          shape
======  ============================================================  =====================
h       what the arm gets beyond the logged torque: m candidates      (m, N)
A       columns of the equations, then those of h, the torque last    (2, p, R)
gram    A Aᵀ by stretch of a window's length and joint                (B, 2, p, p)
======  ============================================================  =====================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.quantiles import median
from algid.estimators.combine import scaled_pinv
from algid.estimators.modulating_functions import OVERLAP, Windows
from algid.estimators.selection import FIRST_TERMS
from algid.estimators.weak import WeakSettings, grams, overlapping
from algid.model import Model
from algid.signals.segments import Segment, append

Cause = Literal["sensor", "drive"]
BoolArray = NDArray[np.bool_]
Candidates = Callable[[FloatArray, float], FloatArray]
"""Gives of a joint's torque (N,) and the time between samples the candidates of h (m, N)."""

_ROUNDS = 3
_FEWEST = 6  # samples at a limit, or beyond one
_APART = 5  # samples: shorter breaks in a plateau are noise
_LEVELS = np.linspace(0.3, 0.98, 18)  # of the largest torque: limits of a drive that are tried
_FINE = np.linspace(-0.04, 0.04, 17)  # of the largest torque, around the best of them
_MOST = 0.5  # of the samples beyond the limit: more leave nothing to tell it by
_TRUE = 0.01  # of a torque at its limit: what the arm may get beyond a limit that is true
_PROMISING = 0.05  # of the squares of both joints: less is not looked at
_SHARE = {"sensor": 0.25, "drive": 0.85}
"""Of what a joint's equation leaves (squares): least that a limit makes up.

Plateaus tell where to look for a sensor's; a drive's is looked for at every level.
"""
_CERTAIN = 4.0  # standard deviations
_INERTIAS = ("k3", "k5")
_EXPLAINED = 0.9  # of the joint's torque, with the limit
_NEAR_ONE = 0.25  # of β
_MARGIN = 3.0  # standard deviations of the torque's noise: what is nearer to the limit is left out
_GUARD = 0.01  # s
_REWEIGHTINGS = 4


@dataclass(frozen=True)
class Limit:
    """Where a torque is cut off: what does not lie between `low` and `high` is not the joint's.

    `joint` is 0 or 1, `low` and `high` are in N m, infinite where the other side is sound.
    """

    joint: int
    cause: Cause
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


def saturation_of(pieces: Sequence[Segment], gravity: float = 9.81) -> Saturation:
    """Limits that cut off torques of a log, joint by joint.

    Parameters
    ----------
    pieces : segments of the log, in memory
    gravity : float, m/s^2
    """
    rows = _Rows.of(pieces, WeakSettings(model=Model(gravity=gravity, terms=FIRST_TERMS)))
    if rows is None:
        return UNSEEN
    limits: dict[int, Limit] = {}
    for look in (_at_plateaus, _beyond_drive):
        limits |= _looked(rows, look, limits)
    widened, true = [], set()
    for joint in (0, 1):
        if joint in limits:
            widened.append(_widened(rows, limits[joint]))
        elif _true(rows, limits, joint):
            true.add(joint)
    return Saturation(tuple(widened), frozenset(true))


def _looked(
    rows: _Rows, look: Callable[[_Rows, int], Limit | None], known: Mapping[int, Limit]
) -> dict[int, Limit]:
    """Limits that stand, of one cause and of joints that have none known.

    What cuts off one joint hides what cuts off the other: each is looked for beside the other's.
    """
    limits = dict(known)
    for _ in range(_ROUNDS):
        before = dict(limits)
        for joint in (0, 1):
            if joint not in known and rows.driven(joint):
                one = look(_with(rows, limits, joint), joint)
                if one is not None:
                    limits[joint] = one
        if limits == before:
            break
    wrong = _first_wrong(rows, limits)
    while wrong is not None:
        del limits[wrong.joint]
        wrong = _first_wrong(rows, limits)
    return limits


def _first_wrong(rows: _Rows, limits: Mapping[int, Limit]) -> Limit | None:
    """The first of the limits that does not stand beside the other; None where both do."""
    for one in limits.values():
        if not _stands(rows, limits, one):
            return one
    return None


def _with(rows: _Rows, limits: Mapping[int, Limit], but: int | None) -> _Rows:
    """The equations with these limits, but for that of the joint `but`."""
    for joint, one in limits.items():
        if joint != but:
            rows = rows.with_candidates(joint, _candidates_of(one))
    return rows


def _stands(rows: _Rows, limits: Mapping[int, Limit], one: Limit) -> bool:
    """Whether a limit is certain, beside that of the other joint, and is what it is taken for."""
    others = _with(rows, limits, one.joint)
    with_limit = others.with_candidates(one.joint, _candidates_of(one))
    columns = 2
    if one.cause == "drive":
        columns = 1
    after = _solved(with_limit.gram, columns)
    inertias = -after.rest[list(rows.inertias)]
    if np.any(inertias <= 0) or not _certain(_solved(others.gram, 0), after, one):
        return False
    if one.cause == "drive":
        return bool(abs(after.h[0] - 1) <= _NEAR_ONE)
    return _excess(rows, one, after)[0] > 0


def _true(rows: _Rows, limits: Mapping[int, Limit], joint: int) -> bool:
    """Whether the joint's torque stands at a limit, and the motion is sure that it is true."""
    one = _at_plateaus(rows, joint)
    if one is None:
        return False
    others = _with(rows, limits, joint)
    after = _solved(others.with_candidates(joint, _candidates_of(one)).gram, 2)
    mean, std = _excess(rows, one, after)
    level = max(abs(side) for side in (one.low, one.high) if np.isfinite(side))
    return bool(
        abs(mean) + _CERTAIN * std < _TRUE * level
        and after.squares[joint] < (1 - _EXPLAINED) * after.torque[joint]
    )


def _excess(rows: _Rows, one: Limit, after: _Solved) -> tuple[float, float]:
    """What the arm gets beyond a sensor's limit in the mean, in N m, and its deviation."""
    parts = [_plateaus(piece.tau[one.joint], piece.dt, one) for _, piece, _ in rows.parts]
    every = np.abs(np.concatenate(parts, axis=1))
    mean = every.sum(axis=1) / max(float(every[0].sum()), 1.0)
    return float(mean @ after.h), float(np.sqrt(max(mean @ after.covariance @ mean, 0.0)))


def _widened(rows: _Rows, one: Limit) -> Limit:
    """The limit less what noise and the levels that were tried leave open."""
    tau = rows.torque(one.joint)
    margin = _MARGIN * _noise(tau)
    if one.cause == "drive":
        margin += float(np.abs(tau).max() * (_FINE[1] - _FINE[0]))
    return replace(one, low=one.low + margin, high=one.high - margin)


def sound(segments: Iterable[Segment], limits: Sequence[Limit]) -> Iterator[Segment]:
    """The stretches of a log's segments whose torques no limit cuts off, in time order.

    What is within `_GUARD` of a sample that lies beyond a limit is left out too: that a sample does
    not lie beyond it depends on its noise, which would not be nothing in the mean of what is left.
    What comes out does not depend on how the segments were cut.
    """
    if not limits:
        yield from segments
        return
    held: Segment | None = None
    decided = 0  # samples of what is held that were given out, or left out
    for piece in segments:
        if held is not None and not piece.continues:
            yield from _cut(held, limits, decided, len(held))
            held = None
        if held is None:
            held, decided = piece, 0
        else:
            held = append(held, piece)
        guard = _guard(piece.dt)
        ready = max(decided, len(held) - guard)  # of the rest, what follows is not known yet
        yield from _cut(held, limits, decided, ready)
        first = max(0, ready - guard - 1)
        held, decided = held.part(first, len(held)), ready - first
    if held is not None:
        yield from _cut(held, limits, decided, len(held))


def _guard(dt: float) -> int:
    """Samples beside one beyond a limit that are left out."""
    return max(2, round(_GUARD / dt))


def _spread(beyond: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Samples (N,) that lie within `reach` of one that is `beyond`.

    (`scipy.ndimage.binary_dilation` does the same; its import takes longer than a short log.)
    """
    count = np.concatenate([[0], np.cumsum(np.pad(beyond, reach))])
    return np.asarray(count[2 * reach + 1 :] > count[: -2 * reach - 1])


def _cut(held: Segment, limits: Sequence[Limit], first: int, last: int) -> Iterator[Segment]:
    """The stretches from sample `first` to `last` - 1 that lie far enough from any limit."""
    beyond = np.zeros(len(held), dtype=bool)
    for one in limits:
        beyond |= one.beyond(held.tau)
    if beyond.any():
        beyond = _spread(beyond, _guard(held.dt))
    inside = np.concatenate([[True], beyond[first:last], [True]])
    edges = np.flatnonzero(np.diff(inside.astype(np.int8))) + first
    for start, end in edges.reshape(-1, 2).tolist():
        follows = held.continues
        if start:
            follows = not beyond[start - 1]
        yield replace(held.part(start, end), continues=follows)


@dataclass(frozen=True, eq=False)
class _Rows:
    """The equations of a log on windows, and candidates that are taken for true.

    `parts` holds of each piece its windows, itself and the equations' columns, the torque last;
    `inertias` are the places of the columns that any arm has with a positive coefficient.
    """

    parts: tuple[tuple[Windows, Segment, FloatArray], ...]
    inertias: tuple[int, ...]

    @classmethod
    def of(cls, pieces: Sequence[Segment], settings: WeakSettings) -> _Rows | None:
        """None where no piece is as long as a window."""
        parts = []
        for piece, windows, _ in overlapping(pieces, settings):
            X = windows.equations(settings.model, piece, True)
            if X.shape[2]:
                parts.append((windows, piece, X))
        if not parts:
            return None
        return cls(tuple(parts), tuple(map(settings.model.names.index, _INERTIAS)))

    def torque(self, joint: int) -> FloatArray:
        """The joint's torque (N,), the samples that windows share twice."""
        return np.concatenate([piece.tau[joint] for _, piece, _ in self.parts])

    def driven(self, joint: int) -> bool:
        """Whether the joint has a torque that varies."""
        return any(np.ptp(piece.tau[joint]) > 0 for _, piece, _ in self.parts)

    def with_candidates(self, joint: int, candidates: Candidates) -> _Rows:
        """The equations with columns of h of one joint more, before the torque."""
        parts = []
        for windows, piece, X in self.parts:
            moments = windows.torque_moments(candidates(piece.tau[joint], piece.dt))
            H = np.zeros((2, len(moments), X.shape[2]))
            H[joint] = moments
            parts.append((windows, piece, np.concatenate([X[:, :-1], H, X[:, -1:]], axis=1)))
        return replace(self, parts=tuple(parts))

    @cached_property
    def gram(self) -> FloatArray:
        """Gram matrices (B, 2, p, p) by stretch and joint."""
        return np.concatenate([grams(X, OVERLAP) for _, _, X in self.parts])


@dataclass(frozen=True, eq=False)
class _Solved:
    """Least squares on the columns: what the last of them tell.

    `h` (m,) are the last coefficients and `covariance` theirs, `squares` (2,) of what is left of
    each joint's equation, and `torque` (2,) the same of its torque; `rest` (p,) makes a residual of
    the columns, and `weights` (2,) were the joints'.
    """

    h: FloatArray
    covariance: FloatArray
    squares: FloatArray
    torque: FloatArray
    P: FloatArray
    weights: FloatArray
    rest: FloatArray


def _solved(gram: FloatArray, count: int) -> _Solved:
    """Weighted least squares; the last `count` columns but the torque are candidates of h.

    The joints weigh by what is left of their equations. The covariance holds for residuals that
    are correlated over neighbouring stretches (Newey & West 1987).
    """
    total = gram.sum(axis=0)
    torque = total[:, -1, -1]
    weights = np.ones(2)
    for _ in range(_REWEIGHTINGS):
        S = np.einsum("a,axy->xy", weights, total)
        P = scaled_pinv(S[:-1, :-1])
        rest = np.append(-P @ S[:-1, -1], 1.0)
        squares = np.einsum("x,axy,y->a", rest, total, rest)
        weights = 1 / np.maximum(squares, 1e-24 * torque.max() + 1e-300)
    scores = np.einsum("a,baxy,y->bx", weights, gram, rest)[:, :-1]
    neighbours = scores[:-1].T @ scores[1:]
    covariance = P @ (scores.T @ scores + 0.5 * (neighbours + neighbours.T)) @ P
    last = slice(rest.size - 1 - count, rest.size - 1)
    return _Solved(rest[last], covariance[last, last], squares, torque, P, weights, rest)


def _certain(before: _Solved, after: _Solved, one: Limit) -> bool:
    """Whether a limit is significant, and makes up much of what the joint's equation leaves."""
    joint = one.joint
    wald = float(after.h @ scaled_pinv(after.covariance) @ after.h)
    return bool(
        wald > _CERTAIN**2
        and after.squares[joint] < (1 - _SHARE[one.cause]) * before.squares[joint]
        and after.squares[joint] < (1 - _EXPLAINED) * after.torque[joint]
    )


def _at_plateaus(rows: _Rows, joint: int) -> Limit | None:
    """The limits of a sensor: the largest and smallest torque, if it stands there for a while."""
    tau = rows.torque(joint)
    low, high = float(tau.min()), float(tau.max())
    at_low, at_high = np.count_nonzero(tau == low), np.count_nonzero(tau == high)
    if max(at_low, at_high) < _FEWEST or at_low + at_high > _MOST * tau.size:
        return None
    return Limit(
        joint,
        "sensor",
        low if at_low >= _FEWEST else -np.inf,
        high if at_high >= _FEWEST else np.inf,
    )


def _beyond_drive(rows: _Rows, joint: int) -> Limit | None:
    """The likeliest limit of a drive that follows the logged torque no further."""
    largest = float(np.abs(rows.torque(joint)).max())
    before = _solved(rows.gram, 0)
    best = _best_level(rows, joint, before, largest * _LEVELS)
    if best is None or best[1] < _PROMISING:
        return None
    fine = best[0] + largest * _FINE
    best = _best_level(rows, joint, before, fine[fine < largest])
    return None if best is None else Limit(joint, "drive", -best[0], best[0])


def _best_level(
    rows: _Rows, joint: int, before: _Solved, levels: FloatArray
) -> tuple[float, float] | None:
    """The limit of a drive that explains most, and the share of the weighted squares it explains.

    Each is a column beside those of the equations (Frisch & Waugh 1933); the weights stay.
    """
    tau = np.abs(rows.torque(joint))
    beyond = np.array([np.count_nonzero(tau > level) for level in levels])
    levels = levels[(beyond >= _FEWEST) & (beyond <= _MOST * tau.size)]
    if not levels.size:
        return None
    S = np.einsum("a,axy->xy", before.weights, rows.gram.sum(axis=0))
    cross, squares = np.zeros((levels.size, S.shape[0])), np.zeros(levels.size)
    candidates = _beyond(levels)
    for windows, piece, X in rows.parts:
        moments = windows.torque_moments(candidates(piece.tau[joint], piece.dt))
        cross += before.weights[joint] * moments @ X[joint].T
        squares += before.weights[joint] * np.sum(moments**2, axis=1)
    left = cross @ before.rest
    across = cross[:, :-1]
    size = squares - np.einsum("mx,xy,my->m", across, before.P, across)
    least = 1e-9 * squares + 1e-300
    gain = np.where(size > least, left**2 / np.maximum(size, least), 0.0)
    best = int(np.argmax(gain))
    return float(levels[best]), float(gain[best] / (before.rest @ S @ before.rest))


def _beyond(levels: FloatArray) -> Candidates:
    """What a drive with the limits ± `levels` (m,) does not follow."""

    def candidates(tau: FloatArray, _: float) -> FloatArray:
        return np.asarray(np.clip(tau, -levels[:, None], levels[:, None]) - tau)

    return candidates


def _candidates_of(limit: Limit) -> Candidates:
    """Candidates of h for a limit: of a drive one, of a sensor two."""
    if limit.cause == "drive":
        return _beyond(np.array([limit.high]))

    def candidates(tau: FloatArray, dt: float) -> FloatArray:
        return _plateaus(tau, dt, limit)

    return candidates


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
