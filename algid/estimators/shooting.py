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

from dataclasses import dataclass
from math import ceil

import numpy as np

from algid.arm import FloatArray
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
_FEWEST_INTERVALS = 8
_ITERATIONS = 12
_JOINED = 1e-10  # rad
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
    """

    F: FloatArray
    first_torque: int
    length: int

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
            *_residual(model, c, theta0, piece, late, stencil.held, delay),
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


def _residual(
    model: Model,
    c: FloatArray,
    theta0: FloatArray,
    piece: Segment,
    late: float,
    held: bool,
    delay: bool,
) -> tuple[_Residual, Motion]:
    """The residual of a piece and its derivatives, and the motion (2, n) where it stands."""
    N, dt = theta0.shape[1], piece.dt
    # the same intervals whatever the hold: likelihoods of both are compared
    low = min(max(0, KNOTS // 2 - 1 + ceil(late)), N)
    n = max(0, min(N - 1, N - KNOTS // 2 + int(np.floor(late))) - low)
    if n < _FEWEST_INTERVALS:
        raise np.linalg.LinAlgError("the piece is shorter than what its torque rests on")
    theta = theta0[:, low : low + n + 1]
    steps = max(_FEWEST_STEPS, ceil(float(np.abs(np.diff(theta, axis=1)).max()) / _TURN))
    smooth = between(late, steps, held=held)
    straight = between(late, steps, held=held, points=2)
    u = smooth.at_stages(piece.tau, low, n)
    beside = np.empty((steps, 3, 2, 0, n))
    if delay:
        sooner = between(late - _DELAYED, steps, held=held).at_stages(piece.tau, low, n)
        later = between(late + _DELAYED, steps, held=held).at_stages(piece.tau, low, n)
        beside = ((later - sooner) / (2 * _DELAYED * dt))[:, :, :, None]
    omega = _beginning(model, c, theta, u, dt)
    begin = np.concatenate([theta[:, :-1], omega])
    end, X = integrate(model, c, begin, Driving(u, straight, beside), dt)
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
    k = straight.count
    r_u = np.zeros((2, 2, k + 1, n - 1))
    for sample in range(k):
        own = slice(2 * sample, 2 * sample + 2)
        r_u[:, :, sample] -= minus_rest[:, own, :-1]
        r_u[:, :, sample + 1] += plus_rest[:, own, 1:]
    r_c = plus_rest[:, 2 * k :, 1:] - minus_rest[:, 2 * k :, :-1]
    W = inverted(r_u.sum(axis=2))
    e = times(W, (omega[:, 1:] - end[2:, :-1])[:, None])[:, 0]
    G = -np.stack([times(W, r_theta[:, :, point]) for point in range(3)], axis=2)
    F = np.stack([times(W, r_u[:, :, sample]) for sample in range(k + 1)], axis=2)
    at = Motion(
        theta[:, 1:-1],
        omega[:, 1:],
        acceleration(model, c, theta[:, 1:-1], omega[:, 1:], u[0, 0, :, 1:]),
    )
    return _Residual(e, F, G, -times(W, r_c), low, low + straight.first), at


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
    )


def _beginning(
    model: Model, c: FloatArray, theta: FloatArray, u: FloatArray, dt: float
) -> FloatArray:
    """Velocities ω⁺ (2, n) with which the motion between angles (2, n + 1) begins."""
    omega = np.gradient(theta, dt, axis=1)[:, :-1]
    for _ in range(_ITERATIONS):
        end, X = integrate(model, c, np.concatenate([theta[:, :-1], omega]), u, dt)
        miss = theta[:, 1:] - end[:2]
        omega = omega + times(inverted(X[:2]), miss[:, None])[:, 0]
        if np.abs(miss).max() < _JOINED:
            return omega
    raise np.linalg.LinAlgError("no motion was found that joins the angles")


def integrate(
    model: Model, c: FloatArray, x: FloatArray, drive: Driving | FloatArray, dt: float
) -> tuple[FloatArray, FloatArray]:
    """The states (4, n) after an interval, and their derivatives X (4, K, n).

    Parameters
    ----------
    model : Model
    c : (q,), in `algid.model.UNITS`
    x : (4, n)
        States at the interval's beginning.
    drive : Driving, or its torques u
        X's columns are by the state, by the torques of the noise's samples, joint after joint, by
        the coefficients and by the torques beside; of torques alone, by the two velocities.
    dt : float, s
        The interval's length.
    """
    whole = isinstance(drive, Driving)
    u = drive.u if isinstance(drive, Driving) else drive
    first = _STATE if whole else 2
    by_noise = by_c = beside = 0
    if isinstance(drive, Driving):
        by_noise, by_c, beside = 2 * drive.noise.count, c.size, drive.beside.shape[3]
    X = np.zeros((4, first + by_noise + by_c + beside, x.shape[1]))
    for column in range(first):
        X[_STATE - first + column, column] = 1.0

    def slope(x: FloatArray, X: FloatArray, step: int, stage: int) -> tuple[FloatArray, FloatArray]:
        theta, omega = x[:2], x[2:]
        alpha = acceleration(model, c, theta, omega, u[step, stage])
        motion = Motion(theta, omega, alpha)
        P = partials(model, c, motion)
        force = -times(P[0], X[:2])
        force -= times(P[1], X[2:])
        if isinstance(drive, Driving):
            for place, weight in enumerate(drive.noise.weights[step, stage]):
                for joint in range(2):
                    force[joint, first + 2 * place + joint] += weight
            at = first + by_noise
            force[:, at : at + by_c] -= sensitivity(model, c, motion)
            force[:, at + by_c :] += drive.beside[step, stage]
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
