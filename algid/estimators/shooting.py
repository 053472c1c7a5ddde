"""Errors in variables of a motion that is sampled coarsely: integrated from sample to sample.

The angles at both ends of an interval and the torque within it fix the motion between, and so the
velocities with which it begins, ω⁺, and ends, ω⁻. At every sample between two intervals

    r = ω⁺(θ[n], θ[n+1], u; c) − ω⁻(θ[n−1], θ[n], u; c) = 0

however far the arm turns from sample to sample: the discrete Euler-Lagrange equation with the
exact discrete Lagrangian (Marsden & West 2001, sec. 1.6), with friction. The classical Runge-Kutta
method integrates every interval and its variational equations; Newton's method finds ω⁺ (multiple
shooting, Bock 1981). Divided by what a torque makes of it, r is a mean torque over two intervals,

    e = W (r + ∂r/∂θ (θ_m − θ0)) = F η − G ε + Y δc
    W = (Σ_k ∂r/∂u[k])⁻¹,   F = W ∂r/∂u,   G = −W ∂r/∂θ,   Y = −W ∂r/∂c

which is the residual of `algid.estimators.whitening` with three angles in place of a stencil's, and
with the torque's noise spread by F over the samples k that the two intervals rest on.

======  ===========================================================  ==============  ======
symbol  name                                                         shape           unit
======  ===========================================================  ==============  ======
x       state θ, ω                                                   (4, n)          mixed
u       torque at three stages of each step                          (m, 3, 2, n)    N m
X       derivatives of x by what each column stands for              (4, K, n)       mixed
F       share of each sample's torque in e                           (2, 2, k, n)    1
======  ===========================================================  ==============  ======
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.estimators.rollout import stiffness
from algid.estimators.whitening import (
    Linearised,
    NoiseLevels,
    adjoint,
    factored,
    forward,
    products,
    triangular,
)
from algid.model import Model, Motion, acceleration, partials, sensitivity
from algid.signals.between import KNOTS, Between, between
from algid.signals.differences import Stencil
from algid.signals.segments import Segment

_TURN = 0.2  # rad of a step, whose error then is 1e-6 of it
_FEWEST_STEPS = 3
_MOST_STEPS = 48
_FEWEST_INTERVALS = 8
_ITERATIONS = 40
_JOINED = 1e-9  # rad, from which one more iteration has led on
_VARIED = 1e-4  # rad/s, by which a velocity is varied
_STABLE = 2.0  # product of a step and friction's rate; Runge and Kutta's limit is 2.78
_BENT = 0.25  # of a velocity's change in an interval, by which it may be nearer to rest within
_WIDTHS = 5.0  # of friction's step, in which it is no constant
_CLOSER = 0.2  # of the distance that was left before
_DELAYED = 1e-3  # samples by which a delay is varied
_STATE = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class Shot(Linearised):
    """One piece of log, integrated from sample to sample, linearised and whitened.

    Parameters
    ----------
    F : (2, 2, k, n), by row's joint, torque's joint and sample, in units of the torques' noise
    first_torque : int
        Torque sample that the first residual begins with.
    length : int
        Samples of the piece.
    beginning : (2, m), rad/s
        Velocities with which the intervals begin.
    """

    F: FloatArray
    first_torque: int
    length: int
    beginning: FloatArray

    @property
    def torques(self) -> int:
        """Torque samples, of which there is noise."""
        return self.length

    def smeared(self, torques: FloatArray) -> FloatArray:
        """F of torque noise (..., N)."""
        rows = [forward(self.F, one, self.first_torque) for one in _pairs(torques)]
        return np.stack(rows).reshape(*torques.shape[:-1], -1)

    def smeared_back(self, rows: FloatArray) -> FloatArray:
        """Fᵀ of rows (..., n)."""
        found = [adjoint(self.F, one, self.first_torque, self.length) for one in _pairs(rows)]
        return np.stack(found).reshape(*rows.shape[:-1], -1)


def _pairs(signals: FloatArray) -> FloatArray:
    return signals.reshape(-1, 2, signals.shape[-1])


@dataclass(frozen=True, eq=False)
class Driving:
    """What drives intervals: torques u, their noise's weights w, and torques beside of columns.

    Parameters
    ----------
    u : (m, 3, 2, n), N m
    noise : Between
    beside : (m, 3, 2, b, n), N m over the column's unit
    """

    u: FloatArray
    noise: Between
    beside: FloatArray


def linearise(
    model: Model,
    c: FloatArray,
    theta0: FloatArray,
    piece: Segment,
    stencil: Stencil,
    noise: NoiseLevels,
    delay: bool = False,
    *,
    residual_only: bool = False,
    beginning: FloatArray | None = None,
) -> Shot:
    """Linearise a piece of log from sample to sample, and whiten it.

    Parameters
    ----------
    model : Model, without a low-pass
    c : (q,), in `algid.model.UNITS`
    theta0 : (2, N), rad
        The trajectory, near the truth.
    piece : Segment of N samples
    stencil : Stencil
        Its shift and hold say when a logged torque acts; its weights are not used.
    noise : NoiseLevels
    delay : bool
        Whether the last column but the residual is the derivative of the torque by its delay.
    residual_only : bool
        Whether the residual is the only column.
    beginning : (2, m), rad/s
        Of an earlier `Shot` of the piece, from where Newton's method starts.

    Raises
    ------
    numpy.linalg.LinAlgError
        If no motion joins the angles, or the covariance is not positive definite.
    """
    late = stencil.shift / stencil.dt
    if stencil.held:
        late -= 0.5  # which is its mean effect, not when it acts
    with np.errstate(all="ignore"):  # coefficients far off run away, which is found out
        return _whitened(
            *_residual(model, c, theta0, piece, late, stencil.held, delay, beginning),
            piece,
            theta0,
            noise,
            residual_only=residual_only,
        )


@dataclass(frozen=True, eq=False)
class _Residual:
    """The residual e (2, n), F, G and Y (2, q, n) before whitening, and where they begin."""

    e: FloatArray
    F: FloatArray
    G: FloatArray
    Y: FloatArray
    first: int
    first_torque: int
    beginning: FloatArray


def _residual(
    model: Model,
    c: FloatArray,
    theta0: FloatArray,
    piece: Segment,
    late: float,
    held: bool,
    delay: bool,
    guess: FloatArray | None,
) -> tuple[_Residual, Motion]:
    """The residual of a piece and its derivatives, and the motion (2, n) where it stands."""
    N, dt = theta0.shape[1], piece.dt
    # the same intervals whatever the hold: likelihoods of both are compared
    low = min(max(0, KNOTS // 2 - 1 + ceil(late)), N)
    n = max(0, min(N - 1, N - KNOTS // 2 + int(np.floor(late))) - low)
    if n < _FEWEST_INTERVALS:
        raise np.linalg.LinAlgError("the piece is shorter than what its torque rests on")
    theta = theta0[:, low : low + n + 1]
    if guess is None or guess.shape != (2, n):
        guess = np.gradient(theta, dt, axis=1)[:, :-1]
    omega, end, torque = np.empty((2, n)), np.empty((4, n)), np.empty((2, n))
    k = between(late, 1, held=held, points=2).count
    X = np.empty((4, _STATE + 2 * k + c.size + delay, n))
    for own, steps in _by_steps(model, c, theta, dt):
        drive = _driving(piece, low, n, own, late, steps, held=held, delay=delay)
        ends = theta[:, own], theta[:, own + 1]
        omega[:, own] = _beginning(model, c, ends, guess[:, own], drive.u, dt)
        begin = np.concatenate([ends[0], omega[:, own]])
        end[:, own], X[:, :, own] = integrate(model, c, begin, drive, dt)
        torque[:, own] = drive.u[0, 0]
    if not np.all(np.isfinite(X)):
        raise np.linalg.LinAlgError("the motion runs away between two samples")
    # velocities at the ends of an interval by the angles there and by the rest
    by_next = inverted(X[:2, 2:4])
    plus_theta, plus_rest = -times(by_next, X[:2, :2]), -times(by_next, X[:2, 4:])
    along = X[2:, 2:4]
    minus_theta, minus_next = X[2:, :2] + times(along, plus_theta), times(along, by_next)
    minus_rest = X[2:, 4:] + times(along, plus_rest)
    middle = plus_theta[..., 1:] - minus_next[..., :-1]
    r_theta = np.stack([-minus_theta[..., :-1], middle, by_next[..., 1:]], axis=2)
    r_u = np.zeros((2, 2, k + 1, n - 1))
    for sample in range(k):
        pair = slice(2 * sample, 2 * sample + 2)
        r_u[:, :, sample] -= minus_rest[:, pair, :-1]
        r_u[:, :, sample + 1] += plus_rest[:, pair, 1:]
    r_c = plus_rest[:, 2 * k :, 1:] - minus_rest[:, 2 * k :, :-1]
    W = inverted(r_u.sum(axis=2))
    e = times(W, (omega[:, 1:] - end[2:, :-1])[:, None])[:, 0]
    G = -np.stack([times(W, r_theta[:, :, point]) for point in range(3)], axis=2)
    F = np.stack([times(W, r_u[:, :, sample]) for sample in range(k + 1)], axis=2)
    at = Motion(
        theta[:, 1:-1],
        omega[:, 1:],
        acceleration(model, c, theta[:, 1:-1], omega[:, 1:], torque[:, 1:]),
    )
    first_torque = low + between(late, 1, held=held, points=2).first
    return _Residual(e, F, G, -times(W, r_c), low, first_torque, omega), at


def _by_steps(
    model: Model, c: FloatArray, theta: FloatArray, dt: float
) -> Iterator[tuple[NDArray[np.int64], int]]:
    """Intervals (m,) between angles (2, n + 1), and how many steps each of them is given.

    In a step the arm turns little; where a joint may stand, friction at rest is stable too.
    """
    speed = np.diff(theta, axis=1) / dt
    turned = float(np.abs(speed).max()) * dt / _TURN
    stiff = dt * stiffness(model, c) / _STABLE
    every = np.arange(speed.shape[1])
    usual = max(_FEWEST_STEPS, ceil(min(turned, _MOST_STEPS)))
    if stiff < usual:
        yield every, usual
        return
    omega = np.gradient(theta, dt, axis=1)
    first, last = omega[:, :-1], omega[:, 1:]
    nearest = np.where(first * last > 0, np.minimum(np.abs(first), np.abs(last)), 0.0)
    reach = _BENT * np.abs(last - first) + _WIDTHS * model.coulomb_speed
    stands = np.any(nearest < reach, axis=0)
    if not np.all(stands):
        yield every[~stands], usual
    if np.any(stands):
        yield every[stands], ceil(min(stiff, _MOST_STEPS)) if np.isfinite(stiff) else _MOST_STEPS


def _driving(
    piece: Segment,
    low: int,
    n: int,
    own: NDArray[np.int64],
    late: float,
    steps: int,
    *,
    held: bool,
    delay: bool,
) -> Driving:
    """What drives the intervals `own` of the n from sample `low` on, in so many steps."""

    def stages(late: float) -> FloatArray:
        return between(late, steps, held=held).at_stages(piece.tau, low, n)[..., own]

    beside = np.empty((steps, 3, 2, 0, own.size))
    if delay:
        change = stages(late + _DELAYED) - stages(late - _DELAYED)
        beside = (change / (2 * _DELAYED * piece.dt))[:, :, :, None]
    return Driving(stages(late), between(late, steps, held=held, points=2), beside)


def _whitened(
    raw: _Residual,
    motion: Motion,
    piece: Segment,
    theta0: FloatArray,
    noise: NoiseLevels,
    *,
    residual_only: bool,
) -> Shot:
    error = raw.e - forward(raw.G, piece.theta - theta0, raw.first)
    by_torque = noise.tau[:, None, None, None]
    H = np.ascontiguousarray(raw.G * (noise.theta[None, :, None, None] / by_torque))
    F = np.ascontiguousarray(raw.F * (noise.tau[None, :, None, None] / by_torque))
    lags = max(H.shape[2], F.shape[2])
    factor = factored(products(H, lags) + products(F, lags))
    rows = error[None]
    if not residual_only:
        rows = np.concatenate([raw.Y.swapaxes(0, 1), rows])
    rows = np.ascontiguousarray((rows / noise.tau[None, :, None]).swapaxes(1, 2))
    columns = triangular(factor, rows.reshape(rows.shape[0], -1), "N", in_place=True)
    return Shot(
        columns,
        factor,
        H,
        raw.first,
        error,
        motion,
        F=F,
        first_torque=raw.first_torque,
        length=theta0.shape[1],
        beginning=raw.beginning,
    )


def _beginning(
    model: Model,
    c: FloatArray,
    ends: tuple[FloatArray, FloatArray],
    omega: FloatArray,
    u: FloatArray,
    dt: float,
) -> FloatArray:
    """Velocities ω⁺ (2, n) of the motions between angles at both `ends`, from a guess `omega`."""
    nearest = np.full(omega.shape[1], np.inf)
    best, step, share = omega, np.zeros_like(omega), np.ones_like(nearest)
    inverse, before, quick = None, np.inf, True
    for _ in range(_ITERATIONS):
        if inverse is None or not quick:
            reached, slope = _reached(model, c, ends[0], omega, u, dt)
            inverse = inverted(slope)
        else:
            reached = advanced(model, c, np.concatenate([ends[0], omega]), u, dt)[:2]
        miss = ends[1] - reached
        distance = np.abs(miss).max(axis=0)
        better = distance < nearest
        nearest = np.where(better, distance, nearest)
        best = np.where(better, omega, best)
        step = np.where(better, times(inverse, miss[:, None])[:, 0], step)
        share = np.where(better, 1.0, 0.5 * share)  # friction's step may lead too far
        omega = best + share * step
        largest = float(nearest.max())
        if largest < _JOINED:
            return omega
        # the first derivatives lead there, or else new ones each time
        quick, before = quick and largest < _CLOSER * before, largest
    raise np.linalg.LinAlgError("no motion was found that joins the angles")


def _reached(
    model: Model, c: FloatArray, theta: FloatArray, omega: FloatArray, u: FloatArray, dt: float
) -> tuple[FloatArray, FloatArray]:
    """Angles (2, n) after an interval, and their derivatives (2, 2, n) by ω⁺, by differences."""
    n = omega.shape[1]
    begin = np.concatenate([np.tile(theta, 3), np.tile(omega, 3)])
    begin[2, n : 2 * n] += _VARIED
    begin[3, 2 * n :] += _VARIED
    end = advanced(model, c, begin, np.tile(u, 3), dt)[:2].reshape(2, 3, n)
    return end[:, 0], (end[:, 1:] - end[:, :1]) / _VARIED


def advanced(model: Model, c: FloatArray, x: FloatArray, u: FloatArray, dt: float) -> FloatArray:
    """The states (4, n) after an interval of `dt` s, without derivatives: see `integrate`."""

    def slope(x: FloatArray, tau: FloatArray) -> FloatArray:
        return np.concatenate([x[2:], acceleration(model, c, x[:2], x[2:], tau)])

    h = dt / u.shape[0]
    for begin, middle, end in u:
        a = slope(x, begin)
        b = slope(x + 0.5 * h * a, middle)
        d = slope(x + 0.5 * h * b, middle)
        x = x + h / 6 * (a + 2 * (b + d) + slope(x + h * d, end))
    return x


def integrate(
    model: Model, c: FloatArray, x: FloatArray, driving: Driving, dt: float
) -> tuple[FloatArray, FloatArray]:
    """The states (4, n) after an interval, and their derivatives X (4, K, n).

    Parameters
    ----------
    model : Model
    c : (q,), in `algid.model.UNITS`
    x : (4, n)
        States at the interval's beginning.
    driving : Driving
        X's columns are by the state, by the torques of the noise's samples, joint after joint, by
        the coefficients, and by the torques beside.
    dt : float, s
        The interval's length.
    """
    u, noise = driving.u, driving.noise
    by_c = _STATE + 2 * noise.count
    beside = by_c + c.size
    X = np.zeros((_STATE, beside + driving.beside.shape[3], x.shape[1]))
    X[range(_STATE), range(_STATE)] = 1.0

    def slope(x: FloatArray, X: FloatArray, step: int, stage: int) -> tuple[FloatArray, FloatArray]:
        theta, omega = x[:2], x[2:]
        alpha = acceleration(model, c, theta, omega, u[step, stage])
        motion = Motion(theta, omega, alpha)
        P = partials(model, c, motion)
        force = -times(P[0], X[:2])
        force -= times(P[1], X[2:])
        for place, weight in enumerate(noise.weights[step, stage]):
            for joint in range(2):
                force[joint, _STATE + 2 * place + joint] += weight
        force[:, by_c:beside] -= sensitivity(model, c, motion)
        force[:, beside:] += driving.beside[step, stage]
        change = np.concatenate([X[2:], times(inverted(P[2]), force)])
        return np.concatenate([omega, alpha]), change

    h = dt / u.shape[0]
    for step in range(u.shape[0]):
        a, A = slope(x, X, step, 0)
        b, B = slope(x + 0.5 * h * a, X + 0.5 * h * A, step, 1)
        d, D = slope(x + 0.5 * h * b, X + 0.5 * h * B, step, 1)
        f, E = slope(x + h * d, X + h * D, step, 2)
        x = x + h / 6 * (a + 2 * (b + d) + f)
        X = X + h / 6 * (A + 2 * (B + D) + E)
    return x, X


def inverted(M: FloatArray) -> FloatArray:
    """Inverses of matrices M (2, 2, n)."""
    (a, b), (c, d) = M
    return np.stack([np.stack([d, -b]), np.stack([-c, a])]) / (a * d - b * c)


def times(M: FloatArray, columns: FloatArray) -> FloatArray:
    """Products (2, K, n) of matrices (2, 2, n) and columns (2, K, n)."""
    product = M[:, 0, None] * columns[0]
    product += M[:, 1, None] * columns[1]
    return product
