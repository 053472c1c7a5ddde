"""Errors in variables, linearised and whitened: the heart of the refined estimator.

Angles and torques are both measured with noise: θ_m = θ + ε, τ_m = f(θ, θ̇, θ̈; c) + η. Linearised
at a trajectory near the truth, the torque residual

    e = τ_m − f(θ0; c) − G (θ_m − θ0) = η − G ε + Y δc

has the covariance Σ_τ + G Σ_θ Gᵀ. τ_m is `Stencil.moving` of the
logged torque, whose noise is white: η is F times white noise. The stencil makes G, hence that
matrix, banded: one Cholesky factor L Lᵀ = V whitens everything. Minimising
over the trajectory as well as over c, the Schur complement of the normal equations, is the same as
weighting e by V⁻¹ (Woodbury), so S = (L⁻¹Y)ᵀ(L⁻¹Y) is the information on c and the innovations w =
L⁻¹e are white with unit variance wherever the model holds.

======  ====================================================  =======================  ======
symbol  name                                                  shape                    unit
======  ====================================================  =======================  ======
H       dτ/dθ along the stencil, times σ_θ / σ_τ              (2, 2, POINTS, n)        1
F       `Stencil.taps`: I, a held torque, a low-pass undone   (n, n) of each joint     1
V       F Fᵀ + H Hᵀ, covariance of e / σ_τ, upper band        (2 POINTS, 2 n)          1
Z       L⁻¹ of the columns of [Y, e] / σ_τ                    (q + 1, 2 n)             mixed
======  ====================================================  =======================  ======

Rows run (sample, joint): joint 1 and joint 2 of a sample are neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from algid.arm import FloatArray
from algid.base.compiled import lapack
from algid.estimators.elastic import flexed, with_bends
from algid.model import Model, Motion, partials, regressor, sensitivity, torque
from algid.signals.differences import POINTS, Stencil
from algid.signals.filters import correlate, recursion, smoothed
from algid.signals.segments import Segment

_SMOOTHING = 40.0  # Hz: arms move slower; of the trajectory at which a piece is first linearised
_AS_LOGGED = np.ones(1)
"""The taps of a torque that counts as it is logged."""
_ROUNDING = 8 * np.finfo(np.float64).eps
"""A pivot's least share of its diagonal: below it, every digit of the pivot is lost."""


class NoiseLevels(NamedTuple):
    """Standard deviations of white noise on the angles (2,) in rad and the torques (2,) in N m."""

    theta: FloatArray
    tau: FloatArray


@dataclass(frozen=True, eq=False)
class Linearised:
    """One piece of log, linearised and whitened: see the module's table.

    `factor` holds Lᵀ as LAPACK's upper band; `first` is the angle sample of the first stencil's
    first point, of so many `angles`; `motion` is where the columns but the residual stand; `taps`
    are F's.
    """

    columns: FloatArray
    factor: FloatArray
    H: FloatArray
    first: int
    angles: int
    motion: Motion
    taps: FloatArray

    def to_angles(self, rows: FloatArray) -> FloatArray:
        """Hᵀ (..., 2, N) of rows (..., 2, n)."""
        return adjoint(self.H, rows, self.first, self.angles)


def smeared(rows: FloatArray, taps: FloatArray) -> FloatArray:
    """F of torque noise (..., n), zero beyond its ends; Fᵀ by the taps from behind."""
    reach = taps.size // 2
    return correlate(np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(reach, reach)]), taps)


def whiten(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """L⁻¹ (m, 2 n) of torques (m, 2, n) over their noise, by the band of Lᵀ."""
    # of an upper triangle transposed, which LAPACK solves by products of rows: a quarter faster
    return _solved(factor, rows.swapaxes(1, 2).reshape(len(rows), -1), "T")


def multipliers(factor: FloatArray, columns: FloatArray) -> FloatArray:
    """L⁻ᵀ (m, 2, n) of whitened columns (m, 2 n), by the band of Lᵀ."""
    rows = _solved(factor, columns, "N")
    return np.ascontiguousarray(rows.reshape(len(rows), -1, 2).swapaxes(1, 2))


def _solved(factor: FloatArray, columns: FloatArray, transposed: str) -> FloatArray:
    solution, info = lapack.dtbtrs(factor, columns.T, uplo="U", trans=transposed)
    if info != 0:
        raise np.linalg.LinAlgError(f"banded substitution failed with info {info}")
    return solution.T


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
    smooth: FloatArray | None = None,
    by_motion: bool = False,
) -> Linearised:
    """Linearise a piece of log at a trajectory and at coefficients, and whiten it.

    Parameters
    ----------
    model : Model
    c : (q,), in `algid.model.UNITS`, or (q, n) where each torque sample has its own
    theta0 : (2, N), rad
        The trajectory, near the truth.
    piece : Segment of N samples
    stencil : Stencil
        Its shift is when a logged torque acts; it holds what undoes a hold or a low-pass.
    noise : NoiseLevels
    delay : bool
        Whether the last column but the residual is the derivative of the torque by the stencil's
        shift.
    residual_only : bool
        Whether the residual is the only column, which is all that a trajectory needs.
    smooth : (2, N), rad
        A trajectory at which the derivatives by c are taken in place of `theta0`, without the
        noise that is left in that one's accelerations.
    by_motion : bool
        Whether the motion, and not the torque, tells what bends elastic joints.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the covariance is not positive definite in floating point, or the torque acts before or
        after all angles, as where an estimate of its delay runs away.
    """
    length = theta0.shape[1]
    torques, first = stencil.torques(length), stencil.first(length)
    if torques.stop <= torques.start:
        raise np.linalg.LinAlgError(f"no torque acts within the angles, {stencil.shift} s later")
    measured = stencil.moving(piece.tau)[:, torques]
    acting = None if by_motion else measured

    def at(theta: FloatArray) -> tuple[Motion, FloatArray, FloatArray]:
        motion = flexed(model, c, Motion(*stencil.differences(theta)), stencil.dt, acting)
        return motion, *modelled(model, c, motion, stencil.dt)

    motion, J, tau = at(theta0)
    G = along_stencil(partials(model, c, motion), stencil.weights)
    error = measured - tau - forward(G, piece.theta - theta0, first)
    if smooth is not None:
        motion, J, tau = at(smooth)
    parts = []
    if not residual_only:
        parts.append(J.swapaxes(0, 1))
        if delay:
            parts.append(np.gradient(tau, stencil.dt, axis=1)[None])
    rows = np.concatenate([*parts, error[None]])
    H, factor, columns = whitened(rows, G, noise, stencil.taps)
    return Linearised(columns, factor, H, first, length, motion, stencil.taps)


def whitened(
    rows: FloatArray, G: FloatArray, noise: NoiseLevels, taps: FloatArray = _AS_LOGGED
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """H, the factor of V, and the whitened columns (m, 2 n) of torques `rows` (m, 2, n) in N m.

    Parameters
    ----------
    rows : (m, 2, n), N m over each column's unit
    G : (2, 2, POINTS, n), `along_stencil`
    noise : NoiseLevels
    taps : (p,), `Stencil.taps`

    Raises
    ------
    numpy.linalg.LinAlgError
        If the covariance is not positive definite in floating point.
    """
    H = G * (noise.theta / noise.tau[:, None])[:, :, None, None]
    factor = covariance_factor(H, taps)
    return H, factor, whiten(factor, rows / noise.tau[:, None])


def modelled(
    model: Model, c: FloatArray, motion: Motion, dt: float
) -> tuple[FloatArray, FloatArray]:
    """Derivatives (2, q, n) of the torque by coefficients, and the torque (2, n) in N m.

    `c` is (q,), or (q, n) where each sample has its own.
    """
    if model.linear:
        J = regressor(model, motion)
        tau = np.einsum("aqn,qn->an", J, c.reshape(c.shape[0], -1))
    else:
        J, tau = sensitivity(model, c, motion), torque(model, c, motion)
        J = with_bends(model, c, motion, J, dt)
    if model.lag_name is not None:
        J[:, model.names.index(model.lag_name)] = -_low_passed_slope(tau, dt, model.lag(c))
    return J, tau


def _low_passed_slope(tau: FloatArray, dt: float, lag: float) -> FloatArray:
    """dτ_log/dt (2, n) in N m/s of a torque whose low-pass of `lag` s is logged."""
    if lag < 0:
        return -_low_passed_slope(tau[:, ::-1], dt, -lag)[:, ::-1]
    if lag < 1e-6 * dt:
        return np.gradient(tau, dt, axis=1)
    # exact for a torque that is straight between its samples
    decay = np.exp(-dt / lag)
    mean = (1 - decay) * lag / dt
    numerator, denominator = np.array([mean, -mean]) / lag, np.array([1.0, -decay])
    return recursion(numerator, denominator, tau - tau[:, :1], np.zeros((2, 1)))[0]


def along_stencil(P: FloatArray, weights: FloatArray) -> FloatArray:
    """G, the derivative of each torque by each angle that its stencil touches.

    Parameters
    ----------
    P : (3, 2, 2, n), `algid.model.partials`
    weights : (3, POINTS), of the stencil's value and its two derivatives, in 1, 1/s and 1/s²

    Returns
    -------
    (2, 2, POINTS, n), N m/rad, by torque's joint, angle's joint and point
    """
    n = P.shape[-1]
    G = weights.T @ P.reshape(3, 4 * n)
    return np.ascontiguousarray(G.reshape(POINTS, 2, 2, n).transpose(1, 2, 0, 3))


def forward(G: FloatArray, x: FloatArray, first: int) -> FloatArray:
    """G x (2, n) in N m of angle changes x (2, N) in rad.

    `first` is the sample of the first stencil's first point.
    """
    windows = sliding_window_view(x, G.shape[-1], axis=1)[:, first : first + G.shape[2]]
    return np.asarray(np.einsum("abpn,bpn->an", G, windows))


def adjoint(G: FloatArray, y: FloatArray, first: int, length: int) -> FloatArray:
    """Gᵀ y (..., 2, N) of torques y (..., 2, n), N = `length`: the transpose of `forward`."""
    n = G.shape[-1]
    result = np.zeros((*y.shape[:-1], length))
    for point in range(G.shape[2]):
        touched = result[..., first + point : first + point + n]
        touched += np.einsum("abn,...an->...bn", G[:, :, point], y)
    return result


def covariance_factor(H: FloatArray, taps: FloatArray = _AS_LOGGED) -> FloatArray:
    """Cholesky factor Lᵀ of V = F Fᵀ + H Hᵀ.

    Parameters
    ----------
    H : (2, 2, POINTS, n)
    taps : (p,), of F

    Returns
    -------
    (2 POINTS, 2 n), LAPACK's upper band, the diagonal last

    Raises
    ------
    numpy.linalg.LinAlgError
        If V is not positive definite in floating point.
    """
    points, n = H.shape[2:]
    band = np.zeros((n, 2, 2 * points))
    for lag in range(points):
        early, late = H[:, :, lag:, : n - lag], H[:, :, : points - lag, lag:]
        block = np.einsum("abpn,obpn->aon", early, late)
        for a, other in np.ndindex(2, 2):
            above = 2 * lag + other - a
            if above >= 0:
                band[lag:, other, -1 - above] = block[a, other]
    for lag, value in enumerate(np.correlate(taps, taps, "full")[taps.size - 1 :]):
        band[:, :, -1 - 2 * lag] += value
    diagonal = band[:, :, -1].ravel().copy()
    factor, info = lapack.dpbtrf(band.reshape(2 * n, -1).T, lower=0, overwrite_ab=1)
    # whether a pivot of nothing but rounding comes out below zero, the processor's kernels decide
    lost = factor[-1] ** 2 < _ROUNDING * diagonal
    if info or lost.any():
        raise np.linalg.LinAlgError(
            "the covariance of the torque residual is not positive definite "
            f"(row {info or np.argmax(lost) + 1})"
        )
    return factor


def first_trajectory(theta: FloatArray, dt: float) -> FloatArray:
    """Angles (2, N), sampled every `dt` s, without what is faster than a motion."""
    return smoothed(theta, dt, min(_SMOOTHING, 0.1 / dt))


def trajectory(piece: Segment, linear: Linearised, noise: NoiseLevels) -> FloatArray:
    """Most likely angles θ_m + Σ_θ Gᵀ V⁻¹e (2, N) in rad of a piece of N samples."""
    (back,) = linear.to_angles(multipliers(linear.factor, linear.columns[-1:]))
    return np.asarray(piece.theta + noise.theta[:, None] * back)
