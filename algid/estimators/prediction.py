"""Torque predicted on logs, and how good the prediction is.

The motion passes a zero-phase Butterworth filter wide enough for what an arm does, and the model;
then what the model gives and the measured torque pass a second, narrower one. To filter the motion
so narrowly would be another motion: the model is not linear in it. Both filters run at
`_PER_CUTOFF` samples a period of the first one's cutoff, to which a sharper filter without phase
takes the log first; both ends of every stretch, where they ring, are dropped.

======  ==============================================================  ===============  ======
symbol  name                                                            shape            unit
======  ==============================================================  ===============  ======
X       filtered regressor of each joint, its torque last               (2, q + 1, n)    mixed
gram    X Xᵀ by joint: the residual of any c is (−c, 1) gram (−c, 1)ᵀ   (2, q+1, q+1)    mixed
======  ==============================================================  ===============  ======
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import left_out
from algid.estimators.elastic import flexed
from algid.estimators.fit import Fit
from algid.estimators.problem import Source
from algid.model import F1, F2, Model, Motion, regressor, torque
from algid.signals.filters import butterworth, correlate, smoother
from algid.signals.segments import Cutter, Segment, pieces_of
from algid.signals.shift import AT_ONCE, TorqueShift

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

    Of the torque; of squares of torque, of the model's parts and of the residual; and where one set
    of coefficients is scored those of `at_rest`.
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
        return np.sqrt(self.sums[3] / np.maximum(self._of_drive(self.sums[1]), 1e-300))

    @property
    def of_load(self) -> FloatArray:
        """RMSE over the RMS (2,) of the torque, or of the model's parts where that is larger.

        A joint that is hardly driven has little torque, since inertia, weight and friction make up
        for one another there.
        """
        acts = np.maximum(self._of_drive(self.sums[1]), self.sums[2])
        return np.sqrt(self.sums[3] / np.maximum(acts, 1e-300))

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


class PredictionSums:
    """What scores any coefficients on a log, gathered segment by segment.

    Parameters
    ----------
    model : Model
    shift : TorqueShift
        After how long a logged torque acts.
    at : (q,)
        The coefficients that are to be scored, and no others, where the model is not linear in
        them.
    """

    def __init__(
        self,
        model: Model,
        shift: TorqueShift = AT_ONCE,
        at: FloatArray | None = None,
    ) -> None:
        self._model = model
        self._at = at
        self._shift = shift
        self._cutter: Cutter | None = None
        size = len(model.names) + 1
        self._count, self._torque, self._gram = 0, np.zeros(2), np.zeros((2, size, size))
        self._at_rest = np.zeros((5, 2))

    def push(self, segment: Segment) -> None:
        """Take in the next segment of the log."""
        self._cutter = self._cutter or Cutter(max(1, round(_PIECE_SECONDS / segment.dt)))
        for piece in self._cutter.push(segment):
            self._add(piece)

    def finish(self) -> None:
        """Take in what is left at the end of the log."""
        if self._cutter is None:
            return
        for piece in self._cutter.finish():
            self._add(piece)

    def score(self, c: FloatArray) -> PredictionScore:
        """How well the coefficients `c` (q,) predict the torque."""
        v = np.append(-c, 1.0)
        residual = np.maximum(np.einsum("x,axy,y->a", v, self._gram, v), 0.0)
        parts = np.einsum("x,axx->a", c**2, self._gram[:, :-1, :-1])
        squares = [self._torque, self._gram[:, -1, -1], parts, residual]
        return PredictionScore(float(self._count), np.stack([*squares, *self._at_rest]))

    def _add(self, piece: Segment) -> None:
        shift = self._shift.at(piece.dt)
        if self._at is not None:
            shift -= self._model.lag(self._at)
        _, X = _filtered(self._rows, piece, shift)
        if not X.size:
            return
        if self._at is not None:
            X, omega = np.delete(X, -2, axis=1), X[:, -2]
            self._at_rest += at_rest(self._model, self._at, X, omega)
        self._count += X.shape[2]
        self._torque = self._torque + X[:, -1].sum(axis=1)
        self._gram += X @ X.swapaxes(1, 2)

    def _rows(self, motion: Motion, dt: float) -> FloatArray:
        """The regressor (2, q, n), and the velocities if one set of coefficients is scored."""
        if self._at is None:
            return regressor(self._model, motion)
        Y = regressor(self._model, flexed(self._model, self._at, motion, dt), self._at)
        return np.concatenate([Y, motion.omega[:, None]], axis=1)


def at_rest(model: Model, c: FloatArray, X: FloatArray, omega: FloatArray) -> FloatArray:
    """Samples and squared residuals of joints that move, the same of those at rest, and d² (5, 2).

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
    r = X[:, -1] - np.einsum("q,aqn->an", c, X[:, :-1])
    still = np.abs(omega) < model.coulomb_speed
    held = np.abs(r)
    for joint, name in enumerate((F1, F2)):
        if name in model.names:
            place = model.names.index(name)
            f = max(float(c[place]), 0.0)
            held[joint] = np.maximum(np.abs(r[joint] + f * X[joint, place]) - f, 0.0)
    rows = [~still, ~still * r**2, still, still * r**2, still * held**2]
    return np.array([row.sum(axis=1) for row in rows])


def _filtered(
    rows: Callable[[Motion, float], FloatArray], piece: Segment, shift: float
) -> tuple[FloatArray, FloatArray]:
    """Times (n,) in s and X (2, q + 1, n) of a piece, from the `rows` (2, q, n) of its motion.

    Empty where the piece is too short. See the module's table.
    """
    signals, dt, first = _decimated(piece)
    edge = round(DROPPED / dt)
    if signals.shape[1] <= max(2 * edge + 2, 6 * (ORDER + 1)):
        return np.zeros(0), np.zeros((2, 0, 0))
    theta = butterworth(signals[:2], dt, min(MOTION, 0.45 / dt))
    Y = rows(motion_of(theta, dt), dt)
    if shift:
        place = np.arange(signals.shape[1]) + shift / dt
        whole = np.clip(np.floor(place).astype(np.int64), 0, signals.shape[1] - 2)
        Y = Y[:, :, whole] + (place - whole) * (Y[:, :, whole + 1] - Y[:, :, whole])
    X = np.concatenate([Y, signals[2:, None]], axis=1)
    felt = np.asarray(X.any(axis=2))  # k4 is nothing to joint 2, k7 to joint 1
    alike = np.all(X[0] == X[1], axis=1)  # and k2, k3 to both the same
    felt[1] &= ~alike
    X[felt] = butterworth(X[felt], dt, min(CUTOFF, 0.45 / dt))
    X[1, alike] = X[0, alike]
    kept = np.arange(edge, signals.shape[1] - edge)
    return first + dt * kept, X[:, :, edge : signals.shape[1] - edge]


def _decimated(piece: Segment) -> tuple[FloatArray, float, float]:
    """Angles and torques (4, n) at the filter's rate, the period in s, and the first time in s."""
    step = int(1 / (_PER_CUTOFF * MOTION * piece.dt))
    signals = np.concatenate([piece.theta, piece.tau])
    kernel = smoother(piece.dt, _SHARPER * MOTION)
    if step < 2 or signals.shape[1] < kernel.size:
        return signals, piece.dt, piece.start
    first = piece.start + piece.dt * (kernel.size // 2)
    return correlate(signals, kernel, step), step * piece.dt, first


@dataclass(frozen=True, eq=False)
class ScoredTorque:
    """Times (n,) in s, the torque that is scored and its prediction (2, n) in N m."""

    t: FloatArray
    measured: FloatArray
    predicted: FloatArray


def scored_torque(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    shift: TorqueShift = AT_ONCE,
) -> Iterator[ScoredTorque]:
    """What `score` scores, piece by piece: both torques as the filters leave them.

    A piece that is too short to be scored is left out.
    """

    def rows(motion: Motion, dt: float) -> FloatArray:
        return torque(model, c, flexed(model, c, motion, dt))[:, None]

    for piece in pieces_of(segments, _PIECE_SECONDS):
        lag = shift.at(piece.dt) - model.lag(c)
        t, X = _filtered(rows, piece, lag)
        if X.size:
            yield ScoredTorque(t, X[:, 1], X[:, 0])


def motion_of(theta: FloatArray, dt: float) -> Motion:
    """Motion with derivatives by five points.

    The two samples at each end repeat their neighbour's.
    """
    return Motion(theta, _by_five(theta, _SLOPE / dt), _by_five(theta, _BEND / dt**2))


def _by_five(theta: FloatArray, weights: FloatArray) -> FloatArray:
    """Sums (2, N) of the five samples around each one of angles (2, N), with `weights` (5,)."""
    sums = np.empty(theta.shape)
    for own, angle in zip(sums, theta, strict=True):
        own[2:-2] = np.correlate(angle, weights)
    sums[:, :2], sums[:, -2:] = sums[:, 2:3], sums[:, -3:-2]
    return sums


def score(
    model: Model,
    c: FloatArray,
    segments: Iterable[Segment],
    shift: TorqueShift = AT_ONCE,
) -> PredictionScore:
    """How well the coefficients `c` (q,) predict a log's torque; see `PredictionSums`."""
    sums = PredictionSums(model, shift, c)
    for segment in segments:
        sums.push(segment)
    sums.finish()
    return sums.score(c)


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
    for place, (source, log) in enumerate(zip(sources, fit.logs, strict=True)):
        c = fit.shared.coefficients(without[place], log.loaded)
        delay = float(c[columns:].sum())
        total += score(fit.shared.model, c[:columns], source(), shift.later(delay))
    return total
