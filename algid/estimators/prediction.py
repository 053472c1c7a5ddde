"""Torque predicted on logs and angles simulated from their states, and how good both are.

The motion passes a zero-phase Butterworth filter wide enough for what an arm does, and the model;
then what the model gives and the measured torque pass a second, narrower one. To filter the motion
so narrowly would be another motion: the model is not linear in it. Both filters run at
`_PER_CUTOFF` samples a period of the first one's cutoff, to which a sharper filter without phase
takes the log first; both ends of every stretch, where they ring, are dropped.

A simulation starts every so often, all of them at once: Runge-Kutta of fourth order, torques
between samples on straight lines. Angles and velocities of the starts, and the angles to compare
with, pass the motion's filter.

======  ==============================================================  ===============  ======
symbol  name                                                            shape            unit
======  ==============================================================  ===============  ======
X       filtered regressor of each joint, its torque last               (2, q + 1, n)    mixed
x       state θ, ω at the starts                                        (4, S)           mixed
u       torques at each half step from each start                       (2 n + 1, 2, S)  N m
y       angles at the horizons; NaN past a stretch's end                (H, 2, S)        rad
======  ==============================================================  ===============  ======
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import left_out
from algid.estimators.elastic import flexed
from algid.estimators.fit import Fit
from algid.estimators.problem import Source
from algid.model import F1, F2, Model, Motion, advanced, inertia, partials, regressor
from algid.signals.differences import AT_ONCE, TorqueShift
from algid.signals.filters import butterworth, correlate, smoother
from algid.signals.segments import Segment, pieces

_PIECE_SECONDS = 60.0
_PER_CUTOFF = 12.5
# cutoffs: bandwidth of the decimating filter, whose stop band begins before its images matter
_SHARPER = 5.0
_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12  # of fourth order (Fornberg 1988)
_BEND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12


ORDER, MOTION, CUTOFF, DROPPED = 3, 20.0, 5.0, 0.3
"""Of the zero-phase filters: order, cutoffs of motion and of torque in Hz, s left out at ends."""
FILTER = (
    f"zero-phase Butterworth, order {ORDER}: motion {MOTION:g} Hz, then torque {CUTOFF:g} Hz; "
    f"{DROPPED:g} s dropped at each end"
)


NOTHING: FloatArray = np.zeros((9, 2))
"""What `score` gives of a log that is too short."""


def sums_of(model: Model, c: FloatArray, X: FloatArray, omega: FloatArray) -> FloatArray:
    """Sums (9, 2) over n samples by joint.

    Of the torque; of squares of torque, of the model's parts and of the residual; then samples and
    squares of the residual of joints that move, the same of those that stand, and d².

    Where a joint stands, dry friction is any torque up to ± f: no model predicts which. Of a joint
    slower than friction's step ω_s is therefore stated, beside the residual r, how far the torque
    lies from all that friction f may be there,

        d = |r + f tanh(ω / ω_s)| − f, where that is positive; else 0

    Parameters
    ----------
    model : Model
    c : (q,)
    X : (2, q + 1, n)
        Regressor of each joint, its torque last.
    omega : (2, n), rad/s
    """
    parts, tau = c[:, None] * X[:, :-1], X[:, -1]
    r = tau - parts.sum(axis=1)
    still = np.abs(omega) < model.coulomb_speed
    held = np.abs(r)
    if F1 in model.names:
        places = list(map(model.names.index, (F1, F2)))
        f = np.maximum(c[places], 0.0)[:, None]
        held = np.maximum(np.abs(r + f * X[[0, 1], places]) - f, 0.0)
    rows = [tau, tau**2, np.sum(parts**2, axis=1), r**2]
    rows += [~still, ~still * r**2, still, still * r**2, still * held**2]
    return np.sum(rows, axis=2)


def _decimated(piece: Segment) -> Segment:
    """Angles and torques at the filter's rate."""
    step = int(1 / (_PER_CUTOFF * MOTION * piece.dt))
    kernel = smoother(piece.dt, _SHARPER * MOTION)
    if step < 2 or len(piece) < kernel.size:
        return piece
    start = piece.start + piece.dt * (kernel.size // 2)
    theta, tau = (correlate(signals, kernel, step) for signals in (piece.theta, piece.tau))
    return Segment(start, step * piece.dt, theta, tau)


def scored_torque(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    shift: TorqueShift = AT_ONCE,
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """What `score` scores, piece by piece: times (n,) in s, velocities (2, n), and X.

    A piece that is too short to be scored is left out. See the module's table.
    """
    for piece in pieces(segments, lambda dt: round(_PIECE_SECONDS / dt)):
        thin = _decimated(piece)
        dt, n = thin.dt, len(thin)
        edge = round(DROPPED / dt)
        if n <= max(2 * edge + 2, 6 * (ORDER + 1)):
            continue
        motion = motion_of(thin.theta, dt)
        Y = regressor(model, flexed(model, c, motion, dt), c)
        Y = np.concatenate([motion.omega[:, None], Y], axis=1)
        late = shift.at(piece.dt) - model.lag(c)
        if late:
            place = np.arange(n) + late / dt
            whole = np.clip(np.floor(place).astype(np.int64), 0, n - 2)
            Y = Y[:, :, whole] + (place - whole) * (Y[:, :, whole + 1] - Y[:, :, whole])
        X = np.concatenate([Y, thin.tau[:, None]], axis=1)
        low = butterworth(X.reshape(-1, n), dt, min(CUTOFF, 0.45 / dt))
        kept = slice(edge, n - edge)
        X = low.reshape(X.shape)[:, :, kept]
        yield thin.t[kept], X[:, 0], X[:, 1:]


def motion_of(theta: FloatArray, dt: float) -> Motion:
    """Motion within its band, with derivatives by five points.

    The two samples at each end repeat their neighbour's.
    """
    theta = butterworth(theta, dt, min(MOTION, 0.45 / dt))
    rates = []
    for weights in (_SLOPE / dt, _BEND / dt**2):
        rates.append(np.pad(correlate(theta, weights), ((0, 0), (2, 2)), mode="edge"))
    return Motion(theta, *rates)


def score(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    shift: TorqueShift = AT_ONCE,
) -> FloatArray:
    """How well the coefficients `c` (q,) predict a log's torque, as `sums_of`; see the module."""
    every = scored_torque(model, c, segments, shift)
    return sum((sums_of(model, c, X, omega) for _, omega, X in every), NOTHING)


def cross_validate(fit: Fit, sources: Sequence[Source], shift: TorqueShift = AT_ONCE) -> FloatArray:
    """Score of each log predicted from all the others; nothing where a kind of log has only one.

    The other logs' parameters follow from their quadratic likelihoods, without a further pass;
    only the prediction reads the logs again. `shift` is what is known of the time after which a
    torque acts: a delay that the fit estimates comes on top, each time as the other logs have it.
    """
    kinds = [log.loaded for log in fit.logs]
    if len(sources) != len(kinds) or 1 in map(kinds.count, kinds):
        return NOTHING
    total, columns = NOTHING, len(fit.shared.model.names)
    without = left_out(fit.shared, fit.logs, fit.values, fit.prior)
    for source, log, beta in zip(sources, fit.logs, without, strict=True):
        c = fit.shared.coefficients(beta, log.loaded)
        delay = float(c[columns:].sum())
        total = total + score(fit.shared.model, c[:columns], source(), shift.later(delay))
    return total


HORIZONS = (0.1, 0.5, 2.0)
"""s after which the angles are compared."""
_STARTS = 400  # of a log, at most
_CLOSEST = 0.05  # s between starts
_POSES = 8  # of joint 2, at which the arm's stiffness is looked at
_LONGEST, _SHORTEST = 2e-3, 1.25e-4  # s of a step


def rollouts(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    duration: float,
    shift: TorqueShift = AT_ONCE,
) -> FloatArray:
    """Simulate forward from states of a log of `duration` s by the coefficients `c` (q,).

    `shift` is the time in s after which a logged torque acts, as for `scored_torque`.

    Returns
    -------
    Sums (3, H, 2) over the starts by horizon and joint: their number, and in rad² squares of errors
    and of distances moved. Infinite where the simulation runs away.
    """
    step = time_step(model, c)
    made = list(_starts(segments, max(_CLOSEST, duration / _STARTS), step, shift, model.lag(c)))
    if not made:
        return np.zeros((3, len(HORIZONS), 2))
    x, u, y = (np.concatenate(parts, axis=-1) for parts in zip(*made, strict=True))
    judged, angles, state = np.isfinite(y), [], x
    # an arm far from the log's may run away: its error is infinite then
    with np.errstate(all="ignore"):
        for first, horizon in pairwise((0.0, *HORIZONS)):
            for number in range(round(first / step), round(horizon / step)):
                state = advanced(model, c, state, u[2 * number : 2 * number + 3], step)
            angles.append(state[:2])
        off = np.stack([np.stack(angles) - y, y - x[:2]])
        squares = np.where(judged, np.where(np.isnan(off), np.inf, off) ** 2, 0.0)
    return np.concatenate([judged[None], squares]).sum(axis=3)


def time_step(model: Model, c: FloatArray) -> float:
    """Time step in s that the stiffest friction of either joint, at rest, leaves stable.

    It divides the horizons.
    """
    around = np.linspace(0, 2 * np.pi, _POSES, endpoint=False)
    M = inertia(model, c, np.stack([np.zeros_like(around), around]))
    slope = partials(model, c, Motion(*np.zeros((3, 2, 1))))[1, :, :, 0]
    # in 1/s, at which friction stops a joint in its worst pose
    rate = np.abs(np.linalg.pinv(M.T).diagonal(axis1=1, axis2=2) * np.diag(slope)).max()
    step = _LONGEST
    while step * rate > 1 and step > _SHORTEST:
        step /= 2
    return step


def _starts(
    segments: Iterable[Segment], spacing: float, step: float, shift: TorqueShift, lag: float
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """x, u and y of the starts in a log that have the first horizon ahead of them, by pieces."""
    for piece in pieces(segments, lambda dt: round(_PIECE_SECONDS / dt)):
        dt, n = piece.dt, len(piece)
        edge, first = round(DROPPED / dt), round(HORIZONS[0] / dt)
        at = np.arange(edge, n - edge - first, max(1, round(spacing / dt)))
        if n <= 6 * (ORDER + 1) or not at.size:
            continue
        motion, t = motion_of(piece.theta, dt), np.arange(n)
        halves = 0.5 * step / dt * np.arange(2 * round(HORIZONS[-1] / step) + 1)
        when = at + halves[:, None] - (shift.at(dt) - lag) / dt
        ahead = at + np.array(HORIZONS)[:, None] / dt
        u = np.stack([np.interp(when, t, tau) for tau in piece.tau], axis=1)
        y = np.stack([np.interp(ahead, t, theta) for theta in motion.theta], axis=1)
        y = np.where(ahead[:, None] > n - 1 - edge, np.nan, y)
        yield np.concatenate([motion.theta[:, at], motion.omega[:, at]]), u, y
