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
from dataclasses import dataclass, field

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


@dataclass(frozen=True, eq=False)
class PredictionScore:
    """Samples, and sums (9, 2) over them by joint.

    Of the torque; of squares of torque, of the model's parts and of the residual; then samples and
    squares of the residual of joints that move, the same of those that stand, and d²: `sums_of`.
    """

    count: float = 0.0
    sums: FloatArray = field(default_factory=lambda: np.zeros((9, 2)))

    def __add__(self, other: PredictionScore) -> PredictionScore:
        return PredictionScore(self.count + other.count, self.sums + other.sums)

    @property
    def rmse(self) -> FloatArray:
        """Root mean square of the residual (2,) in N m."""
        return np.sqrt(self.sums[3] / max(self.count, 1.0))

    @property
    def nrmse(self) -> FloatArray:
        """RMSE over the torque's root mean square (2,).

        Of a joint without torque over the other joint's.
        """
        return self._beside(self._of_drive(self.sums[1]))

    @property
    def of_load(self) -> FloatArray:
        """RMSE over the RMS (2,) of the torque, or of the model's parts where that is larger.

        A joint that is hardly driven has little torque, since inertia, weight and friction make up
        for one another there.
        """
        return self._beside(np.maximum(self._of_drive(self.sums[1]), self.sums[2]))

    def _beside(self, squares: FloatArray) -> FloatArray:
        return np.sqrt(self.sums[3] / np.maximum(squares, 1e-300))

    @property
    def r2(self) -> FloatArray:
        """Share of the torque's variance that is predicted (2,).

        Of a joint without torque, of the other joint's.
        """
        spread = self.sums[1] - self.sums[0] ** 2 / max(self.count, 1.0)
        return 1 - self.sums[3] / np.maximum(self._of_drive(spread), 1e-300)

    @property
    def by_state(self) -> FloatArray:
        """RMSE (3, 2) in N m of joints that move, of ones that stand, and of these past friction.

        NaN where it never does.
        """
        count = self.sums[[4, 6, 6]]
        return np.sqrt(
            np.divide(self.sums[[5, 7, 8]], count, out=np.full((3, 2), np.nan), where=count > 0)
        )

    def _of_drive(self, power: FloatArray) -> FloatArray:
        """`power` (2,), of a joint without a motor that of the one that drives the arm."""
        return np.where(self.sums[1] > 0, power, power[::-1])


def sums_of(model: Model, c: FloatArray, X: FloatArray, omega: FloatArray) -> FloatArray:
    """Sums (9, 2) over n samples by joint, as `PredictionScore` holds them.

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
    for joint, name in enumerate((F1, F2)):
        place = model.compiled.place.get(name)
        if place is not None:
            f = max(float(c[place]), 0.0)
            held[joint] = np.maximum(np.abs(r[joint] + f * X[joint, place]) - f, 0.0)
    rows = [tau, tau**2, np.sum(parts**2, axis=1), r**2]
    rows += [~still, ~still * r**2, still, still * r**2, still * held**2]
    return np.array([row.sum(axis=1) for row in rows])


def _decimated(piece: Segment) -> Segment:
    """Angles and torques at the filter's rate."""
    step = int(1 / (_PER_CUTOFF * MOTION * piece.dt))
    kernel = smoother(piece.dt, _SHARPER * MOTION)
    if step < 2 or len(piece) < kernel.size:
        return piece
    start = piece.start + piece.dt * (kernel.size // 2)
    theta, tau = (correlate(signals, kernel, step) for signals in (piece.theta, piece.tau))
    return Segment(start, step * piece.dt, theta, tau)


@dataclass(frozen=True, eq=False)
class ScoredTorque:
    """Times (n,) in s of a piece, X (2, q + 1, n) as the filters leave it, velocities (2, n)."""

    t: FloatArray
    X: FloatArray
    omega: FloatArray


def scored_torque(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    shift: TorqueShift = AT_ONCE,
) -> Iterator[ScoredTorque]:
    """What `score` scores, piece by piece.

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
        yield ScoredTorque(thin.t[kept], X[:, 1:], X[:, 0])


def motion_of(theta: FloatArray, dt: float) -> Motion:
    """Motion within its band, with derivatives by five points.

    The two samples at each end repeat their neighbour's.
    """
    theta = butterworth(theta, dt, min(MOTION, 0.45 / dt))
    rates = []
    for weights in (_SLOPE / dt, _BEND / dt**2):
        inner = [np.correlate(angle, weights) for angle in theta]
        rates.append(np.pad(inner, ((0, 0), (2, 2)), mode="edge"))
    return Motion(theta, *rates)


def score(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    shift: TorqueShift = AT_ONCE,
) -> PredictionScore:
    """How well the coefficients `c` (q,) predict a log's torque; see the module."""
    every = [
        PredictionScore(float(piece.t.size), sums_of(model, c, piece.X, piece.omega))
        for piece in scored_torque(model, c, segments, shift)
    ]
    return sum(every, PredictionScore())


def cross_validate(
    fit: Fit,
    unloaded: Sequence[Source],
    loaded: Sequence[Source] = (),
    shift: TorqueShift = AT_ONCE,
) -> PredictionScore | None:
    """Score of each log predicted from all the others; None where a kind of log has only one.

    The other logs' parameters follow from their quadratic likelihoods, without a further pass;
    only the prediction reads the logs again. `shift` is what is known of the time after which a
    torque acts: a delay that the fit estimates comes on top, each time as the other logs have it.
    """
    sources = list(unloaded) + list(loaded)
    if len(sources) != len(fit.logs) or len(unloaded) == 1 or len(loaded) == 1:
        return None
    total = PredictionScore()
    columns = len(fit.shared.model.names)
    without = left_out(fit.shared, fit.logs, fit.values, fit.prior)
    for source, log, beta in zip(sources, fit.logs, without, strict=True):
        c = fit.shared.coefficients(beta, log.loaded)
        delay = float(c[columns:].sum())
        total += score(fit.shared.model, c[:columns], source(), shift.later(delay))
    return total


HORIZONS = (0.1, 0.5, 2.0)
"""s after which the angles are compared."""
_STARTS = 400  # of a log, at most
_CLOSEST = 0.05  # s between starts
_POSES = 8  # of joint 2, at which the arm's stiffness is looked at
_LONGEST, _SHORTEST = 2e-3, 1.25e-4  # s of a step


@dataclass(frozen=True, eq=False)
class RolloutScore:
    """By horizon (H,): starts.

    Squares (2, H, 2) in rad², by horizon and joint: of errors, and of distances moved.
    """

    count: FloatArray = field(default_factory=lambda: np.zeros(len(HORIZONS)))
    squares: FloatArray = field(default_factory=lambda: np.zeros((2, len(HORIZONS), 2)))

    def __add__(self, other: RolloutScore) -> RolloutScore:
        return RolloutScore(self.count + other.count, self.squares + other.squares)

    @property
    def rmse(self) -> FloatArray:
        """RMSE (H, 2) of the angles in rad.

        NaN without a start, infinite where the simulation runs away.
        """
        return self._root_mean()[0]

    @property
    def distance(self) -> FloatArray:
        """RMS (H, 2) in rad of the joints' travel: the RMSE of an arm that stays where it is."""
        return self._root_mean()[1]

    def _root_mean(self) -> FloatArray:
        mean = self.squares / np.maximum(self.count, 1)[:, None]
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
    made = list(_starts(segments, max(_CLOSEST, duration / _STARTS), step, shift, model.lag(c)))
    if not made:
        return RolloutScore()
    x, u, y = (np.concatenate(parts, axis=-1) for parts in zip(*made, strict=True))
    judged = np.isfinite(y)
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.stack([_angles_at_horizons(model, c, x, u, step) - y, y - x[:2]])
        # an angle that is no number has run away
        squares = np.where(judged, np.where(np.isnan(off), np.inf, off) ** 2, 0.0)
    return RolloutScore(judged[:, 0].sum(axis=1).astype(np.float64), squares.sum(axis=3))


def time_step(model: Model, c: FloatArray) -> float:
    """Time step in s that the stiffest friction of either joint, at rest, leaves stable.

    It divides the horizons.
    """
    around = np.linspace(0, 2 * np.pi, _POSES, endpoint=False)
    (outer, coupling), (_, inner) = inertia(model, c, np.stack([np.zeros_like(around), around]))
    rest = Motion(*np.zeros((3, 2, 1)))
    slope = np.abs(partials(model, c, rest)[1, (0, 1), (0, 1), 0])
    least = np.maximum(outer * inner - coupling**2, 1e-3 * outer * inner)
    # in 1/s, at which friction stops a joint in its worst pose
    rate = float(np.max(np.maximum(slope[0] * inner, slope[1] * outer) / least))
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


def _angles_at_horizons(
    model: Model, c: FloatArray, x: FloatArray, u: FloatArray, step: float
) -> FloatArray:
    """Angles (H, 2, S) at each horizon, by the classical Runge-Kutta method of fourth order."""
    angles: list[FloatArray] = []
    ends = [round(horizon / step) for horizon in HORIZONS]
    # an arm far from the log's may run away: its error is infinite then
    with np.errstate(all="ignore"):
        for number in range(ends[-1]):
            x = advanced(model, c, x, u[2 * number : 2 * number + 3], step)
            if number + 1 in ends:
                angles.append(x[:2])
    return np.stack(angles)
